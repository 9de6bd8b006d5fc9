#pragma once
// What the tests of this folder share: patches in memory as a stream, and as an input.

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "audit/conformance_inputs.h"
#include "audit/patch_stream.h"
#include "base/hash.h"
#include "base/parallel.h"
#include "geometry/lattice.h"
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
inline MemorySource sourceOf(const ToyTerrain& model, const Lattice& lattice, double jitter) {
    MemorySource source;
    for (const NodeIndex i : finestCut(model.nodes).nodes) {
        const Mesh& mesh = model.patches[i];
        const uint64_t base = source.vertices.position.size();
        for (const Vec3i& p : mesh.position) {
            // The same for all that are at this point.
            const uint64_t bits = mixBits(latticeKey(p));
            const Vec3d offset(double(bits & 1023) / 1023 - 0.5,
                               double(bits >> 10 & 1023) / 1023 - 0.5,
                               double(bits >> 20 & 1023) / 1023 - 0.5);
            source.vertices.position.push_back(lattice.toInput(Vec3d(p) + offset * jitter));
        }
        for (const Triangle& t : mesh.triangle)
            source.triangles.push_back({base + t[0], base + t[1], base + t[2]});
    }
    return source;
}

}  // namespace pietra
