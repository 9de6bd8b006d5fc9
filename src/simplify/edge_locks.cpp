#include "simplify/edge_locks.h"

#include <algorithm>

namespace pietra {
namespace {

/// The common case, without sorting: all classes kManifold, and the corners before and after the
/// vertex are the same set, each once. Then all its edges are used exactly twice.
bool isPlainFan(WorkingMesh& mesh, const Fan& fan) {
    const uint32_t* corners = mesh.corner.data() + fan.begin;
    const uint32_t epoch = mesh.epoch += 2;
    for (uint32_t i = 0; i < fan.count; ++i) {
        const Face& face = mesh.face[corners[i] >> 2];
        uint32_t& mark = mesh.mark[face.v[kNextCorner[corners[i] & 3]]];
        if (mark == epoch || face.classes() != 0) return false;
        mark = epoch;
    }
    for (uint32_t i = 0; i < fan.count; ++i) {
        const Face& face = mesh.face[corners[i] >> 2];
        uint32_t& mark = mesh.mark[face.v[kPreviousCorner[corners[i] & 3]]];
        if (mark != epoch) return false;
        mark = epoch + 1;
    }
    return true;
}

uint32_t expectedUses(EdgeClass c) {
    return c == EdgeClass::kManifold ? 2 : c == EdgeClass::kBorder ? 1 : 3;
}

}  // namespace

void VertexClassifier::collectUses(const WorkingMesh& mesh, const Fan& fan) {
    uses_.clear();
    for (uint32_t i = 0; i < fan.count; ++i) {
        const uint32_t corner = mesh.corner[fan.begin + i];
        const Face& face = mesh.face[corner >> 2];
        const uint32_t k = corner & 3, previous = kPreviousCorner[k];
        uses_.push_back({face.v[kNextCorner[k]], face.edgeClass(k)});
        uses_.push_back({face.v[previous], face.edgeClass(previous)});
    }
    std::sort(uses_.begin(), uses_.end());
}

uint32_t VertexClassifier::flagsOf(const WorkingMesh& mesh, const Fan& fan) {
    collectUses(mesh, fan);
    uint32_t border_edges = 0, triple_edges = 0;
    for (size_t i = 0, end; i < uses_.size(); i = end) {
        end = i + 1;
        bool agree = true;
        for (; end < uses_.size() && uses_[end].neighbour == uses_[i].neighbour; ++end)
            agree = agree && uses_[end].edge_class == uses_[i].edge_class;
        const EdgeClass c = uses_[i].edge_class;
        if (!agree || c == EdgeClass::kMany || end - i != expectedUses(c))
            return kRankFixed | kOuterFlag;
        border_edges += c == EdgeClass::kBorder;
        triple_edges += c == EdgeClass::kTriple;
    }
    if (border_edges + triple_edges == 0) return kRankFree;
    const bool curve = border_edges + triple_edges == 2 && border_edges != 1;
    return curve ? uint32_t(kRankCurve) : uint32_t(kRankFixed);
}

uint32_t VertexClassifier::run(WorkingMesh& mesh) {
    uint32_t outer = 0;
    for (size_t v = 0; v < mesh.point.size(); ++v) {
        const Fan& fan = mesh.fan[v];
        const uint32_t flags =
            isPlainFan(mesh, fan) ? uint32_t(kRankFree) : flagsOf(mesh, fan) | kIrregularFlag;
        mesh.point[v].flags = flags;
        outer += (flags & kOuterFlag) != 0;
    }
    return outer;
}

}  // namespace pietra
