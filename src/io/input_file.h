#pragma once
// A regular file that is read by offset, for byte sources. Copies share one descriptor, which
// release() gives back until the next read, so that a model may have more files than a process may
// hold open. A pipe's bytes lie in a temporary file without a name, which stays open.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "extmem/file.h"

namespace pietra {

class InputFile {
public:
    /// See openBytes().
    InputFile(const std::string& path, const std::string& temp_dir);

    /// What messages call it.
    const std::string& path() const { return path_; }
    /// The folder for temporary files.
    const std::string& tempDir() const { return temp_dir_; }
    uint64_t size() const { return size_; }
    /// Reads up to `bytes` at `offset`; less only at the end. Throws InputError where the file was
    /// closed and has not the same size any more.
    size_t read(uint64_t offset, void* data, size_t bytes);
    void release() {
        if (!is_copy_) file_.reset();
    }
    /// Another file in this one's place: all that next(block) writes, until it returns 0.
    InputFile copied(const std::function<size_t(std::span<uint8_t>)>& next) const;

private:
    InputFile() = default;
    std::string path_, temp_dir_;
    uint64_t size_ = 0;
    bool is_copy_ = false;  ///< file_ has no name
    std::shared_ptr<File> file_;
};

}  // namespace pietra
