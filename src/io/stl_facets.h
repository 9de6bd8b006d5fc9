#pragma once
// Reads the facets of an STL file, binary or text, from any place that was reached before.
//
// Text: keywords in any case, any blanks and line ends (LF, CRLF, CR), names of solids with blanks,
// several solids in one file. Numbers keep the precision of doubles. Normals are passed over,
// whatever they are: writers leave them zero or worse, and the order of the corners says the same.
// Faults are InputErrors with the byte offset (binary) or the line (text).

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/vec.h"
#include "io/byte_reader.h"

namespace pietra {

struct StlPlace {
    uint64_t offset = 0;
    uint64_t facet = 0;     ///< how many facets lie before
    bool in_solid = false;  ///< text only
};

class StlFacets {
public:
    virtual ~StlFacets() = default;
    virtual StlPlace start() const = 0;
    /// How many facets there are, where that is known before they are read: in binary files.
    virtual std::optional<uint64_t> count() const = 0;
    /// Reads the facets at `place` and moves it; returns how many: 0 at the end only. `corners`:
    /// three a facet, counter-clockwise seen from outside; all finite.
    virtual size_t read(StlPlace& place, std::span<Vec3d> corners) = 0;
    /// As TriangleSource::notes().
    virtual std::vector<std::string> notes() const = 0;
};

/// Whether a file that begins with `head` may be a text: its first word is "solid".
bool beginsAsStlText(std::span<const uint8_t> head);

/// Whether a file of `bytes` that begins with `head` has just the size that the count of a binary
/// file asks for.
bool isBinaryStlSize(std::span<const uint8_t> head, uint64_t bytes);

/// Whether an STL file is text: it begins with "solid", but so do some binary files.
bool isStlText(ByteReader& reader);

/// Throws InputError where the file is too short, or the count in its header is not what its size
/// has room for.
std::unique_ptr<StlFacets> openBinaryStl(ByteReader& reader);
std::unique_ptr<StlFacets> openTextStl(ByteReader& reader);

}  // namespace pietra
