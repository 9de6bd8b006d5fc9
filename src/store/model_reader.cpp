#include "store/model_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <unordered_map>

#include "base/error.h"
#include "base/hash.h"
#include "store/attributes.h"
#include "store/node_block.h"

namespace pietra {

namespace {

/// Whether `bytes` bytes at `offset` lie within a file of `size` bytes.
bool inside(uint64_t offset, uint64_t bytes, uint64_t size) {
    return offset <= size && bytes <= size - offset;
}

bool saneLattice(const FileHeader& header) {
    bool good = std::isfinite(header.step) && header.step > 0 &&
                header.shift <= uint32_t(kMaxLatticeShift) &&
                std::isfinite(header.quantisation_error) && header.quantisation_error >= 0;
    for (const double x : header.origin) good = good && std::isfinite(x);
    return good;
}

ModelInfo infoFrom(const FileHeader& header) {
    ModelInfo info;
    info.method.assign(header.method.data(), ::strnlen(header.method.data(), header.method.size()));
    for (int axis = 0; axis < 3; ++axis) {
        info.lattice.origin[axis] = header.origin[axis];
        info.bounds.min[axis] = header.bounds_min[axis];
        info.bounds.max[axis] = header.bounds_max[axis];
    }
    info.lattice.step = header.step;
    info.lattice.shift = int(header.shift);
    info.input_triangles = header.input_triangles;
    info.input_vertices = header.input_vertices;
    info.input_files = header.input_files;
    info.dropped_degenerate = header.dropped_degenerate;
    info.dropped_duplicate = header.dropped_duplicate;
    info.quantisation_error = header.quantisation_error;
    info.levels = header.levels;
    info.triangles_stored = header.triangles_stored;
    info.face_sizes = header.version == kFaceSizesVersion;
    return info;
}

}  // namespace

ModelReader::ModelReader(const std::string& path) : file_(path, File::Mode::kRead) {
    if (!file_.isRegular()) throw InputError(path, "", "is a pipe or device, not a file");
    FileHeader header;
    readHeader(header);
    info_ = infoFrom(header);
    format_version_ = header.version;
    identity_ = {header.source_hash, header.settings_hash, header.method_format};
    std::string fault;
    const std::vector<std::byte> attributes = readSection(header, SectionKind::kAttributes);
    if (!decodeAttributes(attributes, info_.schema, fault)) fail(header.sections[0].offset, fault);

    if (hasSection(header, SectionKind::kMethod))
        method_section_ = readSection(header, SectionKind::kMethod);

    std::vector<BlockEntry> directory;
    readDirectory(header, directory);
    levels_.resize(header.levels);
    for (const BlockEntry& entry : directory) {
        if (levels_[entry.level].count == 0) levels_[entry.level].first = entry.first_node;
        levels_[entry.level].count += entry.node_count;
    }
    for (const BlockEntry& entry : directory) readBlock(entry);
    fillJoints();
    uint64_t triangles = 0, range_children = 0;
    for (const Node& node : nodes_) {
        triangles += node.triangles;
        if (node.child_range) range_children += node.child[1] - node.child[0] + 1;
    }
    if (range_children > nodes_.size()) fail(sizeof header, "nodes have too many children");
    if (triangles != info_.triangles_stored)
        fail(offsetof(FileHeader, triangles_stored),
             fmt::format("the nodes hold {} triangles, the header says {}", triangles,
                         info_.triangles_stored));
}

void ModelReader::fail(uint64_t offset, const std::string& what) const {
    throw InputError::atByte(path(), offset, what);
}

void ModelReader::failPage(uint32_t page, const std::string& fault) const {
    fail(pages_[page].offset, fault);
}

void ModelReader::readHeader(FileHeader& header) {
    const size_t got = file_.readSomeAt(0, &header, sizeof header);
    if (got < kModelMagic.size() || header.magic != kModelMagic) fail(0, "this is no Pietra model");
    if (got < sizeof header) fail(got, "the file ends early, within its header");
    if (header.endian != kEndianTag)
        fail(offsetof(FileHeader, endian), "the byte order is not little-endian");
    if (header.version < kPlainVersion || header.version > kFaceSizesVersion)
        fail(offsetof(FileHeader, version),
             fmt::format("format version {} is unknown, this program reads versions {} to {}",
                         header.version, kPlainVersion, kFaceSizesVersion));
    if (header.checksum != hashBytes(&header, offsetof(FileHeader, checksum)))
        fail(offsetof(FileHeader, checksum), "the header is damaged (checksum)");
    file_bytes_ = file_.size();
    if (file_bytes_ < header.file_bytes)
        fail(file_bytes_,
             fmt::format("the file ends early, {} bytes short", header.file_bytes - file_bytes_));
    if (file_bytes_ > header.file_bytes)
        fail(header.file_bytes,
             fmt::format("{} bytes too many follow the model", file_bytes_ - header.file_bytes));
    if (header.header_bytes != sizeof header || !saneLattice(header) || header.levels == 0 ||
        header.levels > kMaxLevels || header.section_count > header.sections.size())
        fail(0, "the header holds impossible numbers");
    for (uint32_t i = 0; i < header.section_count; ++i) {
        const SectionEntry& section = header.sections[i];
        const bool known = section.kind == uint32_t(SectionKind::kAttributes) ||
                           section.kind == uint32_t(SectionKind::kDirectory) ||
                           section.kind == uint32_t(SectionKind::kMethod);
        if (!known && (section.flags & kSectionRequired) != 0)
            fail(offsetof(FileHeader, sections) + i * sizeof section,
                 fmt::format("section kind {} is unknown to this version", section.kind));
    }
}

bool ModelReader::hasSection(const FileHeader& header, SectionKind kind) {
    const auto sections = std::span(header.sections).first(header.section_count);
    return std::any_of(sections.begin(), sections.end(),
                       [&](const SectionEntry& s) { return s.kind == uint32_t(kind); });
}

std::vector<std::byte> ModelReader::readSection(const FileHeader& header, SectionKind kind) const {
    for (uint32_t i = 0; i < header.section_count; ++i) {
        const SectionEntry& section = header.sections[i];
        if (section.kind != uint32_t(kind)) continue;
        if (!inside(section.offset, section.bytes, file_bytes_))
            fail(section.offset, "a section lies outside of the file");
        std::vector<std::byte> bytes(size_t(section.bytes));
        file_.readAt(section.offset, bytes.data(), bytes.size());
        if (hashBytes(bytes.data(), bytes.size()) != section.checksum)
            fail(section.offset, fmt::format("section {} is damaged (checksum)", section.kind));
        return bytes;
    }
    fail(offsetof(FileHeader, sections), fmt::format("section {} is missing", uint32_t(kind)));
}

void ModelReader::readDirectory(const FileHeader& header,
                                std::vector<BlockEntry>& directory) const {
    const std::vector<std::byte> bytes = readSection(header, SectionKind::kDirectory);
    const auto bad = [&](const char* what) {
        fail(sizeof header, fmt::format("the directory is damaged: {}", what));
    };
    if (bytes.size() != header.blocks * sizeof(BlockEntry) || header.blocks == 0)
        bad("its size is wrong");
    directory.resize(header.blocks);
    std::memcpy(directory.data(), bytes.data(), bytes.size());
    uint64_t nodes = 0, pages = 0, room = file_bytes_;
    uint32_t level = 0;
    for (const BlockEntry& entry : directory) {
        if (entry.first_node != nodes || entry.first_page != pages || entry.node_count == 0 ||
            entry.page_count == 0 || entry.page_count > entry.node_count)
            bad("its blocks are not in sequence");
        if (entry.level != level && entry.level != level + 1) bad("its levels are not in sequence");
        if (!inside(entry.offset, entry.bytes, file_bytes_) ||
            !inside(entry.pages_offset, entry.pages_bytes, file_bytes_))
            bad("a block lies outside of the file");
        level = entry.level;
        nodes += entry.node_count;
        pages += entry.page_count;
        // A patch takes two bytes of its page at least: so the file's size bounds the node table's.
        room -= std::min(room, entry.bytes + entry.pages_bytes);
        if (entry.node_count > entry.pages_bytes / 2) bad("a block has impossible counts");
    }
    if (directory.front().level != 0 || level + 1 != header.levels || nodes != header.nodes ||
        pages != header.pages || nodes >= kNoNode || room == 0)
        bad("its sums are not the header's");
}

void ModelReader::readBlock(const BlockEntry& entry) {
    std::vector<std::byte> bytes(entry.bytes);
    file_.readAt(entry.offset, bytes.data(), bytes.size());
    if (hashBytes(bytes.data(), bytes.size()) != entry.checksum)
        fail(entry.offset, "a block of nodes is damaged (checksum)");
    std::vector<PageRecord> records;
    std::string fault;
    if (!decodeNodeBlock(bytes, entry, info_.face_sizes, nodes_, records, fault))
        fail(entry.offset, fmt::format("a block of nodes is damaged: {}", fault));

    uint64_t offset = entry.pages_offset;
    NodeIndex node = entry.first_node;
    for (const PageRecord& record : records) {
        if (record.node_count == 0 || record.node_count > kMaxPagePatches)
            fail(entry.offset, "a page has an impossible number of patches");
        pages_.push_back({offset, record.checksum, record.bytes, node, record.node_count});
        offset += record.bytes;
        node += record.node_count;
    }
    if (offset != entry.pages_offset + entry.pages_bytes)
        fail(entry.offset, "a block's pages do not fill their room");
    checkNodes(entry);
}

void ModelReader::checkNodes(const BlockEntry& entry) {
    const LevelRange finer =
        entry.level + 1 < levels_.size() ? levels_[entry.level + 1] : LevelRange{};
    for (uint32_t p = entry.first_page; p < entry.first_page + entry.page_count; ++p) {
        const PageInfo& page = pages_[p];
        uint64_t triangles = 0, vertices = 0;
        for (uint32_t i = 0; i < page.node_count; ++i) {
            Node& node = nodes_[page.first_node + i];
            node.page = p;
            node.patch = uint16_t(i);
            node.level = uint16_t(entry.level);
            triangles += node.triangles;
            vertices += node.vertices;
            bool sound = !node.is_joint || (node.child[0] == kNoNode && node.child[1] == kNoNode);
            sound = sound && (!node.child_range ||
                              (node.child[0] <= node.child[1] && node.child[1] != kNoNode));
            if (!sound) fail(entry.offset, "a block of nodes is damaged: its children");
            for (const NodeIndex child : node.child)
                if (child != kNoNode && child - finer.first >= finer.count)
                    fail(entry.offset, fmt::format("node {} has a child outside of the next level",
                                                   page.first_node + i));
        }
        if (triangles > kMaxPageTriangles || vertices > kMaxPageVertices)
            fail(entry.offset, fmt::format("page {} states impossible counts", p));
    }
}

/// Their groups' errors, spheres and face sizes, which the file says once.
void ModelReader::fillJoints() {
    if (std::none_of(nodes_.begin(), nodes_.end(), [](const Node& n) { return n.is_joint; }))
        return;
    std::unordered_map<uint32_t, NodeIndex> of_group;
    for (const Node& node : nodes_)
        if (!node.is_joint && !node.isLeaf())
            of_group.emplace(node.group, NodeIndex(&node - nodes_.data()));
    for (Node& node : nodes_) {
        if (!node.is_joint) continue;
        const auto found = of_group.find(node.group);
        if (found == of_group.end())
            fail(0, fmt::format("a joint of group {}, which is not there", node.group));
        const Node& mate = nodes_[found->second];
        node.error = mate.error;
        node.face_size = mate.face_size;
        node.saturated = mate.saturated;
    }
}

PageSettings ModelReader::pageSettings() const {
    PageSettings settings;
    settings.shift = info_.lattice.shift;
    settings.colours = info_.schema.colours;
    settings.scalar_count = int(info_.schema.scalars.size());
    return settings;
}

bool ModelReader::tryReadPage(uint32_t page, std::vector<std::byte>& bytes,
                              std::string& fault) const {
    const PageInfo& info = pages_[page];
    bytes.resize(info.bytes);
    try {
        file_.readAt(info.offset, bytes.data(), bytes.size());
    } catch (const Error& error) {
        fault = error.what();
        return false;
    }
    if (hashBytes(bytes.data(), bytes.size()) != info.checksum) {
        fault = fmt::format("page {} is damaged (checksum)", page);
        return false;
    }
    return true;
}

void ModelReader::readPage(uint32_t page, std::vector<std::byte>& bytes) const {
    const PageInfo& info = pages_[page];
    bytes.resize(info.bytes);
    file_.readAt(info.offset, bytes.data(), bytes.size());
    if (hashBytes(bytes.data(), bytes.size()) != info.checksum)
        failPage(page, fmt::format("page {} is damaged (checksum)", page));
}

bool ModelReader::tryDecode(uint32_t page, std::span<const std::byte> bytes,
                            std::vector<Mesh>& patches, std::string& fault) const {
    if (!hasPatches()) return fault = fmt::format("page {} holds no patches", page), false;
    const PageInfo& info = pages_[page];
    uint64_t vertices = 0, triangles = 0;
    for (uint32_t i = 0; i < info.node_count; ++i) {
        vertices += nodes_[info.first_node + i].vertices;
        triangles += nodes_[info.first_node + i].triangles;
    }
    PageCounts counts;
    std::string why;
    bool good = peekPage(bytes, counts, why);
    if (good && (counts.patches != info.node_count || counts.vertices != vertices ||
                 counts.triangles != triangles)) {
        good = false;
        why = "its counts are not those of its nodes";
    }
    good = good && decodePage(bytes, pageSettings(), patches, why);
    for (uint32_t i = 0; good && i < info.node_count; ++i) {
        const Node& node = nodes_[info.first_node + i];
        if (patches[i].vertexCount() == node.vertices &&
            patches[i].triangleCount() == node.triangles)
            continue;
        good = false;
        why = "its counts are not those of its nodes";
    }
    if (!good) fault = fmt::format("page {} is damaged: {}", page, why);
    return good;
}

void ModelReader::decode(uint32_t page, std::vector<Mesh>& patches) const {
    std::vector<std::byte> bytes;
    readPage(page, bytes);
    std::string fault;
    if (!tryDecode(page, bytes, patches, fault)) failPage(page, fault);
}

bool isModelFile(const std::string& path) try {
    std::error_code fault;
    if (!std::filesystem::is_regular_file(path, fault)) return false;
    std::array<char, kModelMagic.size()> magic{};
    File(path, File::Mode::kRead).readSomeAt(0, magic.data(), magic.size());
    return std::equal(magic.begin(), magic.end(), kModelMagic.begin());
} catch (const IoError&) {
    return false;
}

Box3d boundsOf(std::span<const ModelReader* const> models) {
    Box3d box;
    for (const ModelReader* model : models) {
        const ModelInfo& info = model->info();
        box.add(info.lattice.toInput(info.bounds.min));
        box.add(info.lattice.toInput(info.bounds.max));
    }
    return box;
}

}  // namespace pietra
