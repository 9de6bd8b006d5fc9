#include "io/byte_source.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/error.h"
#include "extmem/file.h"
#include "io/packed_source.h"

namespace pietra {

namespace {

class PlainSource : public ByteSource {
public:
    explicit PlainSource(File file)
        : path_(file.path()), file_(std::move(file)), size_(file_.size()) {
        expectSequentialReads();
    }
    const std::string& path() const override { return path_; }
    size_t read(uint64_t offset, void* data, size_t bytes) override {
        if (!file_.isOpen()) {
            file_ = reopenUnchanged(path_, size_);
            expectSequentialReads();
        }
        return file_.readSomeAt(offset, data, bytes);
    }
    uint64_t lengthBound() const override { return size_; }
    uint64_t storedBytes() const override { return size_; }
    bool isCompressed() const override { return false; }
    void release() override { file_.close(); }
    std::unique_ptr<ByteSource> again() const override { return openBytes(path_); }

private:
    void expectSequentialReads() {
        ::posix_fadvise(file_.descriptor(), 0, 0, POSIX_FADV_SEQUENTIAL);
    }

    std::string path_;
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
    std::unique_ptr<ByteSource> again() const override { return bytesInMemory(name_, bytes_); }

private:
    std::string name_;
    std::vector<uint8_t> bytes_;
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
    if (auto packed = openPacked(file)) return packed;
    return std::make_unique<PlainSource>(std::move(file));
}

File reopenUnchanged(const std::string& path, uint64_t bytes) {
    File file(path, File::Mode::kRead);
    if (file.size() != bytes) throw InputError(path, "", "has changed while it was read");
    return file;
}

std::unique_ptr<ByteSource> bytesInMemory(const std::string& name, std::vector<uint8_t> bytes) {
    return std::make_unique<MemorySource>(name, std::move(bytes));
}

}  // namespace pietra
