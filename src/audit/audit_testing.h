#pragma once
// What the tests of this folder share: patches in memory as a stream, and as an input.

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "audit/patch_stream.h"
#include "base/hash.h"
#include "base/parallel.h"
#include "geometry/lattice.h"
#include "io/triangle_source.h"
#include "multires/cut.h"
#include "multires/toy_terrain.h"

namespace pietra {

inline std::string tempDir() {
    return std::filesystem::temp_directory_path().string();
}

/// In an order that depends on `seed`, by several threads.
inline PatchStream streamOf(const std::vector<Mesh>& patches, uint64_t seed = 0) {
    return [&patches, seed](std::span<const NodeIndex> nodes, const PatchVisitor& visit) {
        std::vector<NodeIndex> order(nodes.begin(), nodes.end());
        std::sort(order.begin(), order.end(), [&](NodeIndex a, NodeIndex b) {
            return seed == 0 ? a < b : mixBits(seed + a) < mixBits(seed + b);
        });
        parallelFor(order.size(), [&](size_t k) { visit(order[k], patches[order[k]]); });
    };
}

/// The finest cut as an input: a soup of patches, every vertex moved by up to jitter/2 lattice
/// units an axis.
class MemorySource : public TriangleSource {
public:
    MemorySource(const ToyTerrain& model, const Lattice& lattice, double jitter) {
        for (const NodeIndex i : finestCut(model.nodes).nodes) {
            const Mesh& mesh = model.patches[i];
            const uint64_t base = position_.size();
            for (const Vec3i& p : mesh.position) {
                // The same for all that are at this point.
                const uint64_t bits = mixBits(latticeKey(p));
                const Vec3d offset(double(bits & 1023) / 1023 - 0.5,
                                   double(bits >> 10 & 1023) / 1023 - 0.5,
                                   double(bits >> 20 & 1023) / 1023 - 0.5);
                position_.push_back(lattice.toInput(Vec3d(p) + offset * jitter));
            }
            for (const Triangle& t : mesh.triangle)
                triangle_.push_back({base + t[0], base + t[1], base + t[2]});
        }
    }
    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() override { return position_.size(); }
    uint64_t triangleCountHint() override { return triangle_.size(); }
    uint64_t inputBytes() const override { return 0; }
    bool cheapToReread() const override { return true; }
    std::vector<std::string> notes() const override { return {}; }
    void rewindVertices() override { next_vertex_ = 0; }
    bool readVertices(VertexBatch& batch) override {
        const size_t count = std::min<size_t>(1000, position_.size() - next_vertex_);
        batch.first = next_vertex_;
        batch.position.assign(position_.begin() + ptrdiff_t(next_vertex_),
                              position_.begin() + ptrdiff_t(next_vertex_ + count));
        next_vertex_ += count;
        return count > 0;
    }
    void rewindTriangles() override { next_triangle_ = 0; }
    bool readTriangles(TriangleBatch& batch) override {
        const size_t count = std::min<size_t>(5000, triangle_.size() - next_triangle_);
        batch.first = next_triangle_;
        batch.triangle.assign(triangle_.begin() + ptrdiff_t(next_triangle_),
                              triangle_.begin() + ptrdiff_t(next_triangle_ + count));
        next_triangle_ += count;
        return count > 0;
    }
    void shuffleTriangles() {
        std::sort(triangle_.begin(), triangle_.end(), [](const auto& a, const auto& b) {
            return mixBits(a[0] * 7 + a[1]) < mixBits(b[0] * 7 + b[1]);
        });
    }

    std::vector<Vec3d> position_;
    std::vector<std::array<uint64_t, 3>> triangle_;

private:
    AttributeSchema schema_;
    size_t next_vertex_ = 0, next_triangle_ = 0;
};

}  // namespace pietra
