// Text STL: word by word, but for the many facets that are spelled as the one before.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>

#include "base/error.h"
#include "io/file_signs.h"
#include "io/number_parser.h"
#include "io/stl_facets.h"
#include "io/stl_shape.h"
#include "io/text_window.h"

namespace pietra {

namespace {

char lowerCase(char c) {
    return c >= 'A' && c <= 'Z' ? char(c + ('a' - 'A')) : c;
}

/// Blanks are all characters up to the space: also the zero bytes or ^Z that some files end with.
bool isBlank(uint8_t c) {
    return c <= ' ';
}

/// Words of a text, one after the other.
class WordReader : private TextWindow {
public:
    explicit WordReader(ByteReader& reader) : TextWindow(reader) {}

    using TextWindow::offset;
    using TextWindow::seek;

    /// The next word, or "" at the end of the file; good until the next call.
    std::string_view next() {
        const char* const word = skipBlanks();
        int solid;
        do {
            solid = zerosBefore(solidBytes(loadEight(p_)) ^ eightTimes(0x80));
            p_ += solid;
        } while (solid == 8);
        if (p_ - word > ptrdiff_t(kMaxWord))
            fail(fmt::format("a word of more than {} characters", kMaxWord));
        return {word, size_t(p_ - word)};
    }

    /// Passes over a word that must be `expected` (in lower case).
    template <size_t N>
    void expect(const char (&expected)[N]) {
        constexpr size_t kLength = N - 1;
        const char* const word = skipBlanks();
        if (std::memcmp(word, expected, kLength) == 0 && isBlank(uint8_t(word[kLength]))) [[likely]]
            p_ += kLength;
        else if (const std::string_view found = next(); !isWord(found, expected))
            failWord(found, fmt::format("\"{}\"", expected));
    }

    double nextReal() {
        const char* const word = skipBlanks();
        double value = 0;
        const char* const after = parseReal(word, end_, value);
        if (!after || !isBlank(uint8_t(*after))) [[unlikely]]
            failWord(next(), "a number");
        p_ = after;
        return value;
    }

    /// A place in the text, to look back to.
    struct Mark {
        const char* p;
        uint64_t offset;
    };
    Mark mark() {
        need();
        return {p_, offset()};
    }
    /// What `shape` is to learn lies between `mark` and here.
    void teach(const Mark& mark, FacetShape& shape) const {
        // Where the window has slid, the text is not there any more.
        if (offset() - mark.offset == uint64_t(p_ - mark.p)) shape.learn(mark.p, p_);
    }
    /// Passes over a facet of that shape; false, and nothing done, where there is another or none.
    bool take(FacetShape& shape, Vec3d* corners) {
        need();
        const char* const after = shape.take(p_, end_, corners);
        if (!after || after - p_ >= ptrdiff_t(kMaxWord)) return false;
        p_ = after;
        return true;
    }

    void skipLine() {
        for (;; ++p_) {
            need();
            if (p_ == end_ || *p_ == '\n' || *p_ == '\r') return;
        }
    }

    static bool isWord(std::string_view word, std::string_view expected) {
        return word.size() == expected.size() &&
               std::equal(word.begin(), word.end(), expected.begin(),
                          [](char a, char b) { return lowerCase(a) == b; });
    }

    /// Says on which line, which nothing else needs to know.
    [[noreturn]] void fail(const std::string& what) {
        const uint64_t place = offset();
        uint64_t line = 1;
        seek(0);
        for (char before = 0; offset() < place && p_ != end_; before = *p_++, need())
            // A pair of both is one end of a line.
            line += *p_ == '\r' || (*p_ == '\n' && before != '\r');
        throw InputError::atLine(reader_.path(), line, what);
    }
    [[noreturn]] void failWord(std::string_view word, const std::string& expected) {
        if (word.empty()) fail(fmt::format("the file ends where {} is expected", expected));
        fail(fmt::format("\"{}\" stands where {} is expected", shownWord(word.data()), expected));
    }

private:
    /// Moves to the next word, or the end of the file; returns where that is.
    const char* skipBlanks() {
        for (;;) {
            need();
            const char c = *p_;
            if (!isBlank(uint8_t(c)) || p_ == end_) return p_;
            ++p_;
            p_ += zerosBefore(loadEight(p_) ^ eightTimes(' '));
        }
    }
};

class TextStl : public StlFacets {
public:
    explicit TextStl(ByteReader& reader) : words_(reader) {}

    StlPlace start() const override { return {}; }
    std::optional<uint64_t> count() const override { return {}; }

    size_t read(StlPlace& place, std::span<Vec3d> corners) override {
        words_.seek(place.offset);
        size_t done = 0;
        for (; 3 * done + 3 <= corners.size(); ++done, ++place.facet) {
            Vec3d* const facet = &corners[3 * done];
            if (place.in_solid && words_.take(shape_, facet)) continue;
            const WordReader::Mark begin = words_.mark();
            if (!nextFacet(place)) break;
            readFacet(facet);
            words_.teach(begin, shape_);
        }
        place.offset = words_.offset();
        return done;
    }

    std::vector<std::string> notes() const override { return {}; }

private:
    /// Goes to the next "facet" and over it; false at the end of the last solid.
    bool nextFacet(StlPlace& place) {
        for (;;) {
            std::string_view word = words_.next();
            if (!place.in_solid) {
                if (word.empty()) return false;
                if (place.facet == 0) word = withoutMark(word);
                if (!WordReader::isWord(word, "solid")) words_.failWord(word, "\"solid\"");
                words_.skipLine();
                place.in_solid = true;
            } else if (WordReader::isWord(word, "facet")) {
                return true;
            } else if (WordReader::isWord(word, "endsolid")) {
                words_.skipLine();
                place.in_solid = false;
            } else if (word.empty()) {
                words_.fail(
                    fmt::format("the file ends within a solid, after {} triangles", place.facet));
            } else {
                words_.failWord(word, "\"facet\" or \"endsolid\"");
            }
        }
    }

    void readFacet(Vec3d* corners) {
        words_.expect("normal");
        for (int k = 0; k < 3; ++k) words_.next();
        words_.expect("outer");
        words_.expect("loop");
        for (int corner = 0; corner < 3; ++corner) {
            words_.expect("vertex");
            Vec3d& p = corners[corner];
            for (int k = 0; k < 3; ++k) p[k] = words_.nextReal();
            if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
                words_.fail(
                    fmt::format("a corner is at ({}, {}, {}), which is no point", p.x, p.y, p.z));
        }
        words_.expect("endloop");
        words_.expect("endfacet");
    }

    WordReader words_;
    FacetShape shape_;
};

}  // namespace

bool beginsAsStlText(std::span<const uint8_t> head) {
    constexpr std::string_view kSolid = "solid";
    std::string_view text = FileSigns{head, "", 0}.text();
    while (!text.empty() && isBlank(uint8_t(text.front()))) text.remove_prefix(1);
    return text.size() >= kSolid.size() &&
           WordReader::isWord(text.substr(0, kSolid.size()), kSolid) &&
           (text.size() == kSolid.size() || isBlank(uint8_t(text[kSolid.size()])));
}

std::unique_ptr<StlFacets> openTextStl(ByteReader& reader) {
    return std::make_unique<TextStl>(reader);
}

}  // namespace pietra
