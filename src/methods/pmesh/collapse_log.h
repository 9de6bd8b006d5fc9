#pragma once
// What one simplification from end to end did, or all diamonds did, for tests.

#include "base/check.h"
#include "methods/pmesh/diamond_collapses.h"
#include "methods/pmesh/in_core_builder.h"
#include "methods/pmesh/pmesh_testing.h"

namespace pietra::pmesh {

struct CollapseLog {
    struct Collapse {
        uint32_t v, u;  ///< u goes
        std::array<SplitVertex, 2> before;
        SplitVertex after;
        std::vector<uint32_t> neighbour;  ///< of the merged vertex, in order
        std::vector<uint32_t> triangle;   ///< that it removes, in order
    };
    Mesh input;
    std::vector<Collapse> collapse;
};

/// The collapses that buildInCore() encodes, in their order.
inline CollapseLog logCollapses(const Mesh& mesh, const Lattice& lattice, Budget& budget) {
    class Logger : public CollapseSink {
    public:
        Logger(Recorder& recorder, CollapseLog& log, int shift)
            : recorder_(recorder), log_(log), shift_(shift) {}
        void expect(uint32_t face, bool again) override { recorder_.expect(face, again); }
        bool take(const CollapseStep& step) override {
            if (!recorder_.take(step)) return false;
            const CollapseRecord& r = recorder_.records().back();
            CollapseLog::Collapse c{step.v, step.u, {}, {}, {}, {}};
            for (const size_t end : {0u, 1u}) c.before[end] = {r.position[end], r.normal[end]};
            c.after = {(step.mesh.centre + Vec3i(step.to)) >> shift_,
                       packNormal(recorder_.normalOf(step.v))};
            for (uint32_t i = 0; i < step.ring.size; ++i) {
                c.neighbour.push_back(step.ring.next[i]);
                c.neighbour.push_back(step.ring.previous[i]);
            }
            std::sort(c.neighbour.begin(), c.neighbour.end());
            c.neighbour.erase(std::unique(c.neighbour.begin(), c.neighbour.end()),
                              c.neighbour.end());
            for (const Wing& w : step.wing) c.triangle.push_back(w.face);
            std::sort(c.triangle.begin(), c.triangle.end());
            log_.collapse.push_back(std::move(c));
            return true;
        }

    private:
        Recorder& recorder_;
        CollapseLog& log_;
        const int shift_;
    };
    CollapseLog log;
    log.input = mesh;
    collapseInCore(mesh, lattice, budget, [&](Recorder& recorder) {
        return std::make_unique<Logger>(recorder, log, lattice.shift);
    });
    return log;
}

/// Collapses one by one on the input's triangles, without any record but who goes into whom.
class Replay {
public:
    explicit Replay(const Mesh& input) : triangle_(input.triangle), around_(input.vertexCount()) {
        for (uint32_t t = 0; t < triangle_.size(); ++t)
            for (const uint32_t v : triangle_[t]) around_[v].insert(t);
    }
    std::vector<uint32_t> ring(uint32_t v, uint32_t u) const {
        std::set<uint32_t> ring;
        for (const uint32_t end : {v, u})
            for (const uint32_t t : around_[end])
                for (const uint32_t w : triangle_[t])
                    if (w != v && w != u) ring.insert(w);
        return {ring.begin(), ring.end()};
    }
    std::vector<uint32_t> wings(uint32_t v, uint32_t u) const {
        std::vector<uint32_t> both;
        std::set_intersection(around_[v].begin(), around_[v].end(), around_[u].begin(),
                              around_[u].end(), std::back_inserter(both));
        return both;
    }
    void collapse(uint32_t v, uint32_t u) {
        for (const uint32_t t : wings(v, u))
            for (const uint32_t w : triangle_[t]) around_[w].erase(t);
        for (const uint32_t t : around_[u]) {
            for (uint32_t& w : triangle_[t])
                if (w == u) w = v;
            around_[v].insert(t);
        }
        around_[u].clear();
    }
    std::vector<Triangle> triangles() const {
        std::set<uint32_t> left;
        for (const auto& a : around_) left.insert(a.begin(), a.end());
        std::vector<Triangle> all;
        for (const uint32_t t : left) all.push_back(triangle_[t]);
        return all;
    }

private:
    std::vector<Triangle> triangle_;
    std::vector<std::set<uint32_t>> around_;
};

struct DiamondLog {
    CollapseLog log;  ///< vertices of the input have the numbers of their leaves
    SplitForest forest;
};

/// By diamonds of so few triangles. Positions of `mesh` are steps; each is one vertex.
inline DiamondLog logDiamonds(const Mesh& mesh, uint32_t leaf_triangles) {
    const std::string path = ::testing::TempDir() + "/pmesh-diamond-log.pietra";
    MemorySource source = sourceOf(mesh);
    const BuildSettings settings = smallDiamonds(leaf_triangles, path);
    Progress progress;
    Construction work(source, settings, {.name = "pmesh", .stages = 2, .mark_irregular = true},
                      progress);
    Collapses collapses(work.space);
    collapseByDiamonds(work, settings, progress, collapses);
    BuildCounts counts;
    DiamondLog made;
    made.forest = encodeInMemory(collapses, work.info().lattice, work.space, counts);

    Mesh& input = made.log.input;
    std::vector<CollapseLog::Collapse>& all = made.log.collapse;
    all.resize(collapses.store.size());
    auto links = collapses.store.links();
    auto shapes = collapses.store.shapes();
    const auto number = [&](auto&& self, uint32_t record, Leaf first,
                            const SplitVertex& vertex) -> void {
        if (record == kNoSplit) {
            CHECK_EQ(first, input.vertexCount());
            input.position.push_back(vertex.position);
            input.normal.push_back(unpackNormal(vertex.normal));
            return;
        }
        const CollapseShape r = shapes[record];
        const CollapseLink link = links[record];
        CollapseLog::Collapse& c = all[record];
        c.v = first;
        c.u = first + r.leaves[0];
        c.after = {r.merged, vertex.normal};
        for (const size_t end : {0u, 1u}) {
            c.before[end] = {r.position[end], r.normal[end]};
            self(self, link.child[end], end == 0 ? c.v : c.u, c.before[end]);
        }
    };
    for (size_t i = 0; i < collapses.base_last.size(); ++i)
        number(number, collapses.base_last[i], Leaf(input.vertexCount()),
               made.forest.base.root[i].vertex);

    Box3i here, there;
    for (const Triangle& t : mesh.triangle)
        for (const uint32_t v : t) here.add(mesh.position[v]);
    for (const Vec3i& p : input.position) there.add(p);
    std::map<std::array<int32_t, 3>, Leaf> leaf;
    for (Leaf v = 0; v < input.vertexCount(); ++v) {
        const Vec3i p = input.position[v] - there.min;
        CHECK(leaf.emplace(std::array{p.x, p.y, p.z}, v).second);
    }
    for (const Triangle& t : mesh.triangle) {
        Triangle& to = input.triangle.emplace_back();
        for (size_t k = 0; k < 3; ++k) {
            const Vec3i p = mesh.position[t[k]] - here.min;
            to[k] = leaf.at({p.x, p.y, p.z});
        }
    }
    Replay replay(input);
    for (CollapseLog::Collapse& c : all) {
        c.neighbour = replay.ring(c.v, c.u);
        c.triangle = replay.wings(c.v, c.u);
        replay.collapse(c.v, c.u);
    }
    return made;
}

}  // namespace pietra::pmesh
