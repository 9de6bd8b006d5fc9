#include "coarsen/crumbs.h"

#include <algorithm>
#include <mutex>
#include <span>
#include <unordered_map>

#include "base/parallel.h"
#include "coarsen/edge_spread.h"
#include "coarsen/mesh_joiner.h"

namespace pietra {

namespace {

constexpr size_t kBatchTriangles = size_t(1) << 18;

/// Moves the triangles of some crumbs. Leaves go by their number in the tree's order.
class CrumbMover {
public:
    CrumbMover(Leaves& leaves, CellStore& store) : leaves_(leaves), store_(store) {}

    void add(uint32_t leaf) {
        const auto blob = leaves_.blobs.find(idOf(leaf));
        store_.get(blob->second, crumbs_.emplace_back());
        leaves_.blobs.erase(blob);
        const Mesh& mesh = crumbs_.back().mesh;
        for (uint32_t t = 0; t < mesh.triangleCount(); ++t) {
            Triangle corners = mesh.triangle[t];
            for (uint32_t& v : corners) v = numberOf(mesh.position[v]);
            spread_.add(corners);
            moves_.push_back({leaf, uint32_t(crumbs_.size() - 1), t});
        }
    }
    size_t triangleCount() const { return moves_.size(); }

    /// `larger`: the leaves that triangles may go to.
    void run(std::span<const uint32_t> larger, Progress& progress) {
        parallelFor(larger.size(), [&](size_t i) {
            claimEdges(larger[i]);
            progress.tick(0);
        });
        spread_.run();
        for (size_t i = 0; i < moves_.size(); ++i)
            if (spread_.owner(i) != EdgeSpread::kNobody) moves_[i].leaf = spread_.owner(i);
        std::stable_sort(moves_.begin(), moves_.end(),
                         [](const Move& a, const Move& b) { return a.leaf < b.leaf; });
        for (auto first = moves_.begin(); first != moves_.end();) {
            const auto last = std::find_if(first, moves_.end(),
                                           [&](const Move& m) { return m.leaf != first->leaf; });
            store(std::span(first, last));
            first = last;
        }
    }

private:
    struct Move {
        uint32_t leaf;  // where it is to be
        uint32_t crumb, triangle;
    };

    CellId idOf(uint32_t leaf) const { return leaves_.tree->leaves()[leaf]; }

    uint32_t numberOf(const Vec3i& p) {
        const auto [number, is_new] = vertices_.insert(latticeKey(p), vertex_count_);
        vertex_count_ += is_new;
        return number;
    }

    void claimEdges(uint32_t leaf) {
        CellMesh cell;
        store_.get(leaves_.blobs.at(idOf(leaf)), cell);
        std::vector<const uint32_t*> number;  // null: no crumb's vertex
        for (const Vec3i& p : cell.mesh.position) number.push_back(vertices_.find(latticeKey(p)));
        for (const Triangle& t : cell.mesh.triangle)
            for (size_t k = 0; k < 3; ++k) {
                const uint32_t *a = number[t[k]], *b = number[t[(k + 1) % 3]];
                if (!a || !b) continue;
                const std::lock_guard lock(mutex_);
                spread_.claim(*a, *b, leaf);
            }
    }

    /// The triangles join what the leaf they all go to has.
    void store(std::span<const Move> moves) {
        CellMesh cell;
        cell.closed = true;
        const CellId leaf = idOf(moves[0].leaf);
        if (const auto blob = leaves_.blobs.find(leaf); blob != leaves_.blobs.end())
            store_.get(blob->second, cell);
        MeshJoiner joiner;
        joiner.begin(cell.mesh, moves.size());
        for (const Move& move : moves) {
            const CellMesh& crumb = crumbs_[move.crumb];
            joiner.addTriangle(crumb.mesh, move.triangle);
            cell.closed = cell.closed && crumb.closed;
            cell.bounds.to_original.push_back(crumb.bounds.to_original[move.triangle]);
            cell.bounds.from_original.push_back(crumb.bounds.from_original[move.triangle]);
        }
        leaves_.blobs[leaf] = store_.put(cell);
    }

    Leaves& leaves_;
    CellStore& store_;
    std::vector<CellMesh> crumbs_;
    std::vector<Move> moves_;  // as in spread_
    EdgeSpread spread_;
    KeyMap vertices_;
    uint32_t vertex_count_ = 0;
    std::mutex mutex_;
};

/// Tells which split cells lie in a diamond that holds little, or below one.
class SmallDiamonds {
public:
    SmallDiamonds(const Leaves& leaves, uint64_t least) {
        const CellTree& tree = *leaves.tree;
        const auto held = [&](CellId cell) {
            if (const auto split = cells_.find(cell); split != cells_.end())
                return split->second.triangles;
            const auto leaf = leaves.blobs.find(cell);
            return leaf == leaves.blobs.end() ? 0 : uint64_t(leaf->second.triangles);
        };
        for (int level = tree.deepestLevel(); level >= 0; --level)
            for (const CellId cell : tree.splitCells(level))
                cells_[cell].triangles = held(cellChild(cell, 0)) + held(cellChild(cell, 1));
        for (int level = 0; level <= tree.deepestLevel(); ++level)
            for (const CellId cell : tree.splitCells(level)) {
                uint64_t triangles = 0;
                for (const CellId member : diamondCells(cell)) triangles += held(member);
                cells_[cell].is_small =
                    triangles < least || (level > 0 && cells_[cellParent(cell)].is_small);
            }
    }
    bool contain(CellId cell) const {
        const auto split = cells_.find(cell);
        return split != cells_.end() && split->second.is_small;
    }

private:
    struct Split {
        uint64_t triangles = 0;
        bool is_small = false;
    };
    std::unordered_map<CellId, Split> cells_;
};

}  // namespace

void moveCrumbs(Leaves& leaves, CellStore& store, uint32_t least, Progress& progress) {
    const std::vector<CellId>& order = leaves.tree->leaves();
    const SmallDiamonds small(leaves, least);
    std::vector<uint32_t> crumbs, larger;
    for (uint32_t i = 0; i < order.size(); ++i)
        if (const auto blob = leaves.blobs.find(order[i]); blob != leaves.blobs.end())
            (small.contain(cellParent(order[i])) ? crumbs : larger).push_back(i);
    for (size_t next = 0; next < crumbs.size();) {
        CrumbMover mover(leaves, store);
        while (next < crumbs.size() && mover.triangleCount() < kBatchTriangles)
            mover.add(crumbs[next++]);
        mover.run(larger, progress);
    }
}

}  // namespace pietra
