#include "render/gl/page_format.h"

#include <cstring>
#include <limits>

#include "base/check.h"
#include "geometry/lattice.h"

namespace pietra {
namespace {

VertexLayout layoutOf(const Mesh& mesh) {
    const size_t vertices = mesh.vertexCount();
    CHECK_EQ(mesh.normal.size(), vertices);
    CHECK(mesh.colour.empty() || mesh.colour.size() == vertices);
    CHECK_EQ(mesh.scalar.size() % vertices, size_t(0));
    return {!mesh.colour.empty(), uint32_t(mesh.scalar.size() / vertices)};
}

void findBox(const Mesh& mesh, PatchRange& range) {
    Vec3i low = mesh.position[0], high = low;
    for (const Vec3i& p : mesh.position) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    for (int k = 0; k < 3; ++k) CHECK_LT(int64_t(high[k]) - low[k], int64_t(1) << kLatticeBits);
    range.corner = low;
    range.extent = high - low;
}

}  // namespace

PageShape shapeOf(std::span<const Mesh> patches) {
    PageShape shape;
    shape.patches.resize(patches.size());
    size_t vertices = 0;
    bool first = true;
    for (size_t i = 0; i < patches.size(); ++i) {
        const Mesh& mesh = patches[i];
        if (mesh.vertexCount() == 0) continue;
        const VertexLayout layout = layoutOf(mesh);
        if (first) shape.layout = layout;
        CHECK(layout == shape.layout);
        first = false;
        PatchRange& range = shape.patches[i];
        findBox(mesh, range);
        range.first_vertex = uint32_t(vertices);
        range.vertices = uint32_t(mesh.vertexCount());
        range.indices = uint32_t(3 * mesh.triangleCount());
        range.wide = mesh.vertexCount() > size_t(1) << 16;
        vertices += mesh.vertexCount();
    }
    shape.bytes = vertices * shape.layout.stride();
    for (PatchRange& range : shape.patches) {
        range.index_offset = uint32_t(shape.bytes);
        shape.bytes += (size_t(range.indices) * (range.wide ? 4 : 2) + 3) / 4 * 4;
        CHECK_LE(shape.bytes, size_t(std::numeric_limits<uint32_t>::max()));
    }
    return shape;
}

void packVertices(const Mesh& mesh, const VertexLayout& layout, const Vec3i& corner, size_t first,
                  size_t count, std::byte* out) {
    const auto put = [&](const auto& value) {
        std::memcpy(out, &value, sizeof(value));
        out += sizeof(value);
    };
    for (size_t i = first; i < first + count; ++i) {
        put(latticeKey(mesh.position[i] - corner));
        put(mesh.normal[i]);
        if (layout.colours) put(mesh.colour[i]);
        for (uint32_t k = 0; k < layout.scalars; ++k) put(mesh.scalar[i * layout.scalars + k]);
    }
}

void packIndices(const Mesh& mesh, bool wide, size_t first, size_t count, std::byte* out) {
    const uint32_t* index = mesh.triangle.data()->data() + first;
    if (wide) {
        std::memcpy(out, index, 4 * count);
        return;
    }
    for (size_t i = 0; i < count; ++i) {
        const auto narrow = uint16_t(index[i]);
        std::memcpy(out + 2 * i, &narrow, 2);
    }
}

}  // namespace pietra
