#include "io/byte_source.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/check.h"
#include "base/error.h"
#include "extmem/file.h"

namespace pietra {

namespace {

class PlainSource : public ByteSource {
public:
    explicit PlainSource(File file) : file_(std::move(file)), size_(file_.size()) {
        ::posix_fadvise(file_.descriptor(), 0, 0, POSIX_FADV_SEQUENTIAL);
    }
    const std::string& path() const override { return file_.path(); }
    size_t read(uint64_t offset, void* data, size_t bytes) override {
        return file_.readSomeAt(offset, data, bytes);
    }
    uint64_t lengthBound() const override { return size_; }
    uint64_t storedBytes() const override { return size_; }
    bool isCompressed() const override { return false; }

private:
    File file_;
    uint64_t size_;
};

class MemorySource : public ByteSource {
public:
    MemorySource(const std::string& name, std::vector<uint8_t> bytes)
        : name_(name), bytes_(std::move(bytes)) {}
    const std::string& path() const override { return name_; }
    size_t read(uint64_t offset, void* data, size_t bytes) override {
        if (offset >= bytes_.size()) return 0;
        const size_t n = std::min(bytes, bytes_.size() - size_t(offset));
        std::memcpy(data, bytes_.data() + offset, n);
        return n;
    }
    uint64_t lengthBound() const override { return bytes_.size(); }
    uint64_t storedBytes() const override { return bytes_.size(); }
    bool isCompressed() const override { return false; }

private:
    std::string name_;
    std::vector<uint8_t> bytes_;
};

/// One or several gzip members, one after the other (RFC 1952). Check sums are verified by zlib at
/// the end of each member.
class GzipSource : public ByteSource {
public:
    explicit GzipSource(File file)
        : file_(std::move(file)), size_(file_.size()), input_(kInputBytes) {
        // 15 bits of window, 16 for the gzip wrapper.
        CHECK_EQ(inflateInit2(&stream_, 15 + 16), Z_OK);
    }
    ~GzipSource() override { inflateEnd(&stream_); }
    const std::string& path() const override { return file_.path(); }
    size_t read(uint64_t offset, void* data, size_t bytes) override {
        if (offset < position_) restart();
        skipTo(offset);
        return offset == position_ ? decompress(static_cast<uint8_t*>(data), bytes) : 0;
    }
    uint64_t lengthBound() const override {
        // note: deflate expands by 1032 at most (258 bytes a match of two bits).
        return size_ * 1032;
    }
    uint64_t storedBytes() const override { return size_; }
    bool isCompressed() const override { return true; }

private:
    static constexpr size_t kInputBytes = 1 << 18;

    void restart() {
        inflateReset(&stream_);
        stream_.avail_in = 0;
        input_end_ = position_ = 0;
        ended_ = false;
    }

    void skipTo(uint64_t offset) {
        std::vector<uint8_t> dropped(std::min<uint64_t>(offset - position_, 1 << 18));
        while (position_ < offset) {
            const size_t n = size_t(std::min<uint64_t>(offset - position_, dropped.size()));
            if (decompress(dropped.data(), n) < n) return;
        }
    }

    /// Offset in the compressed file of the next byte that zlib has not seen.
    uint64_t compressedOffset() const { return input_end_ - stream_.avail_in; }

    bool fillInput() {
        if (stream_.avail_in > 0) return true;
        const size_t n = file_.readSomeAt(input_end_, input_.data(), input_.size());
        stream_.next_in = input_.data();
        stream_.avail_in = uInt(n);
        input_end_ += n;
        return n > 0;
    }

    /// After a member: another one, or the end of the file. Bytes that begin no member are padding,
    /// as gzip itself takes them.
    bool nextMember() {
        if (!fillInput() || *stream_.next_in != 0x1f) return false;
        inflateReset(&stream_);
        return true;
    }

    size_t decompress(uint8_t* data, size_t bytes) {
        size_t done = 0;
        while (done < bytes && !ended_) {
            if (!fillInput())
                throw InputError::atByte(path(), input_end_, "the gzip data ends early");
            const size_t room = std::min<size_t>(bytes - done, 1 << 30);
            stream_.next_out = data + done;
            stream_.avail_out = uInt(room);
            const int status = inflate(&stream_, Z_NO_FLUSH);
            done += room - stream_.avail_out;
            if (status == Z_STREAM_END)
                ended_ = !nextMember();
            else if (status == Z_MEM_ERROR)
                throw MemoryError("no memory to decompress " + path());
            else if (status != Z_OK && status != Z_BUF_ERROR)
                throw InputError::atByte(path(), compressedOffset(), "the gzip data is damaged");
        }
        position_ += done;
        return done;
    }

    File file_;
    uint64_t size_;
    std::vector<uint8_t> input_;
    z_stream stream_{};
    uint64_t input_end_ = 0;  ///< compressed bytes read from the file
    uint64_t position_ = 0;   ///< plain bytes delivered
    bool ended_ = false;
};

}  // namespace

std::unique_ptr<ByteSource> openBytes(const std::string& path) {
    // note: looked at before it is opened: opening a pipe would wait for its writer.
    struct stat info {};
    if (::stat(path.c_str(), &info) != 0) throw IoError(path, "open", errno);
    if (S_ISDIR(info.st_mode)) throw IoError(path, "open", EISDIR);
    if (!S_ISREG(info.st_mode))
        throw InputError(path, "",
                         "a pipe or device cannot be read several times, as a mesh must be; "
                         "save it to a file first");
    File file(path, File::Mode::kRead);
    uint8_t magic[2] = {};
    const bool gzip = file.readSomeAt(0, magic, 2) == 2 && magic[0] == 0x1f && magic[1] == 0x8b;
    if (gzip) return std::make_unique<GzipSource>(std::move(file));
    return std::make_unique<PlainSource>(std::move(file));
}

std::unique_ptr<ByteSource> bytesInMemory(const std::string& name, std::vector<uint8_t> bytes) {
    return std::make_unique<MemorySource>(name, std::move(bytes));
}

}  // namespace pietra
