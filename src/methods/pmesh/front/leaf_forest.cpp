#include "methods/pmesh/front/leaf_forest.h"

#include <algorithm>

#include "base/check.h"
#include "methods/pmesh/in_core_builder.h"

namespace pietra::pmesh {
namespace {

/// Hands on to the recorder, and keeps what it takes.
class Logger : public CollapseSink {
public:
    Logger(Recorder& recorder, CollapseLog& log) : recorder_(recorder), log_(log) {}
    void expect(uint32_t face, bool again) override { recorder_.expect(face, again); }
    bool take(const CollapseStep& step) override {
        if (!recorder_.take(step)) return false;
        const CollapseRecord& r = recorder_.records().back();
        CollapseLog::Collapse c{};
        c.v = step.v, c.u = step.u;
        for (const size_t end : {0u, 1u}) {
            const Vec3i& p = r.position[end];
            c.before[end] = {p.x, p.y, p.z, r.normal[end]};
        }
        const Vec3i to = (step.mesh.centre + Vec3i(step.to)) >> log_.lattice.shift;
        c.after = {to.x, to.y, to.z, packNormal(recorder_.normalOf(step.v))};
        c.error = r.error;
        c.neighbours = r.ring_size;
        c.neighbour = r.ring;
        CHECK_LE(step.wing.size(), c.triangle.size());
        for (const Wing& w : step.wing) c.triangle[c.triangles++] = w.face;
        log_.collapse.push_back(c);
        return true;
    }

private:
    Recorder& recorder_;
    CollapseLog& log_;
};

/// An error and a box in steps, until the grid is known.
struct Nest {
    float error = 0;
    Box3i box;
    void add(const Nest& other) {
        error = std::max(error, other.error);
        box.add(other.box);
    }
};

Vec3i placeOf(const Vertex& v) {
    return v.position();
}

/// Of all collapses: what each must state so that those that need it are enclosed. A collapse needs
/// the next one of each vertex of its star, so a vertex hands to its next collapse what was done
/// around it since its last.
std::vector<Nest> nestCriteria(const CollapseLog& log) {
    std::vector<Nest> nest(log.collapse.size()), at(log.vertex.size());
    std::vector<Vertex> now = log.vertex;
    for (size_t i = 0; i < nest.size(); ++i) {
        const CollapseLog::Collapse& c = log.collapse[i];
        Nest& n = nest[i];
        n.error = std::max(c.error, float(kErrorUnit) * float(1 << log.lattice.shift));
        n.box.add(placeOf(c.after));
        for (const Vertex& v : c.before) n.box.add(placeOf(v));
        for (uint8_t k = 0; k < c.neighbours; ++k) n.box.add(placeOf(now[c.neighbour[k]]));
        n.add(at[c.v]);
        n.add(at[c.u]);
        at[c.v] = n;
        for (uint8_t k = 0; k < c.neighbours; ++k) at[c.neighbour[k]].add(n);
        now[c.v] = c.after;
    }
    return nest;
}

class Maker {
public:
    Maker(const CollapseLog& log, std::vector<Leaf>& leaf_of) : log_(log), leaf_of_(leaf_of) {}

