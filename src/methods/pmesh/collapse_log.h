#pragma once
// What one simplification from end to end did, for tests.

#include "base/check.h"
#include "methods/pmesh/in_core_builder.h"

namespace pietra::pmesh {

struct CollapseLog {
    struct Collapse {
        uint32_t v, u;  ///< u goes
        std::array<SplitVertex, 2> before;
        SplitVertex after;
        float error;                       ///< lattice units, of its own
        std::vector<uint32_t> neighbour;   ///< of the merged vertex
        std::vector<uint32_t> triangle;    ///< that it removes
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
            CollapseLog::Collapse c{step.v, step.u, {}, {}, r.error, {}, {}};
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

}  // namespace pietra::pmesh
