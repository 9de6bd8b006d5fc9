#pragma once
// Writes a .pietra file (FORMAT.md) from levels that arrive from fine to coarse, as a bottom-up
// build makes them, into a file that holds them from coarse to fine.
//
// Pages and nodes wait in two temporary files, so memory stays at a few MiB, which are reserved
// from the budget, whatever the model's size. Between levels, what there is may be saved, for
// another process to go on from. The file appears under its name only when finish()
// returns; on any error nothing is left behind. While the file is put together the waiting pages'
// disk space is given back bit by bit. Its bytes depend on the arguments of the calls alone. Not
// thread-safe.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/budget.h"
#include "base/state.h"
#include "extmem/file.h"
#include "multires/node.h"
#include "store/model_format.h"

namespace pietra {

/// What tells two models apart; 0 where it is not known.
struct ModelIdentity {
    uint64_t source_hash = 0;    ///< of the input's bytes
    uint64_t settings_hash = 0;  ///< of everything else that decides the model's bytes
    uint32_t method_format = 0;  ///< version of what the method stores
    bool operator==(const ModelIdentity&) const = default;
};

class ModelWriter {
public:
    /// `temp_dir` must exist. `kept`: as TempSpace has it. Throws UsageError if `path` exists and
    /// `force` is not set, IoError, or MemoryError.
    ModelWriter(const std::string& path, bool force, const std::string& temp_dir, Budget& budget,
                const std::string& kept = "");

    /// Levels come in the order L, L-1, ..., 0, each once, with one page at least.
    void beginLevel(uint32_t level);

    /// `encoded` is a page of encodePage(), or of the method's own, with as many patches as there
    /// are `nodes`, in their order. A node's child[] are positions in the level before (level + 1),
    /// counted from 0 in order of arrival, or kNoNode. Sets page (counted in this level), patch and
    /// level of the nodes.
    void addPage(std::span<const std::byte> encoded, std::span<Node> nodes);

    /// Puts the file together, syncs and renames it. levels and triangles_stored of `info` are
    /// taken from what arrived. `method_section`: empty, or the method's own, and then pages are
    /// too (ModelReader::hasPatches). Nothing may be called afterwards.
    void finish(const ModelInfo& info, const ModelIdentity& identity = {},
                std::span<const std::byte> method_section = {});

    /// Between levels, where there is a folder of what is kept. Its files remain for restore(),
    /// which comes before anything else, whatever becomes of this.
    void save(StateWriter& state);
    void restore(StateReader& state);

    uint64_t pageBytes() const { return page_bytes_; }
    uint64_t nodeCount() const { return node_count_; }

private:
    /// Appends to a temporary file through a buffer; to one with a name where that is kept.
    class Spool {
    public:
        Spool(const std::string& directory, const std::string& kept, const char* name);
        ~Spool();
        Spool(const Spool&) = delete;
        Spool& operator=(const Spool&) = delete;
        void append(const void* data, size_t bytes);
        void flush();
        void save(StateWriter& state);
        void restore(StateReader& state);
        bool isSaved() const { return is_saved_; }
        File& file() { return file_; }
        uint64_t size() const { return size_; }

    private:
        std::string path_;  // empty: it has no name
        File file_;
        std::vector<std::byte> buffer_;
        uint64_t size_ = 0;  // with what is in the buffer
        bool is_saved_ = false;
    };
    struct Level {
        uint64_t pages_offset = 0;  // in the spool of pages
        uint64_t nodes_offset = 0;  // in the spool of page records, each followed by its nodes
        uint64_t pages_bytes = 0;
        uint32_t nodes = 0;
        uint32_t pages = 0;
        std::vector<BlockEntry> blocks;  // counts and pages_bytes only, until finish()
    };

    template <class Writer, class Visit>
    static void forEachNumber(Writer& writer, Visit&& visit);
    void numberLevels(std::vector<BlockEntry>& directory);
    void writeBlocks(const Level& level, std::span<BlockEntry> blocks, bool face_sizes);
    void writePages(const Level& level, std::span<BlockEntry> blocks);
    void writeHeader(const ModelInfo& info, const ModelIdentity& identity,
                     std::span<const BlockEntry> directory, std::span<const std::byte> attributes,
                     std::span<const std::byte> method_section);
    bool fitsFront(const Level& level) const;

    Reservation memory_;
    AtomicFile output_;
    Spool pages_;
    Spool nodes_;
    std::vector<Level> levels_;  // fine to coarse
    uint32_t level_ = 0;         // number of the current level
    uint64_t page_bytes_ = 0;
    uint64_t node_count_ = 0;
    uint64_t triangles_ = 0;
    uint64_t position_ = 0;  // end of what has been written to the output
};

}  // namespace pietra
