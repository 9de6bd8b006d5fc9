#include "io/byte_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

namespace pietra {

ByteReader::ByteReader(std::unique_ptr<ByteSource> source)
    : source_(std::move(source)),
      window_(size_t(std::min<uint64_t>(kWindow, source_->lengthBound()))) {}

void ByteReader::seek(uint64_t offset) {
    if (offset >= base_ && offset - base_ <= end_) {
        cursor_ = size_t(offset - base_);
    } else {
        base_ = offset;
        cursor_ = end_ = 0;
    }
}

void ByteReader::release() {
    base_ += cursor_;
    cursor_ = end_ = 0;
    std::vector<uint8_t>().swap(buffer_);
    source_->release();
}

void ByteReader::fill() {
    if (buffer_.empty()) buffer_.resize(kPadding + window_ + kPadding);
    uint8_t* const window = buffer_.data() + kPadding;
    std::memmove(window, data(), end_ - cursor_);
    base_ += cursor_;
    end_ -= cursor_;
    cursor_ = 0;
    end_ += source_->read(base_ + end_, window + end_, window_ - end_);
    std::memset(window + end_, 0, kPadding);
}

std::string ByteReader::placeOf(uint64_t offset) const {
    return source_->isCompressed() ? fmt::format("byte {} of the unpacked data", offset)
                                   : fmt::format("byte {}", offset);
}

}  // namespace pietra
