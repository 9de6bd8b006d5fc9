#include "coarsen/diamond.h"

#include <algorithm>

#include "base/check.h"

namespace pietra {

namespace {

constexpr uint32_t kNoVertex = ~0u;
// Diamonds of the top levels are few: there, halving to the end costs nothing and makes small
// roots.
constexpr int kTopLevels = 6;
constexpr uint32_t kSmallTopPatch = 250;
constexpr uint32_t kCrumbTriangles = 32;  // fewer join another cell of the diamond

}  // namespace

uint32_t cellQuota(uint64_t children_triangles, uint32_t patch_triangles, int level) {
    const uint64_t half = (children_triangles + 1) / 2;
    const uint64_t wanted =
        level < kTopLevels ? std::min(kSmallTopPatch, patch_triangles / 2) : patch_triangles / 2;
    uint64_t quota = std::max(half, std::min(children_triangles * 63 / 100, wanted));
    // The roots, six at most, are what is resident always and drawn first.
    if (level == 0) quota = std::min<uint64_t>(quota, patch_triangles / 4);
    return uint32_t(std::max(quota, std::min<uint64_t>(children_triangles, kSmallestPatch)));
}

void DiamondWorker::addCell(const CellMesh& child, uint8_t label) {
    const Mesh& mesh = child.mesh;
    Mesh& merged = merged_.mesh;
    local_.resize(mesh.vertexCount());
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v) local_[v] = joiner_.addVertex(mesh, v);
    for (const Triangle& t : mesh.triangle)
        merged.triangle.push_back({local_[t[0]], local_[t[1]], local_[t[2]]});
    const auto append = [](auto& to, const auto& from) {
        to.insert(to.end(), from.begin(), from.end());
    };
    append(merged.edge_class, mesh.edge_class);
    append(merged_.bounds.to_original, child.bounds.to_original);
    append(merged_.bounds.from_original, child.bounds.from_original);
    label_.resize(merged.triangleCount(), label);
    closed_[label] &= child.closed;
}

void DiamondWorker::merge(const DiamondInput& input) {
    merged_.mesh.clear();
    merged_.bounds.to_original.clear();
    merged_.bounds.from_original.clear();
    label_.clear();
    closed_.assign(input.children.size(), 1);
    size_t triangles = 0;
    for (const std::vector<CellBlob>& blobs : input.children)
        for (const CellBlob& blob : blobs) triangles += blob.triangles;
    joiner_.begin(merged_.mesh, triangles * 3 / 4);
    for (size_t c = 0; c < input.children.size(); ++c)
        for (const CellBlob& blob : input.children[c]) {
            blob.store->get(blob, child_);
            addCell(child_, uint8_t(c));
        }
}

void DiamondWorker::run(const DiamondInput& input, DiamondOutput& output) {
    merge(input);
    output.input_triangles = merged_.mesh.triangleCount();
    if (merged_.mesh.triangle.empty()) {  // its children kept nothing of what they had to show
        output = DiamondOutput{};
        output.cells.resize(input.children.size());
        for (size_t c = 0; c < output.cells.size(); ++c) output.cells[c].closed = closed_[c];
        output.error = input.child_error;
        return;
    }
    SimplifyInput simplify;
    simplify.mesh = &merged_.mesh;
    simplify.cell = label_;
    simplify.quota = input.quota;
    simplify.shift = shift_;
    simplify.scalar_count = int(scalar_range_.size());
    simplify.scalar_range = scalar_range_;
    simplify.free_error = input.child_error;
    simplifier_.run(simplify, simplified_);
    moveCrumbs(input.children.size());

    DeviationInput deviation;
    deviation.before = &merged_.mesh;
    deviation.before_bounds = &merged_.bounds;
    deviation.after = &simplified_.mesh;
    deviation.vertex_map = simplified_.vertex_map;
    deviation.triangle_map = simplified_.triangle_map;
    deviation.triangle_changed = simplified_.triangle_changed;
    deviation.child_error = input.child_error;
    output.error = deviation_.run(deviation, bounds_);

    takeApart(input.children.size(), output);
    output.output_triangles = simplified_.mesh.triangleCount();
    output.locked_vertices = simplified_.locked_vertices;
    output.clustered = simplified_.clustered;
}

// A cell of a few triangles joins a larger one, for the diamonds above it as in crumbs.h.
void DiamondWorker::moveCrumbs(size_t cells) {
    std::vector<uint8_t>& cell = simplified_.cell;
    std::vector<uint32_t> count(cells, 0);
    for (const uint8_t c : cell) ++count[c];
    const auto isCrumb = [&](uint32_t c) { return count[c] < kCrumbTriangles; };
    const auto crumbs = std::count_if(cell.begin(), cell.end(), isCrumb);
    if (crumbs == 0 || size_t(crumbs) == cell.size()) return;
    spread_.clear();
    for (size_t t = 0; t < cell.size(); ++t)
        if (isCrumb(cell[t])) spread_.add(simplified_.mesh.triangle[t]);
    for (size_t t = 0; t < cell.size(); ++t) {
        const Triangle& v = simplified_.mesh.triangle[t];
        if (isCrumb(cell[t])) continue;
        for (size_t k = 0; k < 3; ++k) spread_.claim(v[k], v[(k + 1) % 3], cell[t]);
    }
    spread_.run();
    size_t next = 0;
    for (uint8_t& c : cell) {
        if (!isCrumb(c)) continue;
        const uint32_t owner = spread_.owner(next++);
        if (owner == EdgeSpread::kNobody) continue;
        closed_[owner] &= closed_[c];
        c = uint8_t(owner);
    }
}

void DiamondWorker::takeApart(size_t cells, DiamondOutput& output) {
    const Mesh& mesh = simplified_.mesh;
    output.cells.resize(cells);
    for (size_t c = 0; c < cells; ++c) {
        CellMesh& cell = output.cells[c];
        cell.mesh.clear();
        cell.bounds.to_original.clear();
        cell.bounds.from_original.clear();
        // Collapses keep components apart. Clustering does not.
        cell.closed = closed_[c] && simplified_.clustered == 0;
        local_.assign(mesh.vertexCount(), kNoVertex);
        for (size_t t = 0; t < mesh.triangleCount(); ++t) {
            if (simplified_.cell[t] != c) continue;
            Triangle triangle;
            for (size_t k = 0; k < 3; ++k) {
                uint32_t& v = local_[mesh.triangle[t][k]];
                if (v == kNoVertex) {
                    v = uint32_t(cell.mesh.vertexCount());
                    copyVertex(mesh, mesh.triangle[t][k], cell.mesh);
                }
                triangle[k] = v;
            }
            cell.mesh.triangle.push_back(triangle);
            cell.mesh.edge_class.push_back(mesh.edge_class[t]);
            cell.bounds.to_original.push_back(bounds_.to_original[t]);
            cell.bounds.from_original.push_back(bounds_.from_original[t]);
        }
    }
}

}  // namespace pietra
