#include "store/model_writer.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>

#include "base/check.h"
#include "base/hash.h"
#include "store/attributes.h"
#include "store/node_block.h"
#include "store/page_codec.h"

namespace pietra {

namespace {

constexpr size_t kSpoolBuffer = 1 << 18;
constexpr size_t kCopyBuffer = 1 << 20;
constexpr size_t kWriterMemory = 6 << 20;  // two spools, the copy, one block's nodes and columns

template <class T>
std::span<const std::byte> bytesOf(std::span<const T> values) {
    return std::as_bytes(values);
}

}  // namespace

ModelWriter::Spool::Spool(const std::string& directory, const std::string& kept, const char* name)
    : path_(kept.empty() ? "" : kept + "/" + name) {
    if (path_.empty()) file_ = File(directory, File::Mode::kTemporary);
}

ModelWriter::Spool::~Spool() {
    if (file_.isOpen() && !path_.empty() && !is_saved_) ::unlink(path_.c_str());
}

void ModelWriter::Spool::append(const void* data, size_t bytes) {
    const auto* begin = static_cast<const std::byte*>(data);
    if (buffer_.size() + bytes > kSpoolBuffer) flush();
    buffer_.insert(buffer_.end(), begin, begin + bytes);
    size_ += bytes;
    if (bytes > kSpoolBuffer) flush();
}

void ModelWriter::Spool::flush() {
    if (!file_.isOpen()) file_ = File(path_, File::Mode::kCreate);
    file_.writeAt(size_ - buffer_.size(), buffer_.data(), buffer_.size());
    buffer_.clear();
}

void ModelWriter::Spool::save(StateWriter& state) {
    CHECK(!path_.empty());
    flush();
    state.put(size_);
    is_saved_ = true;
}

void ModelWriter::Spool::restore(StateReader& state) {
    state.get(size_);
    file_ = File(path_, File::Mode::kUpdate);
    file_.truncate(size_);
    is_saved_ = true;
}

ModelWriter::ModelWriter(const std::string& path, bool force, const std::string& temp_dir,
                         Budget& budget, const std::string& kept)
    : memory_(budget.reserve(kWriterMemory, "writing the model")),
      output_(path, force),
      pages_(temp_dir, kept, "pages"),
      nodes_(temp_dir, kept, "nodes") {}

/// The same list for both ways.
template <class Writer, class Visit>
void ModelWriter::forEachNumber(Writer& writer, Visit&& visit) {
    for (auto& level : writer.levels_) {
        visit(level.pages_offset), visit(level.nodes_offset), visit(level.pages_bytes);
        visit(level.nodes), visit(level.pages), visit(level.blocks);
    }
    visit(writer.level_), visit(writer.page_bytes_), visit(writer.node_count_);
    visit(writer.triangles_);
}

void ModelWriter::save(StateWriter& state) {
    pages_.save(state);
    nodes_.save(state);
    state.put(levels_.size());
    forEachNumber(*this, [&](const auto& value) { state.put(value); });
}

void ModelWriter::restore(StateReader& state) {
    CHECK(levels_.empty());
    pages_.restore(state);
    nodes_.restore(state);
    levels_.resize(state.get<size_t>());
    forEachNumber(*this, [&](auto& value) { state.get(value); });
}

void ModelWriter::beginLevel(uint32_t level) {
    CHECK_LT(level, kMaxLevels);
    if (!levels_.empty()) {
        CHECK_EQ(level + 1, level_);
        CHECK_LT(0u, levels_.back().pages);
    }
    level_ = level;
    Level next;
    next.pages_offset = pages_.size();
    next.nodes_offset = nodes_.size();
    levels_.push_back(std::move(next));
}

void ModelWriter::addPage(std::span<const std::byte> encoded, std::span<Node> nodes) {
    CHECK(!levels_.empty());
    CHECK(!nodes.empty());
    CHECK_LE(nodes.size(), size_t(kMaxPagePatches));
    CHECK_LT(encoded.size(), size_t(1) << 32);
    Level& level = levels_.back();
    const uint32_t finer = levels_.size() < 2 ? 0 : levels_[levels_.size() - 2].nodes;
    for (size_t i = 0; i < nodes.size(); ++i) {
        Node& node = nodes[i];
        node.page = level.pages;
        node.patch = uint16_t(i);
        node.level = uint16_t(level_);
        for (const NodeIndex child : node.child) CHECK(child == kNoNode || child < finer);
        triangles_ += node.triangles;
    }
    const PageRecord record{hashBytes(encoded.data(), encoded.size()), uint32_t(encoded.size()),
                            uint32_t(nodes.size())};
    nodes_.append(&record, sizeof record);
    nodes_.append(nodes.data(), nodes.size_bytes());
    pages_.append(encoded.data(), encoded.size());

    if (level.blocks.empty() || level.blocks.back().node_count >= kBlockNodes)
        level.blocks.emplace_back();
    BlockEntry& block = level.blocks.back();
    block.level = level_;
    block.node_count += uint32_t(nodes.size());
    block.page_count += 1;
    block.pages_bytes += encoded.size();
    level.nodes += uint32_t(nodes.size());
    level.pages += 1;
    level.pages_bytes += encoded.size();
    page_bytes_ += encoded.size();
    node_count_ += nodes.size();
    CHECK_LT(node_count_, uint64_t(kNoNode));
}

void ModelWriter::numberLevels(std::vector<BlockEntry>& directory) {
    uint32_t node = 0, page = 0;
    for (auto level = levels_.rbegin(); level != levels_.rend(); ++level)
        for (BlockEntry& block : level->blocks) {
            block.first_node = node;
            block.first_page = page;
            node += block.node_count;
            page += block.page_count;
            directory.push_back(block);
        }
}

void ModelWriter::writeBlocks(const Level& level, std::span<BlockEntry> blocks, bool face_sizes) {
    uint64_t offset = level.nodes_offset;
    const uint32_t finer = blocks[0].first_node + level.nodes;  // the next level's first node
    std::vector<Node> nodes;
    std::vector<PageRecord> pages;
    for (BlockEntry& block : blocks) {
        nodes.resize(block.node_count);
        pages.resize(block.page_count);
        uint32_t done = 0;
        for (PageRecord& page : pages) {
            nodes_.file().readAt(offset, &page, sizeof page);
            nodes_.file().readAt(offset + sizeof page, &nodes[done],
                                 page.node_count * sizeof(Node));
            done += page.node_count;
            offset += sizeof page + page.node_count * sizeof(Node);
        }
        for (Node& node : nodes)
            for (NodeIndex& child : node.child)
                if (child != kNoNode) child += finer;
        const std::vector<std::byte> bytes = encodeNodeBlock(nodes, pages, face_sizes);
        block.offset = position_;
        block.bytes = uint32_t(bytes.size());
        block.checksum = hashBytes(bytes.data(), bytes.size());
        output_.file().writeAt(position_, bytes.data(), bytes.size());
        position_ += bytes.size();
    }
}

void ModelWriter::writePages(const Level& level, std::span<BlockEntry> blocks) {
    uint64_t offset = position_;
    for (BlockEntry& block : blocks) {
        block.pages_offset = offset;
        offset += block.pages_bytes;
    }
    std::vector<std::byte> buffer(kCopyBuffer);
    for (uint64_t done = 0; done < level.pages_bytes;) {
        const auto bytes = size_t(std::min<uint64_t>(kCopyBuffer, level.pages_bytes - done));
        const uint64_t from = level.pages_offset + done;
        pages_.file().readAt(from, buffer.data(), bytes);
        output_.file().writeAt(position_, buffer.data(), bytes);
        position_ += bytes;
        done += bytes;
        // Gives the disk space back; a file system that cannot only keeps it until the end, as do
        // pages that another process may have to begin with.
        if (pages_.isSaved()) continue;
        ::fallocate(pages_.file().descriptor(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE,
                    off_t(from), off_t(bytes));
    }
}

bool ModelWriter::fitsFront(const Level& level) const {
    const uint64_t blocks =
        64 * uint64_t(level.nodes) + 32 * uint64_t(level.pages) + 512 * level.blocks.size();
    return position_ + blocks + level.pages_bytes <= kFrontBytes;
}

void ModelWriter::writeHeader(const ModelInfo& info, const ModelIdentity& identity,
                              std::span<const BlockEntry> directory,
                              std::span<const std::byte> attributes,
                              std::span<const std::byte> method_section) {
    FileHeader header;
    header.version = info.face_sizes ? kFaceSizesVersion : kPlainVersion;
    header.header_bytes = sizeof header;
    header.method_format = identity.method_format;
    CHECK_LT(info.method.size(), header.method.size());
    std::copy(info.method.begin(), info.method.end(), header.method.begin());
    header.file_bytes = position_;
    header.source_hash = identity.source_hash;
    header.settings_hash = identity.settings_hash;
    for (int axis = 0; axis < 3; ++axis) {
        header.origin[axis] = info.lattice.origin[axis];
        header.bounds_min[axis] = info.bounds.min[axis];
        header.bounds_max[axis] = info.bounds.max[axis];
    }
    header.step = info.lattice.step;
    header.shift = uint32_t(info.lattice.shift);
    header.input_triangles = info.input_triangles;
    header.input_vertices = info.input_vertices;
    header.dropped_degenerate = info.dropped_degenerate;
    header.dropped_duplicate = info.dropped_duplicate;
    header.triangles_stored = triangles_;
    header.input_files = info.input_files;
    header.quantisation_error = info.quantisation_error;
    header.levels = uint32_t(levels_.size());
    header.nodes = uint32_t(node_count_);
    header.pages = directory.back().first_page + directory.back().page_count;
    header.blocks = uint32_t(directory.size());

    uint64_t offset = sizeof header;
    const auto section = [&](SectionKind kind, std::span<const std::byte> bytes) {
        header.sections[header.section_count++] = {uint32_t(kind), kSectionRequired, offset,
                                                   bytes.size(),
                                                   hashBytes(bytes.data(), bytes.size())};
        output_.file().writeAt(offset, bytes.data(), bytes.size());
        offset += bytes.size();
    };
    section(SectionKind::kAttributes, attributes);
    section(SectionKind::kDirectory, bytesOf(directory));
    if (!method_section.empty()) section(SectionKind::kMethod, method_section);
    header.checksum = hashBytes(&header, offsetof(FileHeader, checksum));
    output_.file().writeAt(0, &header, sizeof header);
}

void ModelWriter::finish(const ModelInfo& info, const ModelIdentity& identity,
                         std::span<const std::byte> method_section) {
    CHECK(!levels_.empty() && levels_.back().pages > 0);
    CHECK_EQ(level_, 0u);
    pages_.flush();
    nodes_.flush();
    std::vector<BlockEntry> directory;
    numberLevels(directory);
    const std::vector<std::byte> attributes = encodeAttributes(info.schema);
    position_ = sizeof(FileHeader) + attributes.size() + directory.size() * sizeof(BlockEntry) +
                method_section.size();

    // The front: whole levels with their nodes and pages. Then all other nodes, then all other
    // pages.
    std::vector<std::span<BlockEntry>> blocks;  // coarse to fine
    size_t first = 0;
    for (auto level = levels_.rbegin(); level != levels_.rend(); ++level) {
        blocks.push_back(std::span(directory).subspan(first, level->blocks.size()));
        first += level->blocks.size();
    }
    const size_t count = levels_.size();
    const auto levelAt = [&](size_t i) -> const Level& { return levels_[count - 1 - i]; };
    size_t front = 0;
    for (; front < count && fitsFront(levelAt(front)); ++front) {
        writeBlocks(levelAt(front), blocks[front], info.face_sizes);
        writePages(levelAt(front), blocks[front]);
    }
    for (size_t i = front; i < count; ++i) writeBlocks(levelAt(i), blocks[i], info.face_sizes);
    for (size_t i = front; i < count; ++i) writePages(levelAt(i), blocks[i]);
    writeHeader(info, identity, directory, attributes, method_section);
    output_.commit();
}

}  // namespace pietra
