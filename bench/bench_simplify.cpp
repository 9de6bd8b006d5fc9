// The simplifier against meshoptimizer's, in turn, on the same pieces of a scan.
//
//   bench_simplify SCAN.obj [PIECE_TRIANGLES=6500] [RATIO=0.5] [SUBDIVISIONS=2] [NOISE=0.05]
//   [COLOURS=0]
//
// The scan is welded, subdivided with noise and cut into pieces by a k-d tree. Both simplify every
// piece with its border locked. Printed: millions of input triangles a second of processor
// time (median of the rounds), and how far the input's vertices are from the result, in mean edges
// of the input.

#include <meshoptimizer.h>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <numeric>

#include "clock.h"
#include "simplify/simplify.h"
#include "simplify/test_meshes.h"

namespace {

using namespace pietra;

struct Piece {
    Mesh mesh;
    std::vector<uint8_t> cell;
    std::vector<uint32_t> quota;
};

/// Halves [begin, end) of `order` at the median of the longest axis until small enough.
void cut(const Mesh& mesh, std::vector<uint32_t>& order, size_t begin, size_t end, size_t limit,
         std::vector<std::pair<size_t, size_t>>& pieces) {
    if (end - begin <= limit) {
        pieces.push_back({begin, end});
        return;
    }
    const auto centroid = [&](uint32_t t) {
        const Triangle& c = mesh.triangle[t];
        return mesh.position[c[0]] + mesh.position[c[1]] + mesh.position[c[2]];
    };
    Vec3i low = centroid(order[begin]), high = low;
    for (size_t i = begin; i < end; ++i) {
        low = glm::min(low, centroid(order[i]));
        high = glm::max(high, centroid(order[i]));
    }
    const Vec3i size = high - low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const size_t middle = (begin + end) / 2;
    std::nth_element(order.begin() + ptrdiff_t(begin), order.begin() + ptrdiff_t(middle),
                     order.begin() + ptrdiff_t(end), [&](uint32_t a, uint32_t b) {
                         return std::pair(centroid(a)[axis], a) < std::pair(centroid(b)[axis], b);
                     });
    cut(mesh, order, begin, middle, limit, pieces);
    cut(mesh, order, middle, end, limit, pieces);
}

std::vector<Piece> makePieces(const Mesh& mesh, size_t limit, double ratio) {
    std::vector<uint32_t> order(mesh.triangleCount());
    std::iota(order.begin(), order.end(), 0u);
    std::vector<std::pair<size_t, size_t>> ranges;
    cut(mesh, order, 0, order.size(), limit, ranges);
    std::vector<Piece> pieces;
    std::vector<uint32_t> remap(mesh.vertexCount(), kNone);
    for (const auto& [begin, end] : ranges) {
        std::sort(order.begin() + ptrdiff_t(begin), order.begin() + ptrdiff_t(end));
        Piece piece;
        for (size_t i = begin; i < end; ++i) {
            Triangle t;
            for (int k = 0; k < 3; ++k) {
                const uint32_t v = mesh.triangle[order[i]][k];
                if (remap[v] == kNone) {
                    remap[v] = uint32_t(piece.mesh.position.size());
                    piece.mesh.position.push_back(mesh.position[v]);
                    piece.mesh.normal.push_back(mesh.normal[v]);
                    if (!mesh.colour.empty()) piece.mesh.colour.push_back(mesh.colour[v]);
                }
                t[k] = remap[v];
            }
            piece.mesh.triangle.push_back(t);
            piece.mesh.edge_class.push_back(mesh.edge_class[order[i]]);
        }
        for (size_t i = begin; i < end; ++i)
            for (const uint32_t v : mesh.triangle[order[i]]) remap[v] = kNone;
        piece.cell.assign(end - begin, 0);
        piece.quota = {uint32_t(double(end - begin) * ratio)};
        pieces.push_back(std::move(piece));
    }
    return pieces;
}

double squaredDistance(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const auto toSegment = [&](const Vec3d& s, const Vec3d& e) {
        const double t = std::clamp(glm::dot(p - s, e - s) / glm::dot(e - s, e - s), 0.0, 1.0);
        const Vec3d d = p - (s + t * (e - s));
        return glm::dot(d, d);
    };
    const Vec3d n = glm::cross(b - a, c - a);
    const bool inside = glm::dot(glm::cross(b - a, p - a), n) >= 0 &&
                        glm::dot(glm::cross(c - b, p - b), n) >= 0 &&
                        glm::dot(glm::cross(a - c, p - c), n) >= 0;
    if (inside && glm::dot(n, n) > 0) {
        const double h = glm::dot(p - a, n);
        return h * h / glm::dot(n, n);
    }
    return std::min(toSegment(a, b), std::min(toSegment(b, c), toSegment(c, a)));
}

/// Squared distances of the input's vertices to the result. Triangles are tried outward from the
/// vertex along x until none further out can be nearer.
struct Quality {
    double sum_sq = 0, max_sq = 0, edge_sum = 0;
    size_t vertices = 0, edges = 0;