    LeafForest make() {
        out_.lattice = log_.lattice;
        findChildren();
        nest_ = nestCriteria(log_);
        findGrid();
        numberLeaves();
        for (uint32_t i = 0; i < log_.collapse.size(); ++i) fill(i);
        for (uint32_t v = 0; v < last_.size(); ++v)
            if (!gone_[v])
                out_.root.push_back({first_[v], nameOf(last_[v]), criterionOf(last_[v]), now_[v]});
        std::sort(out_.root.begin(), out_.root.end(),
                  [](const LeafRoot& a, const LeafRoot& b) { return a.first < b.first; });
        std::vector<uint8_t> brought(log_.triangle.size(), 0);
        for (const CollapseLog::Collapse& c : log_.collapse)
            for (uint8_t k = 0; k < c.triangles; ++k) brought[c.triangle[k]] = 1;
        for (size_t t = 0; t < brought.size(); ++t)
            if (!brought[t])
                for (const uint32_t v : log_.triangle[t]) out_.base_corner.push_back(leaf_of_[v]);
        return std::move(out_);
    }

private:
    void findChildren() {
        const size_t vertices = log_.vertex.size(), collapses = log_.collapse.size();
        last_.assign(vertices, kNoLeaf);
        gone_.assign(vertices, 0);
        now_ = log_.vertex;
        child_.resize(collapses);
        parent_.assign(collapses, kNoLeaf);
        for (uint32_t i = 0; i < collapses; ++i) {
            const CollapseLog::Collapse& c = log_.collapse[i];
            child_[i] = {last_[c.v], last_[c.u]};
            for (const uint32_t below : child_[i])
                if (below != kNoLeaf) parent_[below] = i;
            last_[c.v] = i;
            gone_[c.u] = 1;
            now_[c.v] = c.after;
        }
    }
    void findGrid() {
        Box3i box;
        for (const Vertex& v : log_.vertex) box.add(placeOf(v));
        for (const Nest& n : nest_) box.add(n.box);
        if (box.empty()) return;
        out_.grid_origin = box.min;
        const Vec3i size = box.max - box.min;
        const int32_t longest = std::max({size.x, size.y, size.z});
        while (((longest - 1) >> out_.grid_shift) + 1 > 0xffff) ++out_.grid_shift;
    }
    /// Down from the roots. A collapse's name is its u's first leaf.
    void numberLeaves() {
        name_.resize(log_.collapse.size());
        leaf_of_.resize(log_.vertex.size());
        first_.resize(log_.vertex.size());
        Leaf next = 0;
        struct Open {
            uint32_t collapse, vertex, named;  // named: the collapse that it is the u of
        };
        std::vector<Open> stack;
        for (uint32_t root = 0; root < last_.size(); ++root) {
            if (gone_[root]) continue;
            first_[root] = next;
            stack.push_back({last_[root], root, kNoLeaf});
            while (!stack.empty()) {
                const Open o = stack.back();
                stack.pop_back();
                if (o.named != kNoLeaf) name_[o.named] = next;
                if (o.collapse == kNoLeaf) {
                    leaf_of_[o.vertex] = next++;
                    continue;
                }
                const CollapseLog::Collapse& c = log_.collapse[o.collapse];
                stack.push_back({child_[o.collapse][1], c.u, o.collapse});
                stack.push_back({child_[o.collapse][0], c.v, kNoLeaf});
            }
        }
        out_.split.resize(next);
    }
    void fill(uint32_t i) {
        const CollapseLog::Collapse& c = log_.collapse[i];
        LeafSplit& s = out_.split[name_[i]];
        s.parent = nameOf(parent_[i]);
        s.vertex = c.before;
        s.corner.fill(0);
        for (size_t end = 0; end < 2; ++end) {
            s.child[end] = nameOf(child_[i][end]);
            s.criterion[end] = criterionOf(child_[i][end]);
        }
        for (uint8_t t = 0; t < c.triangles; ++t)
            for (size_t k = 0; k < 3; ++k)
                s.corner[3 * t + k] = leaf_of_[log_.triangle[c.triangle[t]][k]];
    }
    Leaf nameOf(uint32_t i) const { return i == kNoLeaf ? kNoLeaf : name_[i]; }
    NestedCriterion criterionOf(uint32_t i) const {
        NestedCriterion c;
        if (i == kNoLeaf) return c;
        const Vec3i min = nest_[i].box.min - out_.grid_origin;
        const Vec3i max = nest_[i].box.max - out_.grid_origin;
        const int32_t up = (1 << out_.grid_shift) - 1;
        for (int k = 0; k < 3; ++k) {
            c.min[size_t(k)] = uint16_t(min[k] >> out_.grid_shift);
            c.max[size_t(k)] = uint16_t((max[k] + up) >> out_.grid_shift);
        }
        c.error = NestedCriterion::errorUp(float(nest_[i].error / out_.gridUnit()));
        return c;
    }

    const CollapseLog& log_;
    std::vector<Leaf>& leaf_of_;
    LeafForest out_;
    std::vector<uint32_t> last_, parent_;
    std::vector<uint8_t> gone_;
    std::vector<Vertex> now_;
    std::vector<std::array<uint32_t, 2>> child_;
    std::vector<Nest> nest_;
    std::vector<Leaf> name_, first_;
};

}  // namespace

CollapseLog logCollapses(Mesh mesh, const Lattice& lattice, Budget& budget) {
    CollapseLog log;
    log.lattice = lattice;
    log.triangle = mesh.triangle;
    for (size_t v = 0; v < mesh.vertexCount(); ++v) {
        const Vec3i p = mesh.position[v] >> lattice.shift;
        log.vertex.push_back({p.x, p.y, p.z, packNormal(mesh.normal[v])});
    }
    collapseInCore(std::move(mesh), lattice, budget,
                   [&](Recorder& recorder) { return std::make_unique<Logger>(recorder, log); });
    return log;
}

LeafForest makeLeafForest(const CollapseLog& log, std::vector<Leaf>* leaf_of) {
    std::vector<Leaf> unused;
    return Maker(log, leaf_of ? *leaf_of : unused).make();
}

}  // namespace pietra::pmesh
