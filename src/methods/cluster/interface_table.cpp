#include "methods/cluster/interface_table.h"

#include <algorithm>

#include "base/check.h"
#include "base/parallel.h"
#include "methods/cluster/interfaces.h"

namespace pietra::cluster {

namespace {

void sortUnique(std::vector<uint64_t>& values) {
    parallelSort(values);
    values.erase(std::unique(values.begin(), values.end()), values.end());
}

/// The positions of a leaf's vertices.
class LeafVertices {
public:
    const std::vector<Vec3i>& read(const CellBlob& blob) {
        blob.store->get(blob, cell_);
        return cell_.mesh.position;
    }

private:
    CellMesh cell_;
};

}  // namespace

InterfaceTable::InterfaceTable(const Octree& octree, const Leaves& leaves, Budget& budget,
                               Progress& progress)
    : octree_(octree) {
    const std::vector<CellId>& order = octree.leaves();
    PerThread<LeafVertices> reader;
    std::mutex mutex;
    // Whatever a leaf uses beyond its own cube.
    parallelFor(order.size(), [&](size_t i) {
        std::vector<uint64_t> beyond;
        for (const Vec3i& p : reader.local().read(leaves.blobs.at(order[i]))) {
            const uint64_t code = mortonCode(p);
            if (cellAt(cubePathOf(code), cellLevel(order[i])) != order[i]) beyond.push_back(code);
        }
        progress.tick(0);
        const std::lock_guard lock(mutex);
        code_.insert(code_.end(), beyond.begin(), beyond.end());
    });
    // A use of a vertex: more than what remains of it here, for what layers list of them.
    memory_ = budget.reserve(32 * code_.size(), "the interfaces of the octree's cells");
    sortUnique(code_);
    code_.shrink_to_fit();
    // Who uses these.
    std::vector<std::array<uint32_t, 2>> uses;
    parallelFor(order.size(), [&](size_t i) {
        std::vector<std::array<uint32_t, 2>> own;
        for (const Vec3i& p : reader.local().read(leaves.blobs.at(order[i])))
            if (const uint32_t v = find(p); v != kNone) own.push_back({v, uint32_t(i)});
        progress.tick(0);
        const std::lock_guard lock(mutex);
        uses.insert(uses.end(), own.begin(), own.end());
    });
    parallelSort(uses);
    use_begin_.assign(code_.size() + 1, 0);
    leaf_.reserve(uses.size());
    for (const auto& [v, leaf] : uses) {
        ++use_begin_[v + 1];
        leaf_.push_back(leaf);
    }
    for (size_t v = 0; v < code_.size(); ++v) use_begin_[v + 1] += use_begin_[v];
}

uint32_t InterfaceTable::find(const Vec3i& p) const {
    const uint64_t code = mortonCode(p);
    const auto at = std::lower_bound(code_.begin(), code_.end(), code);
    return at != code_.end() && *at == code ? uint32_t(at - code_.begin()) : kNone;
}

Vec3i InterfaceTable::positionOf(uint32_t vertex) const {
    return mortonPoint(code_[vertex]);
}

CellsAt InterfaceTable::cellsAt(uint32_t vertex, int layer) const {
    CellsAt at;
    for (uint32_t i = use_begin_[vertex]; i < use_begin_[vertex + 1] && at.count < 3; ++i) {
        const CellId cell = octree_.cellIn(octree_.leaves()[leaf_[i]], layer);
        if (at.count > 0 && cell == at.cell[0]) continue;
        if (at.count > 1 && cell == at.cell[1]) continue;
        if (at.count < 2) at.cell[at.count] = cell;
        ++at.count;
    }
    if (at.count == 2 && at.cell[1] < at.cell[0]) std::swap(at.cell[0], at.cell[1]);
    return at;
}

Removals::Removals(const InterfaceTable& table, int layer, Budget& budget)
    : table_(table),
      layer_(layer),
      memory_(budget.reserve(20 * table.size(), "the interfaces of a layer")),
      outline_(table.size()),
      may_leave_(table.size(), {0, 0}),
      pinned_(table.size(), 0),
      removed_(table.size(), 0) {}

void Removals::report(CellId cell, const PolygonMesh& polygons,
                      std::span<const std::array<uint32_t, 2>> joined) {
    const Corners corners(polygons);
    std::vector<uint32_t> number(polygons.vertexCount(), kNone);
    std::vector<uint8_t> side(polygons.vertexCount(), 2), leaves(polygons.vertexCount(), 0);
    std::vector<Candidate> own;  // by vertex of the cell
    for (uint32_t v = 0; v < polygons.vertexCount(); ++v) {
        if (!polygons.interface_[v]) continue;
        number[v] = table_.find(polygons.position[v]);
        CHECK_NE(number[v], kNone);
        const CellsAt at = table_.cellsAt(number[v], layer_);
        if (at.count == 2 && !polygons.irregular[v]) side[v] = uint8_t(at.cell[1] == cell);
    }
    const auto isOutline = [&](uint32_t h) {
        return polygons.twin[h] == kNone && polygons.edge_class[h] == EdgeClass::kManifold &&
               polygons.interface_[polygons.corner[h]] && polygons.interface_[polygons.end(h)];
    };
    for (uint32_t v = 0; v < polygons.vertexCount(); ++v) {
        if (side[v] == 2) continue;
        // One fan, from the one outline's half-edge that begins here to the one that ends here.
        const std::span<const uint32_t> fan = corners.at(v);
        const auto first = std::find_if(fan.begin(), fan.end(),
                                        [&](uint32_t h) { return polygons.twin[h] == kNone; });
        if (first == fan.end() || !isOutline(*first)) continue;
        uint32_t h = *first;
        size_t passed = 1;
        for (; polygons.twin[polygons.previous(h)] != kNone && passed < fan.size(); ++passed)
            h = polygons.twin[polygons.previous(h)];
        const uint32_t last = polygons.previous(h);
        if (passed != fan.size() || !isOutline(last)) continue;
        const Outline outline{number[polygons.corner[last]], number[polygons.end(*first)]};
        outline_[number[v]][side[v]] = outline;
        const std::array pair = {std::min(outline.before, outline.after),
                                 std::max(outline.before, outline.after)};
        if (pair[0] != pair[1] && fanMayMerge(polygons, fan) &&
            !std::binary_search(joined.begin(), joined.end(), pair))
            own.push_back({costOf(number[v], outline), v});
    }
    std::sort(own.begin(), own.end(), [&](const Candidate& a, const Candidate& b) {
        return std::pair(a.cost, number[a.vertex]) < std::pair(b.cost, number[b.vertex]);
    });
    own.resize(own.size() - own.size() / kKeptPart);
    for (const Candidate& c : own)
        leaves[c.vertex] = may_leave_[number[c.vertex]][side[c.vertex]] = 1;
    // A face may lose several corners: as no two are neighbours, and not both neighbours of one
    // are pinned, three stay. Where faces merge around one, nothing else leaves them. Neighbours,
    // which most of these are, choose() knows.
    const auto areNeighbours = [&](uint32_t p, uint32_t q) {
        const Outline& outline = outline_[number[p]][side[p]];
        return number[q] == outline.before || number[q] == outline.after;
    };
    std::vector<std::array<uint32_t, 2>> conflicts;
    std::vector<uint32_t> at_face;
    for (uint32_t f = 0; f < polygons.faceCount(); ++f) {
        at_face.clear();
        for (uint32_t h = polygons.face_begin[f]; h < polygons.face_begin[f + 1]; ++h)
            if (leaves[polygons.corner[h]]) at_face.push_back(polygons.corner[h]);
        for (const uint32_t p : at_face)
            for (const uint32_t q : at_face)
                if (p != q && !areNeighbours(p, q) &&
                    (corners.at(p).size() > 1 || corners.at(q).size() > 1))
                    conflicts.push_back({number[p], number[q]});
    }
    const std::lock_guard lock(mutex_);
    conflicts_.insert(conflicts_.end(), conflicts.begin(), conflicts.end());
}

/// Squared deviation of the outline.
double Removals::costOf(uint32_t v, const Outline& outline) const {
    const Vec3d a(table_.positionOf(outline.before)), b(table_.positionOf(outline.after));
    const Vec3d across = glm::cross(b - a, Vec3d(table_.positionOf(v)) - a);
    return glm::dot(across, across) / glm::dot(b - a, b - a);
}

/// Both cells have the same outline here.
bool Removals::isRegular(uint32_t v) const {
    const auto& [first, second] = outline_[v];
    return first.before != kNone && first.before == second.after && first.after == second.before;
}

/// Interfaces that are closed, but for one pinned vertex at most, keep three.
void Removals::pinLoops() {
    std::vector<uint8_t> seen(pinned_);
    // Open chains first: what is left then are closed ones.
    for (const bool closed : {false, true})
        for (uint32_t v = 0; v < seen.size(); ++v) {
            if (seen[v] || (!closed && !pinned_[outline_[v][0].before])) continue;
            std::vector<uint32_t> chain;
            uint32_t at = v;
            for (; !seen[at]; at = outline_[at][0].after) {
                seen[at] = 1;
                chain.push_back(at);
            }
            if (closed) pinned_[v] = 1;
            if (closed || outline_[v][0].before == at)
                pinned_[chain[chain.size() / 3]] = pinned_[chain[2 * chain.size() / 3]] = 1;
        }
}

std::vector<Removals::Candidate> Removals::candidates() const {
    std::vector<Candidate> order;
    for (uint32_t v = 0; v < pinned_.size(); ++v) {
        if (pinned_[v] || !may_leave_[v][0] || !may_leave_[v][1]) continue;
        const Outline& outline = outline_[v][0];
        if (pinned_[outline.before] && pinned_[outline.after]) continue;
        order.push_back({costOf(v, outline), v});
    }
    parallelSort(order);
    return order;
}

void Removals::choose() {
    for (uint32_t v = 0; v < pinned_.size(); ++v) pinned_[v] = !isRegular(v);
    pinLoops();
    parallelSort(conflicts_);
    std::vector<uint8_t> blocked(pinned_.size(), 0);
    for (const Candidate& candidate : candidates()) {
        const uint32_t v = candidate.vertex;
        if (blocked[v]) continue;
        auto at = std::lower_bound(conflicts_.begin(), conflicts_.end(), std::array{v, 0u});
        for (; at != conflicts_.end() && (*at)[0] == v; ++at) blocked[(*at)[1]] = 1;
        blocked[outline_[v][0].before] = blocked[outline_[v][0].after] = 1;
        removed_[v] = 1;
        list_.push_back(v);
    }
    conflicts_ = {};
    std::sort(list_.begin(), list_.end());
    strip_bounds_.resize(list_.size());
    list_of_cells_.reserve(2 * list_.size());
    for (const uint32_t v : list_)
        for (const CellId cell : table_.cellsAt(v, layer_).cell)
            list_of_cells_.push_back({cell, v});
    parallelSort(list_of_cells_);
}

std::array<uint32_t, 2> Removals::neighbours(uint32_t vertex, CellId cell) const {
    const Outline& outline = outline_[vertex][sideOf(vertex, cell)];
    return {outline.before, outline.after};
}

std::vector<uint32_t> Removals::removedFrom(CellId cell) const {
    std::vector<uint32_t> removed;
    auto at = std::lower_bound(list_of_cells_.begin(), list_of_cells_.end(), std::pair(cell, 0u));
    for (; at != list_of_cells_.end() && at->first == cell; ++at) removed.push_back(at->second);
    return removed;
}

Removals::StripBounds& Removals::boundsOf(uint32_t vertex) {
    const auto at = std::lower_bound(list_.begin(), list_.end(), vertex);
    return strip_bounds_[size_t(at - list_.begin())];
}

CellId Removals::otherCell(uint32_t vertex, CellId cell) const {
    const CellsAt at = table_.cellsAt(vertex, layer_);
    return at.cell[at.cell[0] == cell];
}

}  // namespace pietra::cluster