    struct Item {
        double x;  // of the middle of its box
        Vec3d a, b, c;
    };

    void add(const Mesh& mesh, const std::vector<Vec3i>& position,
             const std::vector<Triangle>& triangle) {
        for (const Triangle& t : mesh.triangle)
            for (int k = 0; k < 3; ++k, ++edges)
                edge_sum += glm::length(Vec3d(mesh.position[t[k]] - mesh.position[t[(k + 1) % 3]]));
        std::vector<Item> items;
        double half_width = 0;
        for (const Triangle& t : triangle) {
            const Vec3d a(position[t[0]]), b(position[t[1]]), c(position[t[2]]);
            const double low = std::min(a.x, std::min(b.x, c.x));
            const double high = std::max(a.x, std::max(b.x, c.x));
            items.push_back({(low + high) / 2, a, b, c});
            half_width = std::max(half_width, (high - low) / 2);
        }
        const auto byX = [](const Item& a, const Item& b) { return a.x < b.x; };
        std::sort(items.begin(), items.end(), byX);
        for (const Vec3i& point : mesh.position) {
            const Vec3d p(point);
            double best = 1e300;
            const auto tryItem = [&](const Item& i) {
                const double gap = std::abs(i.x - p.x) - half_width;
                if (gap > 0 && gap * gap > best) return false;
                best = std::min(best, squaredDistance(p, i.a, i.b, i.c));
                return true;
            };
            const auto middle =
                std::lower_bound(items.begin(), items.end(), Item{p.x, p, p, p}, byX);
            for (auto i = middle; i != items.end() && tryItem(*i);) ++i;
            for (auto i = middle; i != items.begin() && tryItem(*(i - 1));) --i;
            sum_sq += best;
            max_sq = std::max(max_sq, best);
            ++vertices;
        }
    }

    void print(const char* name) const {
        const double edge = edge_sum / double(edges);
        std::printf("%-14s rms %.4f  max %.4f mean edges\n", name,
                    std::sqrt(sum_sq / double(vertices)) / edge, std::sqrt(max_sq) / edge);
    }
};

struct Rival {
    std::vector<std::vector<unsigned>> indices;
    std::vector<std::vector<float>> positions;

    explicit Rival(const std::vector<Piece>& pieces) {
        for (const Piece& p : pieces) {
            std::vector<float> xyz;
            for (const Vec3i& v : p.mesh.position)
                xyz.insert(xyz.end(), {float(v.x), float(v.y), float(v.z)});
            positions.push_back(std::move(xyz));
            std::vector<unsigned> index;
            for (const Triangle& t : p.mesh.triangle) index.insert(index.end(), t.begin(), t.end());
            indices.push_back(std::move(index));
        }
    }

