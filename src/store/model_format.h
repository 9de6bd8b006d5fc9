#pragma once
// The fixed parts of a .pietra file as they lie on disk: FORMAT.md is the specification, these
// structs are its letter. Little-endian, no padding; reserved fields are zero.

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace pietra {

inline constexpr std::array<char, 8> kModelMagic = {'\x89', 'P', 'i', 'e', 't', 'r', 'a', '\n'};
/// The second has face sizes in its node blocks and is the same otherwise: only models that have
/// them are of it.
inline constexpr uint32_t kPlainVersion = 1, kFaceSizesVersion = 2;
inline constexpr uint32_t kEndianTag = 0x01020304;
/// Header, directory and the coarsest levels fit into this many bytes where these levels do.
inline constexpr uint64_t kFrontBytes = 1 << 20;
/// A node block ends with the page with which it reaches this many nodes.
inline constexpr uint32_t kBlockNodes = 2048;
inline constexpr uint32_t kMaxLevels = 4096;

enum class SectionKind : uint32_t {
    kNone = 0,
    kAttributes = 1,  ///< what vertices carry besides position and normal
    kDirectory = 2,   ///< BlockEntry array
    kMethod = 3,      ///< the method's own; pages are not patches where it is there
};
/// A reader that does not know a section with this flag must refuse the file.
inline constexpr uint32_t kSectionRequired = 1;

struct SectionEntry {
    uint32_t kind = 0;
    uint32_t flags = 0;
    uint64_t offset = 0;  ///< from the start of the file
    uint64_t bytes = 0;
    uint64_t checksum = 0;  ///< XXH3-64 of the section
};

struct FileHeader {
    std::array<char, 8> magic = kModelMagic;
    uint32_t version = kPlainVersion;
    uint32_t endian = kEndianTag;
    uint32_t header_bytes = 0;
    uint32_t method_format = 0;        ///< version of what the method stores, its own business
    std::array<char, 16> method = {};  ///< name, padded with zeros
    uint64_t file_bytes = 0;
    uint64_t source_hash = 0;    ///< of the input's bytes; 0: not known
    uint64_t settings_hash = 0;  ///< of what else determines the file's bytes; 0: not known
    std::array<double, 3> origin = {};
    double step = 0;
    std::array<int32_t, 3> bounds_min = {};
    std::array<int32_t, 3> bounds_max = {};
    uint64_t input_triangles = 0;
    uint64_t input_vertices = 0;
    uint64_t dropped_degenerate = 0;
    uint64_t dropped_duplicate = 0;
    uint64_t triangles_stored = 0;
    uint32_t input_files = 0;
    uint32_t shift = 0;
    float quantisation_error = 0;
    uint32_t levels = 0;
    uint32_t nodes = 0;
    uint32_t pages = 0;
    uint32_t blocks = 0;
    uint32_t section_count = 0;
    std::array<SectionEntry, 8> sections = {};
    std::array<uint8_t, 56> reserved = {};
    uint64_t checksum = 0;  ///< XXH3-64 of all bytes of the header before this field
};
static_assert(sizeof(SectionEntry) == 32 && sizeof(FileHeader) == 512);
static_assert(std::is_trivially_copyable_v<FileHeader>);
static_assert(std::has_unique_object_representations_v<SectionEntry>);

/// A run of consecutive nodes of one level, and the pages with their patches.
struct BlockEntry {
    uint64_t offset = 0;  ///< of the coded nodes
    uint64_t checksum = 0;
    uint64_t pages_offset = 0;  ///< its pages lie here one after the other
    uint64_t pages_bytes = 0;
    uint32_t bytes = 0;
    uint32_t level = 0;
    uint32_t first_node = 0;
    uint32_t node_count = 0;
    uint32_t first_page = 0;
    uint32_t page_count = 0;
};
static_assert(sizeof(BlockEntry) == 56 && std::has_unique_object_representations_v<BlockEntry>);

}  // namespace pietra
