#include "io/input_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <vector>

#include "base/error.h"
#include "base/progress.h"

namespace pietra {

namespace {

constexpr size_t kBlockBytes = 1 << 18;

std::shared_ptr<File> openFile(const std::string& path) {
    auto file = std::make_shared<File>(path, File::Mode::kRead);
    ::posix_fadvise(file->descriptor(), 0, 0, POSIX_FADV_SEQUENTIAL);
    return file;
}

/// What a pipe holds now, once it holds anything; 0 at its end. However slow the other side is, the
/// user may interrupt.
size_t readPipe(const File& pipe, std::span<uint8_t> block) {
    constexpr int kPatience_ms = 100;
    pollfd wait{pipe.descriptor(), POLLIN, 0};
    while (::poll(&wait, 1, kPatience_ms) <= 0)
        if (Progress::cancelRequested()) throw Interrupted();
    ssize_t n;
    do n = ::read(pipe.descriptor(), block.data(), block.size());
    while (n < 0 && errno == EINTR);
    if (n < 0) throw IoError(pipe.path(), "read", errno);
    return size_t(n);
}

}  // namespace

InputFile::InputFile(const std::string& path, const std::string& temp_dir)
    : path_(path), temp_dir_(temp_dir) {
    struct stat info {};
    if (::stat(path.c_str(), &info) != 0) throw IoError(path, "open", errno);
    if (S_ISCHR(info.st_mode) || S_ISBLK(info.st_mode))
        throw InputError(path, "", "is a device, not a file or pipe");
    file_ = openFile(path);
    size_ = file_->size();
    if (file_->isRegular()) return;
    const std::shared_ptr<File> pipe = file_;
    *this = copied([&](std::span<uint8_t> block) { return readPipe(*pipe, block); });
}

size_t InputFile::read(uint64_t offset, void* data, size_t bytes) {
    if (!file_) {
        file_ = openFile(path_);
        if (file_->size() != size_) throw InputError(path_, "", "has changed while it was read");
    }
    return file_->readSomeAt(offset, data, bytes);
}

InputFile InputFile::copied(const std::function<size_t(std::span<uint8_t>)>& next) const {
    InputFile copy;
    copy.path_ = path_;
    copy.temp_dir_ = temp_dir_;
    copy.is_copy_ = true;
    copy.file_ = std::make_shared<File>(temp_dir_, File::Mode::kTemporary);
    std::vector<uint8_t> block(kBlockBytes);
    while (const size_t n = next(block)) {
        if (Progress::cancelRequested()) throw Interrupted();
        copy.file_->write(block.data(), n);
        copy.size_ += n;
    }
    return copy;
}

}  // namespace pietra
