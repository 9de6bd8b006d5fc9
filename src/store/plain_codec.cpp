#include "store/plain_codec.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <bit>

#include "geometry/lattice.h"
#include "store/columns.h"

namespace pietra {

namespace {

constexpr int kCacheSize = 16;  // vertices; post-transform caches of GPUs hold at least that many

// Columns, in the order of the file. Those from kEdgeClass on hold one number a vertex, but for
// kEdgeClass itself and the corners, one a triangle.
enum Column : size_t {
    kCornerA,
    kCornerB,
    kCornerC,
    kEdgeClass,
    kX,
    kY,
    kZ,
    kNormalX,
    kNormalY,
    kAttributes  // r, g, b, a where there are colours, then the scalars
};

bool isTriangleColumn(size_t column) {
    return column <= kEdgeClass;
}

size_t columnCount(const PageHeader& header) {
    return kAttributes + (header.colours ? 4 : 0) + size_t(header.scalar_count);
}

/// A patch in the order in which it is written: triangles for the vertex cache, each rotated so
/// that vertices not used before come last, and vertices by first use.
struct Order {
    std::vector<Triangle> triangle;   // new indices
    std::vector<uint8_t> edge_class;  // rotated likewise
    std::vector<uint32_t> vertex;     // vertex[new] = old
};

int firstCorner(const Triangle& t, const std::vector<uint32_t>& number) {
    int fresh = 0, last_fresh = 0, first_fresh = -1;
    for (int k = 0; k < 3; ++k)
        if (number[t[k]] == ~0u) {
            if (first_fresh < 0) first_fresh = k;
            last_fresh = k;
            ++fresh;
        }
    if (fresh == 0 || fresh == 3) {  // the newest vertex last
        const int newest =
            int(std::max_element(t.begin(), t.end(),
                                 [&](uint32_t a, uint32_t b) { return number[a] < number[b]; }) -
                t.begin());
        return (newest + 1) % 3;
    }
    if (fresh == 1) return (last_fresh + 1) % 3;
    for (int k = 0; k < 3; ++k)
        if (number[t[k]] != ~0u) return k;
    return 0;
}

void orderPatch(const Mesh& mesh, Order& order) {
    const size_t n = mesh.vertexCount(), m = mesh.triangleCount();
    // meshoptimizer does not say which triangle went where, and a triangle may come more than once:
    // so the classes are carried along by a sort of the old triangles, not by position.
    std::vector<uint32_t> cached(3 * m);
    const auto* indices = reinterpret_cast<const uint32_t*>(mesh.triangle.data());
    if (m > 0) meshopt_optimizeVertexCacheFifo(cached.data(), indices, 3 * m, n, kCacheSize);
    const bool plain = std::all_of(mesh.edge_class.begin(), mesh.edge_class.end(),
                                   [](uint8_t classes) { return classes == 0; });
    std::vector<uint8_t> classes(m, 0);
    if (!plain) {
        std::vector<uint32_t> from(m), to(m);
        for (uint32_t i = 0; i < m; ++i) from[i] = to[i] = i;
        const auto corners = [](const uint32_t* list, uint32_t i) {
            return Triangle{list[3 * i], list[3 * i + 1], list[3 * i + 2]};
        };
        std::stable_sort(from.begin(), from.end(), [&](uint32_t a, uint32_t b) {
            return corners(indices, a) < corners(indices, b);
        });
        std::stable_sort(to.begin(), to.end(), [&](uint32_t a, uint32_t b) {
            return corners(cached.data(), a) < corners(cached.data(), b);
        });
        for (size_t i = 0; i < m; ++i) classes[to[i]] = mesh.edge_class[from[i]];
    }

    order.triangle.resize(m);
    order.edge_class.resize(m);
    order.vertex.clear();
    std::vector<uint32_t> number(n, ~0u);
    for (size_t i = 0; i < m; ++i) {
        const Triangle t{cached[3 * i], cached[3 * i + 1], cached[3 * i + 2]};
        const auto first = uint32_t(firstCorner(t, number));
        order.edge_class[i] = rotateClasses(classes[i], first);
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t v = t[(first + k) % 3];
            if (number[v] == ~0u) {
                number[v] = uint32_t(order.vertex.size());
                order.vertex.push_back(v);
            }
            order.triangle[i][k] = number[v];
        }
    }
    for (uint32_t v = 0; v < n; ++v)
        if (number[v] == ~0u) order.vertex.push_back(v);
}

using Columns = std::vector<std::vector<uint32_t>>;

void writeTriangles(const Order& order, Columns& columns) {
    uint32_t next = 0;
    for (size_t i = 0; i < order.triangle.size(); ++i) {
        for (int k = 0; k < 3; ++k) {
            const uint32_t v = order.triangle[i][k];
            columns[kCornerA + k].push_back(next - v);
            next += uint32_t(v == next);
        }
        columns[kEdgeClass].push_back(order.edge_class[i]);
    }
}

void writeVertices(const PageHeader& header, const PatchHeader& patch, const Mesh& mesh,
                   const Order& order, Columns& columns) {
    std::array<uint32_t, 5> before{};
    std::vector<uint32_t> attributes_before(columnCount(header) - kAttributes, 0);
    const auto put = [&](size_t column, uint32_t& previous, uint32_t value) {
        columns[column].push_back(zigzag(value - previous));
        previous = value;
    };
    for (const uint32_t v : order.vertex) {
        const Vec3i p = (mesh.position[v] >> header.shift) - patch.corner;
        for (int axis = 0; axis < 3; ++axis) put(kX + axis, before[axis], uint32_t(p[axis]));
        const std::array<int32_t, 2> normal = quantisedNormal(mesh.normal[v], header.normal_bits);
        for (int k = 0; k < 2; ++k) put(kNormalX + k, before[3 + k], uint32_t(normal[k]));
        size_t a = 0;
        if (header.colours) {
            const Rgba8 c = mesh.colour[v];
            for (const uint8_t channel : {c.r, c.g, c.b, c.a}) {
                put(kAttributes + a, attributes_before[a], channel);
                ++a;
            }
        }
        for (int s = 0; s < header.scalar_count; ++s, ++a)
            put(kAttributes + a, attributes_before[a],
                std::bit_cast<uint32_t>(mesh.scalar[v * size_t(header.scalar_count) + s]));
    }
}

/// Reads patch after patch from the unpacked streams.
class PlainReader {
public:
    PlainReader(const PageHeader& header, const StreamUnpacker& streams,
                std::span<const uint8_t> planes)
        : header_(header), streams_(streams), planes_(planes.begin(), planes.end()) {
        size_t stream = 0;
        for (const uint8_t count : planes_) {
            first_.push_back(stream);
            stream += count;
        }
    }

