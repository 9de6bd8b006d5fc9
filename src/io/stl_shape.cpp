#include "io/stl_shape.h"

#include <algorithm>
#include <string_view>
#include <utility>

namespace pietra {

void FacetShape::learn(const char* begin, const char* end) {
    std::vector<const char*> ends{begin};  // of words, numbered from 1
    for (const char* p = begin; p < end; ++p) {
        // note: a zero byte would let a gap go on behind the end of the text.
        if (*p < ' ' && std::string_view("\t\r\n").find(*p) == std::string_view::npos) return;
        if (*p > ' ' && (p + 1 == end || p[1] <= ' ')) ends.push_back(p + 1);
    }
    // facet normal . . . outer loop vertex . . . vertex . . . vertex . . . endloop endfacet
    constexpr size_t kWords = 21;
    constexpr std::pair<size_t, size_t> kBetween[] = {{0, 2}, {5, 8}, {11, 12}, {15, 16}, {19, 21}};
    if (ends.size() != 1 + kWords) return;
    std::array<Gap, 5> gaps;
    for (size_t i = 0; i < gaps.size(); ++i) {
        const auto [from, to] = kBetween[i];
        gaps[i].size = size_t(ends[to] - ends[from]);
        if (gaps[i].size > sizeof gaps[i].text) return;
        for (size_t k = 0; k < sizeof gaps[i].text; ++k) {
            const bool inside = k < gaps[i].size;
            gaps[i].text[k / 16][k % 16] = inside ? ends[from][k] : char(0);
            gaps[i].beyond[k / 16][k % 16] = inside ? char(0) : char(-1);
        }
    }
    gaps_ = gaps;
    points_.resize(size_t(1) << kPointBits);
}

}  // namespace pietra
