#include "extmem/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <utility>

#include "base/error.h"

namespace pietra {

namespace {

int openOrThrow(const std::string& path, int flags, const char* operation) {
    int descriptor;
    do descriptor = ::open(path.c_str(), flags | O_CLOEXEC, 0666);
    while (descriptor < 0 && errno == EINTR);
    if (descriptor < 0) throw IoError(path, operation, errno);
    return descriptor;
}

std::string directoryOf(const std::string& path) {
    const size_t slash = path.rfind('/');
    return slash == std::string::npos ? "." : path.substr(0, slash + 1);
}

}  // namespace

File::File(const std::string& path, Mode mode) : path_(path) {
    switch (mode) {
        case Mode::kRead: {
            descriptor_ = openOrThrow(path, O_RDONLY, "open");
            struct stat info {};
            if (fstat(descriptor_, &info) == 0 && S_ISDIR(info.st_mode)) {
                close();
                throw IoError(path, "open", EISDIR);
            }
            break;
        }
        case Mode::kCreate:
            descriptor_ = openOrThrow(path, O_RDWR | O_CREAT | O_TRUNC, "create");
            break;
        case Mode::kUpdate:
            descriptor_ = openOrThrow(path, O_RDWR, "open");
            break;
        case Mode::kTemporary:
            path_ = fmt::format("{}/pietra-{}-XXXXXX", path, ::getpid());
            descriptor_ = ::mkostemp(path_.data(), O_CLOEXEC);
            if (descriptor_ < 0) throw IoError(path, "create a temporary file in", errno);
            ::unlink(path_.c_str());
            break;
    }
}

File::File(File&& other) noexcept
    : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)) {}

File& File::operator=(File&& other) noexcept {
    if (this != &other) {
        close();
        path_ = std::move(other.path_);
        descriptor_ = std::exchange(other.descriptor_, -1);
    }
    return *this;
}

void File::close() {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
}

uint64_t File::size() const {
    struct stat info {};
    if (fstat(descriptor_, &info) != 0) throw IoError(path_, "stat", errno);
    return S_ISREG(info.st_mode) ? uint64_t(info.st_size) : 0;
}

bool File::isRegular() const {
    struct stat info {};
    return fstat(descriptor_, &info) == 0 && S_ISREG(info.st_mode);
}

size_t File::readSome(void* data, size_t bytes) {
    size_t done = 0;
    while (done < bytes) {
        const ssize_t n = ::read(descriptor_, static_cast<char*>(data) + done, bytes - done);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) throw IoError(path_, "read", errno);
        if (n == 0) break;
        done += size_t(n);
    }
    return done;
}

size_t File::readSomeAt(uint64_t offset, void* data, size_t bytes) const {
    size_t done = 0;
    while (done < bytes) {
        const ssize_t n = ::pread(descriptor_, static_cast<char*>(data) + done, bytes - done,
                                  off_t(offset + done));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) throw IoError(path_, "read", errno);
        if (n == 0) break;
        done += size_t(n);
    }
    return done;
}

void File::readAt(uint64_t offset, void* data, size_t bytes) const {
    const size_t done = readSomeAt(offset, data, bytes);
    if (done < bytes)
        throw InputError::atByte(path_, offset + done,
                                 fmt::format("the file ends early, {} bytes short", bytes - done));
}

void File::willRead(uint64_t offset, size_t bytes) const {
    ::posix_fadvise(descriptor_, off_t(offset), off_t(bytes), POSIX_FADV_WILLNEED);
}

void File::write(const void* data, size_t bytes) {
    size_t done = 0;
    while (done < bytes) {
        const ssize_t n = ::write(descriptor_, static_cast<const char*>(data) + done, bytes - done);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) throw IoError(path_, "write", errno);
        done += size_t(n);
    }
}

void File::writeAt(uint64_t offset, const void* data, size_t bytes) {
    size_t done = 0;
    while (done < bytes) {
        const ssize_t n = ::pwrite(descriptor_, static_cast<const char*>(data) + done, bytes - done,
                                   off_t(offset + done));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) throw IoError(path_, "write", errno);
        done += size_t(n);
    }
}

void File::sync() {
    if (::fsync(descriptor_) != 0 && errno != EINVAL && errno != EROFS)
        throw IoError(path_, "sync", errno);
}

void File::truncate(uint64_t bytes) {
    if (::ftruncate(descriptor_, off_t(bytes)) != 0) throw IoError(path_, "truncate", errno);
}

AtomicFile::AtomicFile(const std::string& path, bool force) : path_(path) {
    struct stat info {};
    if (::stat(path.c_str(), &info) == 0) {
        if (S_ISDIR(info.st_mode)) throw IoError(path, "write", EISDIR);
        if (!force) throw UsageError(fmt::format("{}: exists; --force overwrites it", path));
    }
    temporary_ = fmt::format("{}.part-{}", path, ::getpid());
    file_ = File(temporary_, File::Mode::kCreate);
}

AtomicFile::~AtomicFile() {
    if (committed_) return;
    file_.close();
    ::unlink(temporary_.c_str());
}

void AtomicFile::commit() {
    file_.sync();
    file_.close();
    if (std::rename(temporary_.c_str(), path_.c_str()) != 0)
        throw IoError(path_, "rename to", errno);
    committed_ = true;
    // The rename itself must reach the disk too; a file system that cannot sync directories is
    // fine.
    const int directory = ::open(directoryOf(path_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (directory >= 0) {
        ::fsync(directory);
        ::close(directory);
    }
}

}  // namespace pietra