    bool readPatch(const PatchHeader& patch, Mesh& mesh) {
        const bool good = readTriangles(patch, mesh) && readPositions(patch, mesh) &&
                          readNormals(patch, mesh) && readAttributes(patch, mesh);
        triangles_ += patch.triangles;
        vertices_ += patch.vertices;
        return good;
    }

private:
    std::span<const uint32_t> column(size_t which, uint32_t count, int scratch) {
        std::vector<uint32_t>& out = scratch_[scratch];
        out.resize(count);
        unpackColumn(streams_, first_[which], planes_[which],
                     isTriangleColumn(which) ? triangles_ : vertices_, out);
        return out;
    }

    bool readTriangles(const PatchHeader& patch, Mesh& mesh) {
        const uint32_t m = patch.triangles;
        const auto a = column(kCornerA, m, 0), b = column(kCornerB, m, 1),
                   c = column(kCornerC, m, 2), classes = column(kEdgeClass, m, 3);
        mesh.triangle.resize(m);
        mesh.edge_class.resize(m);
        uint32_t next = 0, bad = 0;
        const auto corner = [&](uint32_t back) {
            const uint32_t v = next - back;  // wraps above `next` if `back` is too large
            bad |= uint32_t(v > next);
            next += uint32_t(back == 0);
            return v;
        };
        for (uint32_t i = 0; i < m; ++i) {
            const uint32_t va = corner(a[i]), vb = corner(b[i]), vc = corner(c[i]);
            mesh.triangle[i] = {va, vb, vc};
            mesh.edge_class[i] = uint8_t(classes[i]);
            bad |= classes[i] >> 6;
        }
        return bad == 0 && next <= patch.vertices;
    }

    bool readPositions(const PatchHeader& patch, Mesh& mesh) {
        const uint32_t n = patch.vertices;
        const auto x = column(kX, n, 0), y = column(kY, n, 1), z = column(kZ, n, 2);
        mesh.position.resize(n);
        glm::uvec3 p(patch.corner);
        uint32_t bad = 0;
        const uint32_t top = uint32_t(kLatticeMax) >> header_.shift;
        for (uint32_t i = 0; i < n; ++i) {
            p += glm::uvec3(unzigzag(x[i]), unzigzag(y[i]), unzigzag(z[i]));
            bad |= uint32_t(p.x > top) | uint32_t(p.y > top) | uint32_t(p.z > top);
            mesh.position[i] = Vec3i(p << uint32_t(header_.shift));
        }
        return bad == 0;
    }

