#pragma once
// Facets of a text STL are spelled alike but for their numbers, and each point stands there about
// six times. FacetShape remembers what a facet has between its numbers, and some of the points met
// of late by their text: what it knows again is taken at a glance, all else is for a reader of
// words. What comes out is the same. Memory: some 160 KiB, few enough to stay in the
// processor's cache, once a facet was learned.

#include <emmintrin.h>

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "geometry/vec.h"
#include "io/number_parser.h"
#include "io/text_window.h"

namespace pietra {

class FacetShape {
public:
    /// Remembers the spelling of the facet [begin, end), which is well formed and starts where the
    /// word before it ended. Leaves all as it is where something in it is unusual.
    void learn(const char* begin, const char* end);
    /// Takes the facet at `p` if it is spelled so and its corners are finite; returns the character
    /// after it, else null. `end`: where the text ends, with a zero byte and 63 more to read.
    const char* take(const char* p, const char* end, Vec3d* corners);

private:
    using Block = std::array<char, 16>;
    /// Text from behind a number to the end of the last word before the next one.
    struct Gap {
        static constexpr size_t kBlocks = 3;
        size_t size = 0;
        std::array<Block, kBlocks> text{};
        std::array<Block, kBlocks> beyond{};  ///< ones behind `size`

        const char* pass(const char* p) const;
    };
    struct Point {
        static constexpr size_t kBytes = 48;
        std::array<char, kBytes> text{};
        Vec3d at{};
        uint64_t size = UINT64_MAX;  ///< of the text
    };
    static constexpr int kPointBits = 11;

    static __m128i load(const char* from) {
        return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
    }
    static uint64_t bitsOf(__m128i bytes) { return uint64_t(_mm_movemask_epi8(bytes)); }
    static bool isBlank(char c) { return uint8_t(c) <= ' '; }
    static const char* passNormal(const char* p, const char* end);
    static const char* parsePoint(const char* p, const char* end, Vec3d& point);
    const char* takePoint(const char* p, const char* end, Vec3d& point);

    std::array<Gap, 5> gaps_;  ///< before the normal, before each corner, after the last one
    std::vector<Point> points_;
};

/// The character after the same text at `p`, or null.
inline const char* FacetShape::Gap::pass(const char* p) const {
    for (size_t i = 0; 16 * i < size; ++i) {
        const __m128i same = _mm_cmpeq_epi8(load(p + 16 * i), load(text[i].data()));
        if (bitsOf(_mm_or_si128(same, load(beyond[i].data()))) != 0xffff) return nullptr;
    }
    return p + size;
}

/// The end of the third word from `p` on, where none begins before; null where the text ends.
inline const char* FacetShape::passNormal(const char* p, const char* end) {
    const auto solid = [&](int at) {
        const __m128i text = load(p + at), least = _mm_set1_epi8(' ' + 1);
        return bitsOf(_mm_cmpeq_epi8(_mm_max_epu8(text, least), text)) << at;
    };
    int words = 0;
    for (uint64_t before = 0; p < end; p += 64) {
        const uint64_t all = solid(0) | solid(16) | solid(32) | solid(48);
        for (uint64_t ends = ~all & (all << 1 | before); ends; ends &= ends - 1)
            if (++words == 3) return p + std::countr_zero(ends);
        before = all >> 63;
    }
    return nullptr;
}

/// The end of three finite numbers, each behind blanks, of which the first is at `p`; or null.
inline const char* FacetShape::parsePoint(const char* p, const char* end, Vec3d& point) {
    for (int k = 0; k < 3; ++k) {
        if (!isBlank(*p)) return nullptr;
        do ++p;
        while (isBlank(*p) && p < end);
        double value;
        if (!(p = parseReal(p, end, value))) return nullptr;
        point[k] = value;
    }
    // Zero times a number is zero, times anything else it is not.
    if (!(point.x * 0 + point.y * 0 + point.z * 0 == 0)) [[unlikely]]
        return nullptr;
    return p;
}

inline const char* FacetShape::takePoint(const char* p, const char* end, Vec3d& point) {
    const uint64_t hash = loadEight(p) * 0x9e3779b97f4a7c15 ^
                          loadEight(p + 8) * 0xc2b2ae3d27d4eb4f ^
                          loadEight(p + 16) * 0x165667b19e3779f9;
    Point& known = points_[hash * 0x9fb21c651e98df25 >> (64 - kPointBits)];
    const auto same = [&](int at) {
        return bitsOf(_mm_cmpeq_epi8(load(p + at), load(&known.text[size_t(at)]))) << at;
    };
    if (uint64_t(std::countr_one(same(0) | same(16) | same(32))) >= known.size) [[likely]] {
        point = known.at;
        return p + known.size;
    }
    const char* const after = parsePoint(p, end, point);
    // What follows is for the gap after it to check: "1.2" is found in "1.25", but not taken.
    if (after && after - p <= ptrdiff_t(Point::kBytes)) {
        std::copy(p, p + Point::kBytes, known.text.begin());
        known.at = point;
        known.size = uint64_t(after - p);
    }
    return after;
}

inline const char* FacetShape::take(const char* p, const char* end, Vec3d* corners) {
    if (points_.empty()) return nullptr;
    if (!(p = gaps_[0].pass(p)) || !isBlank(*p) || !(p = passNormal(p, end))) return nullptr;
    for (size_t k = 0; k < 3; ++k)
        if (!(p = gaps_[k + 1].pass(p)) || !(p = takePoint(p, end, corners[k]))) return nullptr;
    p = gaps_[4].pass(p);
    return p && isBlank(*p) ? p : nullptr;
}

}  // namespace pietra
