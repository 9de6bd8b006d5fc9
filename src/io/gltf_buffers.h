#pragma once
// The bytes of a glTF file's buffers, wherever they are: in the chunk behind the JSON of a GLB, in
// files beside it, or in the JSON itself as base64. They are read by ranges, through a few cached
// ones; no buffer is held whole but short ones out of the JSON. Packed files beside it are copied
// to temporary ones, in the folder of the glTF file's own. Memory: kWindows ranges. At most
// kOpenFiles files are open, and the copies. Not thread-safe.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/byte_source.h"
#include "io/gltf_document.h"

namespace pietra {

/// The data chunk of a GLB, in the file.
struct GltfChunk {
    uint64_t offset = 0, bytes = 0;
};

class GltfBuffers {
public:
    /// Those of `document`, which must outlive this; the first one without a uri is the chunk.
    GltfBuffers(std::unique_ptr<ByteSource> file, const GltfDocument& document,
                std::optional<GltfChunk> chunk);
    ~GltfBuffers();

    /// What messages call the glTF file.
    const std::string& path() const { return file_->path(); }
    /// Makes sure that buffer number `buffer` is there, of the size that the document says: before
    /// it is read. Throws InputError, or IoError that names the file missing.
    void require(uint32_t buffer);
    uint64_t sizeOf(uint32_t buffer) const { return document_.buffers[buffer].bytes; }
    size_t count() const { return document_.buffers.size(); }
    /// Bytes on disk of the file and those beside it that were required.
    uint64_t storedBytes() const { return stored_bytes_; }

    /// The bytes [begin, end) of a buffer, which are within it; good for the next kWindows - 1
    /// calls.
    const uint8_t* window(uint32_t buffer, uint64_t begin, uint64_t end);
    /// "byte 17", or "byte 17 of data.bin": a place in a buffer, for messages.
    std::string placeOf(uint32_t buffer, uint64_t offset) const;
    /// Gives the memory of the windows back.
    void release() { windows_.clear(); }

private:
    static constexpr size_t kWindows = 8;
    static constexpr size_t kOpenFiles = 16;
    struct Place;
    struct Window {
        uint32_t buffer;
        uint64_t begin, end;
        std::vector<uint8_t> bytes;
    };
    struct OpenFile {
        uint32_t buffer;
        std::unique_ptr<ByteSource> source;
    };

    Place locate(uint32_t buffer) const;
    Place locateData(uint32_t buffer, const std::string& uri) const;
    ByteSource& open(uint32_t buffer);
    void read(uint32_t buffer, uint64_t offset, uint8_t* out, size_t bytes);
    void readBase64(const Place& place, uint64_t offset, uint8_t* out, size_t bytes);
    [[noreturn]] void fail(uint32_t buffer, const char* key, const std::string& what) const;

    std::unique_ptr<ByteSource> file_;
    const GltfDocument& document_;
    std::optional<GltfChunk> chunk_;
    std::vector<std::unique_ptr<Place>> places_;  ///< of the buffers that were required
    std::vector<OpenFile> open_;                  ///< the one used last at the end
    std::vector<Window> windows_;                 ///< likewise
    uint64_t stored_bytes_;
};

}  // namespace pietra
