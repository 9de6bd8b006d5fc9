#pragma once
// Reads a .pietra file (FORMAT.md). Opening it reads the header and the whole node table and checks
// them: afterwards every index in a node is in range (children lie in the next level, pages and
// patches exist) and every float is finite. Pages are read and checked one by one.
//
// All const methods are thread-safe. The throwing ones report a file that is damaged, cut short or
// not a model as InputError with the byte offset, and the system's refusals as IoError; the try...
// ones are for the frame path and never throw on account of the file. Memory: the node table.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "extmem/file.h"
#include "multires/node.h"
#include "store/model_writer.h"
#include "store/page_codec.h"

namespace pietra {

struct PageInfo {
    uint64_t offset = 0;  ///< in the file
    uint64_t checksum = 0;
    uint32_t bytes = 0;
    NodeIndex first_node = 0;  ///< its patches are those of nodes first_node, first_node + 1, ...
    uint32_t node_count = 0;
};

/// Nodes first to first + count of a level; they are consecutive.
struct LevelRange {
    NodeIndex first = 0;
    uint32_t count = 0;
};

class ModelReader {
public:
    explicit ModelReader(const std::string& path);

    const std::string& path() const { return file_.path(); }
    const ModelInfo& info() const { return info_; }
    const ModelIdentity& identity() const { return identity_; }
    uint32_t formatVersion() const { return format_version_; }
    uint64_t fileBytes() const { return file_bytes_; }
    PageSettings pageSettings() const;
    /// Pages hold patches: decode() and the like may be called. Else they are the method's own, as
    /// is its section, and a node counts what its method says.
    bool hasPatches() const { return method_section_.empty(); }
    std::span<const std::byte> methodSection() const { return method_section_; }

    /// By level from the root (level 0) on; node i of the model is nodes()[i].
    std::span<const Node> nodes() const { return nodes_; }
    LevelRange level(uint32_t level) const { return levels_[level]; }
    uint32_t pageCount() const { return uint32_t(pages_.size()); }
    const PageInfo& page(uint32_t page) const { return pages_[page]; }

    /// Tells the system that the page will be read soon.
    void willRead(uint32_t page) const { file_.willRead(pages_[page].offset, pages_[page].bytes); }
    /// Reads a page as it lies on disk and checks its checksum.
    void readPage(uint32_t page, std::vector<std::byte>& bytes) const;
    [[nodiscard]] bool tryReadPage(uint32_t page, std::vector<std::byte>& bytes,
                                   std::string& fault) const;
    /// Decodes the bytes of a page and checks the counts of its nodes. patches[i] is the patch of
    /// node first_node + i.
    [[nodiscard]] bool tryDecode(uint32_t page, std::span<const std::byte> bytes,
                                 std::vector<Mesh>& patches, std::string& fault) const;
    /// readPage and decode in one.
    void decode(uint32_t page, std::vector<Mesh>& patches) const;

private:
    void readHeader(FileHeader& header);
    static bool hasSection(const FileHeader& header, SectionKind kind);
    std::vector<std::byte> readSection(const FileHeader& header, SectionKind kind) const;
    void readDirectory(const FileHeader& header, std::vector<BlockEntry>& directory) const;
    void readBlock(const BlockEntry& entry);
    void checkNodes(const BlockEntry& entry);
    void fillJoints();
    [[noreturn]] void fail(uint64_t offset, const std::string& what) const;
    [[noreturn]] void failPage(uint32_t page, const std::string& fault) const;

    File file_;
    uint64_t file_bytes_ = 0;
    uint32_t format_version_ = 0;
    ModelInfo info_;
    ModelIdentity identity_;
    std::vector<Node> nodes_;
    std::vector<PageInfo> pages_;
    std::vector<LevelRange> levels_;
    std::vector<std::byte> method_section_;
};

/// Whether a regular file begins as a model does; false too where it cannot be read.
bool isModelFile(const std::string& path);

/// Of all the models' vertices, in input coordinates.
Box3d boundsOf(std::span<const ModelReader* const> models);

}  // namespace pietra
