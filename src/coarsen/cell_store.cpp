#include "coarsen/cell_store.h"

#include <algorithm>
#include <cstring>

#include "base/check.h"
#include "geometry/lattice.h"

namespace pietra {

namespace {

struct BlobHeader {
    uint32_t vertices;
    uint32_t triangles;
    uint8_t has_classes;  // else all are zero
    uint8_t has_bounds;   // else all are `bound`
    uint8_t has_colours;
    uint8_t closed;
    uint8_t corner_bytes;  // of each number; 0: there are none, or all are 0
    uint8_t has_corners;
    uint16_t unused;
    float bound;
};

class Packer {
public:
    explicit Packer(std::vector<std::byte>& out) : out_(out) {}
    template <class T>
    void put(const T* data, size_t count) {
        // note: insert() here makes g++ 12 warn of overflows that cannot be.
        const size_t begin = out_.size();
        out_.resize(begin + count * sizeof(T));
        if (count) std::memcpy(out_.data() + begin, data, count * sizeof(T));
    }

    void putBytes(const void* data, size_t bytes) {
        const size_t begin = out_.size();
        out_.resize(begin + bytes);
        std::memcpy(out_.data() + begin, data, bytes);
    }

private:
    std::vector<std::byte>& out_;
};

class Unpacker {
public:
    explicit Unpacker(std::span<const std::byte> in) : in_(in) {}
    template <class T>
    void get(T* data, size_t count) {
        CHECK_LE(count * sizeof(T), in_.size());
        if (count) std::memcpy(data, in_.data(), count * sizeof(T));
        in_ = in_.subspan(count * sizeof(T));
    }
    /// Of little endian numbers the lower ones.
    void getBytes(void* data, size_t bytes) {
        CHECK_LE(bytes, in_.size());
        std::memcpy(data, in_.data(), bytes);
        in_ = in_.subspan(bytes);
    }
    template <class T>
    void get(std::vector<T>& data, size_t count) {
        data.resize(count);
        get(data.data(), count);
    }

private:
    std::span<const std::byte> in_;
};

bool allEqual(const std::vector<float>& values, float value) {
    return std::all_of(values.begin(), values.end(), [=](float v) { return v == value; });
}

template <class T>
std::vector<T>& scratch() {
    thread_local std::vector<T> buffer;
    buffer.clear();
    return buffer;
}

}  // namespace

CellBlob CellStore::put(const CellMesh& cell) {
    const Mesh& mesh = cell.mesh;
    const FaceBounds& bounds = cell.bounds;
    const float first = mesh.triangle.empty() ? 0 : bounds.to_original[0];
    BlobHeader header{};
    header.vertices = uint32_t(mesh.vertexCount());
    header.triangles = uint32_t(mesh.triangleCount());
    header.has_classes = std::any_of(mesh.edge_class.begin(), mesh.edge_class.end(),
                                     [](uint8_t c) { return c != 0; });
    header.has_bounds =
        !allEqual(bounds.to_original, first) || !allEqual(bounds.from_original, first);
    header.has_colours = !mesh.colour.empty();
    header.closed = cell.closed;
    header.bound = first;
    header.has_corners = !cell.corner.empty();
    uint32_t largest = 0;
    for (const auto& row : cell.corner) largest = std::max({largest, row[0], row[1], row[2]});
    header.corner_bytes = largest == 0 ? 0 : largest < 1 << 8 ? 1 : largest < 1 << 16 ? 2 : 4;

    std::vector<std::byte>& out = scratch<std::byte>();
    Packer pack(out);
    pack.put(&header, 1);
    std::vector<uint64_t>& keys = scratch<uint64_t>();
    for (const Vec3i& p : mesh.position) keys.push_back(latticeKey(p));
    pack.put(keys.data(), keys.size());
    pack.put(mesh.normal.data(), mesh.normal.size());
    if (header.has_colours) pack.put(mesh.colour.data(), mesh.colour.size());
    pack.put(mesh.scalar.data(), mesh.scalar.size());
    if (header.has_bounds) {
        pack.put(bounds.to_original.data(), bounds.to_original.size());
        pack.put(bounds.from_original.data(), bounds.from_original.size());
    }
    if (header.vertices <= 0x10000) {
        std::vector<uint16_t>& corners = scratch<uint16_t>();
        for (const Triangle& t : mesh.triangle)
            for (uint32_t v : t) corners.push_back(uint16_t(v));
        pack.put(corners.data(), corners.size());
    } else {
        pack.put(mesh.triangle.data(), mesh.triangle.size());
    }
    if (header.has_classes) pack.put(mesh.edge_class.data(), mesh.edge_class.size());
    for (const auto& row : cell.corner)
        for (const uint32_t n : row) pack.putBytes(&n, header.corner_bytes);
    CHECK_LT(out.size(), size_t(1) << 32);
    return {this, spill_.append(out), uint32_t(out.size()), header.triangles};
}

void CellStore::get(const CellBlob& blob, CellMesh& cell) const {
    CHECK(blob.store == this);
    std::vector<std::byte>& bytes = scratch<std::byte>();
    bytes.resize(blob.bytes);
    spill_.read(blob.position, bytes);
    Unpacker unpack(bytes);
    BlobHeader header;
    unpack.get(&header, 1);
    cell.closed = header.closed != 0;
    Mesh& mesh = cell.mesh;
    std::vector<uint64_t>& keys = scratch<uint64_t>();
    unpack.get(keys, header.vertices);
    mesh.position.clear();
    for (uint64_t key : keys) mesh.position.push_back(latticePoint(key));
    unpack.get(mesh.normal, header.vertices);
    unpack.get(mesh.colour, header.has_colours ? header.vertices : 0);
    unpack.get(mesh.scalar, size_t(header.vertices) * size_t(scalar_count_));
    if (header.has_bounds) {
        unpack.get(cell.bounds.to_original, header.triangles);
        unpack.get(cell.bounds.from_original, header.triangles);
    } else {
        cell.bounds.to_original.assign(header.triangles, header.bound);
        cell.bounds.from_original.assign(header.triangles, header.bound);
    }
    mesh.triangle.resize(header.triangles);
    if (header.vertices <= 0x10000) {
        std::vector<uint16_t>& corners = scratch<uint16_t>();
        unpack.get(corners, 3 * size_t(header.triangles));
        for (size_t t = 0; t < header.triangles; ++t)
            mesh.triangle[t] = {corners[3 * t], corners[3 * t + 1], corners[3 * t + 2]};
    } else {
        unpack.get(mesh.triangle.data(), header.triangles);
    }
    if (header.has_classes)
        unpack.get(mesh.edge_class, header.triangles);
    else
        mesh.edge_class.assign(header.triangles, 0);
    cell.corner.assign(header.has_corners ? header.triangles : 0, {});
    for (auto& row : cell.corner)
        for (uint32_t& n : row) unpack.getBytes(&n, header.corner_bytes);
}

}  // namespace pietra
