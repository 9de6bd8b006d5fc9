#include "io/byte_source.h"

#include <algorithm>
#include <cstring>

#include "io/packed_source.h"

namespace pietra {

namespace {

class PlainSource : public ByteSource {
public:
    PlainSource(InputFile file, uint64_t stored_bytes)
        : file_(std::move(file)), stored_bytes_(stored_bytes) {}
    const std::string& path() const override { return file_.path(); }
    size_t read(uint64_t offset, void* data, size_t bytes) override {
        return file_.read(offset, data, bytes);
    }
    uint64_t lengthBound() const override { return file_.size(); }
    const std::string& tempDir() const override { return file_.tempDir(); }
    uint64_t storedBytes() const override { return stored_bytes_; }
    bool isCompressed() const override { return false; }
    void release() override { file_.release(); }
    std::unique_ptr<ByteSource> again() const override { return openPlain(file_, stored_bytes_); }

private:
    InputFile file_;
    uint64_t stored_bytes_;
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
    const std::string& tempDir() const override { return temp_dir_; }
    uint64_t storedBytes() const override { return bytes_.size(); }
    bool isCompressed() const override { return false; }
    std::unique_ptr<ByteSource> again() const override { return bytesInMemory(name_, bytes_); }

private:
    std::string name_, temp_dir_ = ".";
    std::vector<uint8_t> bytes_;
};

}  // namespace

std::unique_ptr<ByteSource> openBytes(const std::string& path, const std::string& temp_dir) {
    InputFile file(path, temp_dir);
    if (auto packed = openPacked(file)) return packed;
    const uint64_t stored_bytes = file.size();
    return openPlain(std::move(file), stored_bytes);
}

std::unique_ptr<ByteSource> openPlain(InputFile file, uint64_t stored_bytes) {
    return std::make_unique<PlainSource>(std::move(file), stored_bytes);
}

std::unique_ptr<ByteSource> bytesInMemory(const std::string& name, std::vector<uint8_t> bytes) {
    return std::make_unique<MemorySource>(name, std::move(bytes));
}

}  // namespace pietra
