#include "io/gltf_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string_view>

namespace pietra {

namespace {

constexpr std::string_view kData = "data:";
/// Strings up to this are given whole; the comma before the payload stands within it.
constexpr size_t kShort = 1024;

}  // namespace

GltfText::GltfText(ByteReader& reader, uint64_t begin, uint64_t end) : reader_(reader), end_(end) {
    reader_.seek(begin);
    advance();
}

void GltfText::advance() {
    if (instead_used_ < instead_.size()) {
        current_ = instead_[instead_used_++];
        return;
    }
    offset_ = reader_.offset();
    ended_ = offset_ >= end_ || reader_.peek(1) == 0;
    if (ended_) return;
    current_ = char(*reader_.data());
    reader_.advance(1);
    if (!in_string_) {
        if (current_ == '"') beginString();
    } else if (escaped_) {
        escaped_ = false;
    } else if (current_ == '\\') {
        escaped_ = true;
    } else if (current_ == '"') {
        in_string_ = false;
    }
}

/// Behind an opening quote: looks whether a long payload follows, and passes over it.
void GltfText::beginString() {
    in_string_ = true;
    const uint64_t begin = reader_.offset();
    const size_t size = size_t(std::min<uint64_t>(reader_.peek(kShort), end_ - begin));
    const std::string_view head(reinterpret_cast<const char*>(reader_.data()),
                                std::min(size, kShort));
    if (!head.starts_with(kData)) return;
    const size_t comma = head.find(',');
    if (comma == head.npos || head.find_first_of("\"\\") != head.npos) return;
    const std::string type(head.substr(0, comma + 1));

    uint64_t end = begin + comma + 1;
    reader_.seek(end);
    for (;;) {
        const size_t n = size_t(std::min<uint64_t>(reader_.peek(1), end_ - end));
        const char* const text = reinterpret_cast<const char*>(reader_.data());
        const char* const stop =
            std::find_if(text, text + n, [](char c) { return c == '"' || c == '\\'; });
        end += uint64_t(stop - text);
        reader_.advance(size_t(stop - text));
        if (n == 0 || (stop < text + n && *stop == '\\')) return reader_.seek(begin);
        if (stop < text + n) break;
    }
    instead_ = fmt::format("{}@{}+{}", type, begin + comma + 1, end - begin - comma - 1);
    instead_used_ = 0;
}

}  // namespace pietra
