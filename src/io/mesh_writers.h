#pragma once
// The writers behind createMesh(), one a format, and what they share. Internal to src/io.

#include <cstring>
#include <memory>
#include <optional>
#include <string>

#include "extmem/file.h"
#include "io/mesh_writer.h"

namespace pietra {

std::unique_ptr<MeshWriter> createPly(const std::string& path, bool force,
                                      const MeshOutput& output);
std::unique_ptr<MeshWriter> createObj(const std::string& path, bool force,
                                      const MeshOutput& output);
std::unique_ptr<MeshWriter> createStl(const std::string& path, bool force,
                                      const MeshOutput& output);
std::unique_ptr<MeshWriter> createGlb(const std::string& path, bool force,
                                      const MeshOutput& output);

/// Collects small writes at the end of a file.
class OutputBuffer {
public:
    static constexpr size_t kLargestPut = 1 << 16;

    explicit OutputBuffer(File& file)
        : file_(file), bytes_(std::make_unique<uint8_t[]>(kBytes + kLargestPut)) {}

    /// Room for `bytes` (kLargestPut at most), which the caller fills before the next call.
    uint8_t* put(size_t bytes) {
        if (used_ > kBytes) flush();
        uint8_t* const room = bytes_.get() + used_;
        used_ += bytes;
        return room;
    }
    void write(const std::string& text) {
        flush();
        file_.write(text.data(), text.size());
        written_ += text.size();
    }
    void flush() {
        file_.write(bytes_.get(), used_);
        written_ += used_;
        used_ = 0;
    }
    /// Bytes given to it so far.
    uint64_t size() const { return written_ + used_; }

private:
    static constexpr size_t kBytes = 1 << 20;
    File& file_;
    std::unique_ptr<uint8_t[]> bytes_;
    size_t used_ = 0;
    uint64_t written_ = 0;
};

/// A nameless file in the directory of `output_path`.
File temporaryBeside(const std::string& output_path);

/// Bytes that belong behind others which are still to come: they wait in a temporary file, until
/// join() says that nothing will come before them any more.
class OutputTail {
public:
    OutputTail(std::string output_path, OutputBuffer& main)
        : output_path_(std::move(output_path)), main_(main) {}

    uint8_t* put(size_t bytes) {
        if (joined_) return main_.put(bytes);
        if (!waiting_) open();
        return waiting_->put(bytes);
    }
    /// Appends what has waited to the main output; what is put from now on goes there at once.
    void join();
    bool joined() const { return joined_; }

private:
    void open();
    std::string output_path_;
    OutputBuffer& main_;
    bool joined_ = false;
    File file_;
    std::optional<OutputBuffer> waiting_;
};

template <class T>
uint8_t* store(uint8_t* out, const T& value) {
    std::memcpy(out, &value, sizeof value);
    return out + sizeof value;
}

}  // namespace pietra