    void run(size_t i, size_t target, std::vector<unsigned>& out) const {
        out.resize(indices[i].size());
        out.resize(meshopt_simplify(out.data(), indices[i].data(), indices[i].size(),
                                    positions[i].data(), positions[i].size() / 3, 12, target * 3,
                                    1e10f, meshopt_SimplifyLockBorder, nullptr));
    }
};

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2) {
        std::fprintf(
            stderr,
            "usage: bench_simplify SCAN.obj [PIECE] [RATIO] [SUBDIVISIONS] [NOISE] [COLOURS]\n");
        return 2;
    }
    const size_t piece_triangles = argc > 2 ? size_t(std::atol(argv[2])) : 6500;
    const double ratio = argc > 3 ? std::atof(argv[3]) : 0.5;
    const int subdivisions = argc > 4 ? std::atoi(argv[4]) : 2;
    const double noise = argc > 5 ? std::atof(argv[5]) : 0.05;
    const bool coloured = argc > 6 && std::atoi(argv[6]) != 0;

    constexpr int32_t kExtent = (1 << 21) - 5000;
    test::Shape shape = test::shapeOf(test::toLattice(test::readObj(argv[1]), kExtent));
    for (int i = 0; i < subdivisions; ++i) shape = test::subdivide(shape, noise, unsigned(i));
    Mesh mesh = test::toLattice(shape, kExtent);
    for (size_t v = 0; coloured && v < mesh.vertexCount(); ++v) {
        const Vec3i p = mesh.position[v] / 1000;
        mesh.colour.push_back({uint8_t(p.x), uint8_t(p.y / 4), uint8_t(p.z * 7), 255});
    }
    const std::vector<Piece> pieces = makePieces(mesh, piece_triangles, ratio);
    const Rival rival(pieces);
    std::printf("%zu triangles in %zu pieces\n", mesh.triangleCount(), pieces.size());

    Simplifier simplifier;
    SimplifyOutput out;
    std::vector<unsigned> rival_out;
    std::vector<double> ours, theirs;
    size_t left = 0, rival_left = 0, collapses = 0;
    for (int round = 0; round < 7; ++round) {
        left = rival_left = collapses = 0;
        double begin = threadSeconds();
        for (const Piece& p : pieces) {
            SimplifyInput in;
            in.mesh = &p.mesh;
            in.cell = p.cell;
            in.quota = p.quota;
            simplifier.run(in, out);
            left += out.mesh.triangleCount();
            collapses += out.collapses;
        }
        ours.push_back(double(mesh.triangleCount()) / (threadSeconds() - begin) * 1e-6);
        begin = threadSeconds();
        for (size_t i = 0; i < pieces.size() && round < 3; ++i) {
            rival.run(i, pieces[i].quota[0], rival_out);
            rival_left += rival_out.size() / 3;
        }
        if (round < 3)
            theirs.push_back(double(mesh.triangleCount()) / (threadSeconds() - begin) * 1e-6);
    }
    std::printf("pietra         %.2f M/s (best %.2f), %zu triangles left, %zu collapses\n",
                median(ours), *std::max_element(ours.begin(), ours.end()), left, collapses);
    std::printf("meshoptimizer  %.2f M/s (best %.2f)\n", median(theirs),
                *std::max_element(theirs.begin(), theirs.end()));

    Quality quality, rival_quality;
    const size_t stride = std::max<size_t>(1, pieces.size() * piece_triangles / 200000);
    for (size_t i = 0; i < pieces.size(); i += stride) {
        const Mesh& m = pieces[i].mesh;
        SimplifyInput in;
        in.mesh = &m;
        in.cell = pieces[i].cell;
        in.quota = pieces[i].quota;
        simplifier.run(in, out);
        quality.add(m, out.mesh.position, out.mesh.triangle);
        rival.run(i, pieces[i].quota[0], rival_out);
        std::vector<Triangle> t(rival_out.size() / 3);
        for (size_t k = 0; k < rival_out.size(); ++k) t[k / 3][k % 3] = rival_out[k];
        rival_quality.add(m, m.position, t);
    }
    if (quality.vertices > 0) {
        quality.print("pietra");
        rival_quality.print("meshoptimizer");
    }
    return 0;
}
