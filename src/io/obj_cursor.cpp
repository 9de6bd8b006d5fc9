#include "io/obj_cursor.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "base/error.h"
#include "io/file_signs.h"

namespace pietra {

namespace {

struct LongWord {
    std::string_view word;
    ObjWord kind;
};

/// The words of the format (Alias|Wavefront, Advanced Visualizer manual, appendix B1) that are of
/// more than two characters or seldom met.
constexpr LongWord kLongWords[] = {
    {"fo", ObjWord::kFace},          {"g", ObjWord::kGroup},         {"o", ObjWord::kGroup},
    {"s", ObjWord::kGroup},          {"mg", ObjWord::kGroup},        {"lod", ObjWord::kGroup},
    {"bevel", ObjWord::kGroup},      {"c_interp", ObjWord::kGroup},  {"d_interp", ObjWord::kGroup},
    {"shadow_obj", ObjWord::kGroup}, {"trace_obj", ObjWord::kGroup}, {"usemtl", ObjWord::kMaterial},
    {"mtllib", ObjWord::kMaterial},  {"usemap", ObjWord::kMaterial}, {"maplib", ObjWord::kMaterial},
    {"vp", ObjWord::kFreeForm},      {"deg", ObjWord::kFreeForm},    {"bmat", ObjWord::kFreeForm},
    {"step", ObjWord::kFreeForm},    {"cstype", ObjWord::kFreeForm}, {"curv", ObjWord::kFreeForm},
    {"curv2", ObjWord::kFreeForm},   {"surf", ObjWord::kFreeForm},   {"parm", ObjWord::kFreeForm},
    {"trim", ObjWord::kFreeForm},    {"hole", ObjWord::kFreeForm},   {"scrv", ObjWord::kFreeForm},
    {"sp", ObjWord::kFreeForm},      {"end", ObjWord::kFreeForm},    {"con", ObjWord::kFreeForm},
    {"ctech", ObjWord::kFreeForm},   {"stech", ObjWord::kFreeForm},  {"bsp", ObjWord::kFreeForm},
    {"bzp", ObjWord::kFreeForm},     {"cdc", ObjWord::kFreeForm},    {"cdp", ObjWord::kFreeForm},
    {"res", ObjWord::kFreeForm},
};

/// How many words lie in [p, end): eight bytes at a time, of which up to seven beyond the end are
/// read.
size_t wordsBetween(const char* p, const char* end) {
    uint64_t blank_before = 0x80;  // the top bit of the lowest byte: that of the byte before
    uint64_t count = 0;
    for (; p < end; p += 8) {
        uint64_t solid = solidBytes(loadEight(p));
        if (end - p < 8) solid &= ~uint64_t(0) >> (64 - 8 * (end - p));
        const uint64_t starts = solid & (~solid << 8 | blank_before);
        count += (starts >> 7) * eightTimes(1) >> 56;
        blank_before = ~solid >> 56 & 0x80;
    }
    return count;
}

/// As parseInteger(), where the number is often that whose text is [known, known + size),
/// known_index: most files give a corner the same index of everything.
const char* takeLikelyIndex(const char* p, const char* known, size_t size, int64_t known_index,
                            int64_t& index) {
    const uint64_t differs = loadEight(p) ^ loadEight(known);
    if (size < 8 && differs << (64 - 8 * size) == 0 && !isDigit(p[size])) {
        index = known_index;
        return p + size;
    }
    return parseInteger(p, index);
}

}  // namespace

ObjPlace ObjCursor::start() {
    reader_.seek(0);
    const size_t size = reader_.peek(ByteReader::kWindow);
    const std::string_view text(reinterpret_cast<const char*>(reader_.data()), size);
    line_end_ = text.find('\r') != text.npos && text.find('\n') == text.npos ? '\r' : '\n';
    seek({text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0, 1});
    return place();
}

void ObjCursor::skipComment() {
    for (;;) {
        const void* const end = std::memchr(p_, line_end_, size_t(end_ - p_));
        p_ = end ? static_cast<const char*>(end) : end_;
        if (end || at_end_) return;
        refill();
    }
}

ObjWord ObjCursor::takeWord() {
    const char c = *p_, next = p_[1];
    if (endsWord(p_ + 1)) {
        if (c == 'v') return ++p_, ObjWord::kVertex;
        if (c == 'f') return ++p_, ObjWord::kFace;
        if (c == 'l') return ++p_, ObjWord::kLine;
        if (c == 'p') return ++p_, ObjWord::kPoint;
    } else if (c == 'v' && (next == 'n' || next == 't') && endsWord(p_ + 2)) {
        p_ += 2;
        return next == 'n' ? ObjWord::kNormal : ObjWord::kTexture;
    }
    return takeLongWord();
}

ObjWord ObjCursor::takeLongWord() {
    constexpr size_t kLongest = 12;
    size_t size = 1;
    while (size < kLongest && !endsWord(p_ + size)) ++size;
    const std::string_view word(p_, size);
    for (const LongWord& known : kLongWords)
        if (known.word == word) {
            p_ += size;
            return known.kind;
        }
    return ObjWord::kUnknown;
}

size_t ObjCursor::countWords() {
    const auto lineEnd = [&](const char* from) {
        return static_cast<const char*>(std::memchr(from, line_end_, size_t(end_ - from)));
    };
    if (!at_end_ && !lineEnd(p_)) refill(ByteReader::kWindow);
    const char* end = lineEnd(p_);
    while (end && end > p_ && joinsLines(end[-1] == '\r' ? end - 2 : end - 1))
        end = lineEnd(end + 1);
    return wordsBetween(p_, end ? end : end_);
}

ObjCorner ObjCursor::takeCorner() {
    ObjCorner corner;
    const char* const first = p_;
    const char* p = parseInteger(p_, corner.vertex);
    if (p && *p == '/') {
        const auto size = size_t(p - first);
        const auto takeNext = [&](int64_t& index) {
            ++p;
            if (*p != '/' && !endsWord(p))
                p = takeLikelyIndex(p, first, size, corner.vertex, index);
        };
        takeNext(corner.texture);
        if (p && *p == '/') takeNext(corner.normal);
    }
    if (!p || !endsWord(p)) [[unlikely]]
        failWord("is no corner of a face: v, v/vt, v//vn or v/vt/vn");
    if (corner.vertex == 0) [[unlikely]]
        fail("a face has a vertex of index 0, but indices count from 1");
    p_ = p;
    return corner;
}

void ObjCursor::fail(const std::string& what) const {
    throw InputError::atLine(reader_.path(), line_, what);
}

void ObjCursor::failWord(const std::string& what) const {
    fail(fmt::format("\"{}\" {}", wordHere(), what));
}

}  // namespace pietra
