#pragma once
// The characters of the JSON part of a glTF file, without the data that its strings may carry.
//
// Buffers and pictures may stand in the text, as "data:...;base64,..." of any length. Of such a
// string a parser sees "data:...;base64,@OFFSET+LENGTH" instead: where the payload stands in the
// file
// ('@' is no character of base64). Short ones, and those with escapes, it sees whole. Memory: the
// reader's window.

#include <cstddef>
#include <cstdint>
#include <iterator>

#include "io/byte_reader.h"

namespace pietra {

class GltfText {
public:
    /// The characters at [begin, end) of the file.
    GltfText(ByteReader& reader, uint64_t begin, uint64_t end);

    /// An input iterator, as parsers take it; all of them share the text's place.
    class Iterator {
    public:
        using iterator_category = std::input_iterator_tag;
        using value_type = char;
        using difference_type = std::ptrdiff_t;
        using pointer = const char*;
        using reference = char;

        explicit Iterator(GltfText* text) : text_(text) {}
        char operator*() const { return text_->current_; }
        Iterator& operator++() {
            text_->advance();
            return *this;
        }
        void operator++(int) { text_->advance(); }
        bool operator==(const Iterator& other) const { return atEnd() == other.atEnd(); }

    private:
        bool atEnd() const { return text_ == nullptr || text_->ended_; }
        GltfText* text_;
    };
    Iterator begin() { return Iterator(this); }
    Iterator end() const { return Iterator(nullptr); }

    /// Where the current character stands in the file, or the string that it was made of.
    uint64_t offset() const { return offset_; }

private:
    void advance();
    void beginString();

    ByteReader& reader_;
    uint64_t end_;
    uint64_t offset_ = 0;
    char current_ = 0;
    bool ended_ = false;
    bool in_string_ = false;
    bool escaped_ = false;
    std::string instead_;  ///< characters to give before those of the file
    size_t instead_used_ = 0;
};

}  // namespace pietra
