#include "audit/patch_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <numeric>
#include <vector>

namespace pietra {

namespace {

bool isWellFormed(const Mesh& mesh, const AttributeSchema& schema) {
    const size_t n = mesh.vertexCount();
    if (mesh.edge_class.size() != mesh.triangleCount() || mesh.normal.size() != n) return false;
    if (mesh.colour.size() != (schema.colours ? n : 0)) return false;
    if (mesh.scalar.size() != n * schema.scalars.size()) return false;
    for (const uint8_t bits : mesh.edge_class)
        if (bits >> 6 != 0) return false;
    for (const Triangle& t : mesh.triangle)
        for (const uint32_t v : t)
            if (v >= n) return false;
    return true;
}

bool isOnLattice(const Mesh& mesh, const Lattice& lattice) {
    const int32_t off_grid = (1 << lattice.shift) - 1;
    for (const Vec3i& p : mesh.position)
        for (int axis = 0; axis < 3; ++axis)
            if (p[axis] < 0 || p[axis] > kLatticeMax || (p[axis] & off_grid) != 0) return false;
    return true;
}

bool isWithin(const Mesh& mesh, const Sphere& bounds) {
    for (const Vec3i& p : mesh.position)
        if (!(glm::length(Vec3d(p) - Vec3d(bounds.centre)) <= double(bounds.radius) * (1 + 1e-9)))
            return false;
    return true;
}

bool isWithin(const Mesh& mesh, const NormalCone& cone) {
    if (cone.cos_angle <= -1) return true;
    for (const Triangle& t : mesh.triangle) {
        const Vec3d a(mesh.position[t[0]]), b(mesh.position[t[1]]), c(mesh.position[t[2]]);
        const Vec3d normal = glm::cross(b - a, c - a);
        const double length = glm::length(normal);
        // Culling leaves room for errors of 1e-6 (View::facesAway).
        if (glm::dot(normal, Vec3d(cone.axis)) < (double(cone.cos_angle) - 1e-6) * length)
            return false;
    }
    return true;
}

/// Every edge is an ordinary one, and no two triangles run along it in the same direction.
bool mayBeClosed(const Mesh& mesh) {
    std::vector<uint64_t> directed;
    directed.reserve(3 * mesh.triangleCount());
    for (size_t t = 0; t < mesh.triangleCount(); ++t) {
        if (mesh.edge_class[t] != 0) return false;
        const Triangle& f = mesh.triangle[t];
        for (size_t k = 0; k < 3; ++k) directed.push_back(uint64_t(f[k]) << 32 | f[(k + 1) % 3]);
    }
    std::sort(directed.begin(), directed.end());
    return std::adjacent_find(directed.begin(), directed.end()) == directed.end();
}

/// Gathers what the threads find.
class Findings {
public:
    void fault(NodeIndex node, uint64_t PatchReport::*counter, const char* what) {
        const std::lock_guard lock(mutex_);
        ++(report_.*counter);
        if (!report_.first_fault.empty() && first_ <= node) return;
        first_ = node;
        report_.first_fault = fmt::format("node {}: {}", node, what);
    }

    void count(uint64_t triangles) {
        const std::lock_guard lock(mutex_);
        ++report_.patches;
        report_.triangles += triangles;
    }

    PatchReport report() { return report_; }

private:
    std::mutex mutex_;
    NodeIndex first_ = 0;
    PatchReport report_;
};

void checkPatch(NodeIndex i, const Node& node, const Mesh& mesh, const Lattice& lattice,
                const AttributeSchema& schema, Findings& findings) {
    findings.count(mesh.triangleCount());
    if (!isWellFormed(mesh, schema)) {
        findings.fault(i, &PatchReport::malformed, "its patch is malformed");
        return;
    }
    if (mesh.triangleCount() != node.triangles || mesh.vertexCount() != node.vertices)
        findings.fault(i, &PatchReport::wrong_counts, "its patch has other counts than it states");
    if (!isOnLattice(mesh, lattice))
        findings.fault(i, &PatchReport::outside_lattice, "a vertex is not on the lattice");
    if (!isWithin(mesh, node.bounds))
        findings.fault(i, &PatchReport::outside_bounds, "a vertex lies outside its bounds");
    if (!isWithin(mesh, node.cone))
        findings.fault(i, &PatchReport::outside_cone, "a normal lies outside its cone");
    if (node.closed && !mayBeClosed(mesh))
        findings.fault(i, &PatchReport::falsely_closed,
                       "it says closed, but has a border, a fold, or a triangle turned over");
}

}  // namespace

PatchReport checkPatches(std::span<const Node> nodes, const Lattice& lattice,
                         const AttributeSchema& schema, const PatchStream& stream) {
    std::vector<NodeIndex> all(nodes.size());
    std::iota(all.begin(), all.end(), NodeIndex(0));
    Findings findings;
    stream(all, [&](NodeIndex i, const Mesh& mesh) {
        checkPatch(i, nodes[i], mesh, lattice, schema, findings);
    });
    return findings.report();
}

}  // namespace pietra
