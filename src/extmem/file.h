#pragma once
// Files by descriptor, with errors as IoError that names the path. Reads and writes are whole or
// throw. One File must not be used by several threads at once, except readAt(), which may.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace pietra {

class File {
public:
    enum class Mode { kRead, kCreate, kUpdate, kTemporary };
    File() = default;
    /// kRead: an existing regular file or pipe (a directory is refused). kCreate: truncated, for
    /// writing and reading. kUpdate: the same, but it exists and keeps what it has. kTemporary: as
    /// kCreate, unlinked at once, so that nothing is left behind; `path` names the directory.
    File(const std::string& path, Mode mode);
    File(File&& other) noexcept;
    File& operator=(File&& other) noexcept;
    ~File() { close(); }

    bool isOpen() const { return descriptor_ >= 0; }
    const std::string& path() const { return path_; }
    int descriptor() const { return descriptor_; }
    /// Size by fstat; 0 for a pipe.
    uint64_t size() const;
    bool isRegular() const;

    /// Reads up to bytes at the current position; less only at the end of the file.
    size_t readSome(void* data, size_t bytes);
    /// Reads exactly `bytes` at `offset`, or throws InputError "ends early".
    void readAt(uint64_t offset, void* data, size_t bytes) const;
    /// As readAt, but returns how many bytes there were before the end of the file.
    size_t readSomeAt(uint64_t offset, void* data, size_t bytes) const;
    /// Tells the system that these bytes will be read soon; waits for nothing.
    void willRead(uint64_t offset, size_t bytes) const;
    void write(const void* data, size_t bytes);
    void writeAt(uint64_t offset, const void* data, size_t bytes);
    void sync();
    /// To so many bytes.
    void truncate(uint64_t bytes);
    void close();

private:
    std::string path_;
    int descriptor_ = -1;
};

/// A file that appears under its name only when it is complete: written as NAME.part-PID, synced
/// and renamed by commit(); removed by the destructor otherwise.
class AtomicFile {
public:
    /// Throws UsageError if `path` exists and `force` is false, IoError if it cannot be created.
    AtomicFile(const std::string& path, bool force);
    ~AtomicFile();
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;
    File& file() { return file_; }
    void commit();

private:
    std::string path_;
    std::string temporary_;
    File file_;
    bool committed_ = false;
};

}  // namespace pietra