    bool readNormals(const PatchHeader& patch, Mesh& mesh) {
        const uint32_t n = patch.vertices;
        const auto x = column(kNormalX, n, 0), y = column(kNormalY, n, 1);
        mesh.normal.resize(n);
        const uint32_t top = (1u << (header_.normal_bits - 1)) - 1;
        uint32_t code_x = 0, code_y = 0, bad = 0;
        for (uint32_t i = 0; i < n; ++i) {
            code_x += unzigzag(x[i]);
            code_y += unzigzag(y[i]);
            bad |= uint32_t(code_x + top > 2 * top) | uint32_t(code_y + top > 2 * top);
            if (bad) break;
            mesh.normal[i] = {int16_t(restoreNormal(int32_t(code_x), header_.normal_bits)),
                              int16_t(restoreNormal(int32_t(code_y), header_.normal_bits))};
        }
        return bad == 0;
    }

    bool readAttributes(const PatchHeader& patch, Mesh& mesh) {
        const uint32_t n = patch.vertices;
        const auto scalars = size_t(header_.scalar_count);
        mesh.colour.resize(header_.colours ? n : 0);
        mesh.scalar.resize(n * scalars);
        size_t which = kAttributes;
        if (header_.colours)
            for (uint8_t Rgba8::*channel : {&Rgba8::r, &Rgba8::g, &Rgba8::b, &Rgba8::a}) {
                const auto difference = column(which++, n, 0);
                uint32_t value = 0;
                for (uint32_t i = 0; i < n; ++i) {
                    value += unzigzag(difference[i]);
                    mesh.colour[i].*channel = uint8_t(value);
                }
            }
        for (size_t s = 0; s < scalars; ++s) {
            const auto difference = column(which++, n, 0);
            uint32_t value = 0;
            for (uint32_t i = 0; i < n; ++i) {
                value += unzigzag(difference[i]);
                mesh.scalar[i * scalars + s] = std::bit_cast<float>(value);
            }
        }
        return true;
    }

    const PageHeader& header_;
    const StreamUnpacker& streams_;
    const std::vector<uint8_t> planes_;
    std::vector<size_t> first_;
    size_t triangles_ = 0, vertices_ = 0;  // of the patches before
    std::array<std::vector<uint32_t>, 4> scratch_;
};

}  // namespace

void encodePlain(const PageHeader& header, std::span<const Mesh* const> patches,
                 ByteWriter& writer) {
    Columns columns(columnCount(header));
    Order order;
    for (size_t i = 0; i < patches.size(); ++i) {
        orderPatch(*patches[i], order);
        writeTriangles(order, columns);
        writeVertices(header, header.patches[i], *patches[i], order, columns);
    }
    StreamPacker packer;
    std::vector<uint8_t> planes;
    for (const std::vector<uint32_t>& column : columns) packColumn(column, packer, planes);
    writer.raw(planes.data(), planes.size());
    packer.write(writer);
}

bool decodePlain(const PageHeader& header, ByteReader& reader, std::vector<Mesh>& patches,
                 std::string& fault) {
    const size_t columns = columnCount(header);
    const std::span<const std::byte> plane_bytes = reader.take(columns);
    std::vector<uint8_t> planes;
    for (const std::byte b : plane_bytes) planes.push_back(uint8_t(b));
    size_t streams = 0;
    for (const uint8_t count : planes) streams += count;
    if (!reader.ok() || std::ranges::any_of(planes, [](uint8_t count) { return count > 4; })) {
        fault = "its columns are damaged";
        return false;
    }
    const uint64_t vertices = header.vertexCount(), triangles = header.triangleCount();
    uint64_t total = 0;
    for (size_t c = 0; c < columns; ++c)
        total += planes[c] * (isTriangleColumn(c) ? triangles : vertices);
    StreamUnpacker unpacked;
    if (!unpacked.read(reader, streams, std::max(vertices, triangles), total, fault)) return false;
    size_t stream = 0;
    for (size_t c = 0; c < columns; ++c)
        for (int k = 0; k < planes[c]; ++k)
            if (unpacked[stream++].size() != (isTriangleColumn(c) ? triangles : vertices)) {
                fault = "a column has the wrong length";
                return false;
            }
    PlainReader plain(header, unpacked, planes);
    for (size_t i = 0; i < patches.size(); ++i)
        if (!plain.readPatch(header.patches[i], patches[i])) {
            fault = fmt::format("patch {} holds impossible numbers", i);
            return false;
        }
    return true;
}

}  // namespace pietra
