#include "audit/mesh_topology.h"

#include <algorithm>
#include <numeric>
#include <vector>

namespace pietra {
namespace {

struct Use {
    uint32_t low, high;
    bool upward;  // from low to high
    auto operator<=>(const Use&) const = default;
};

std::vector<Use> usesOf(const Mesh& mesh) {
    std::vector<Use> uses;
    uses.reserve(3 * mesh.triangleCount());
    for (const Triangle& t : mesh.triangle)
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t a = t[k], b = t[(k + 1) % 3];
            uses.push_back({std::min(a, b), std::max(a, b), a < b});
        }
    std::sort(uses.begin(), uses.end());
    return uses;
}

/// Counts the sets that edges join.
class Sets {
public:
    explicit Sets(size_t vertices) : above_(vertices) {
        std::iota(above_.begin(), above_.end(), 0u);
    }
    /// A set more where both ends are new, one less where they join two.
    void join(uint32_t a, uint32_t b, std::vector<uint8_t>& met) {
        count_ += !met[a] + uint64_t(!met[b]);
        met[a] = met[b] = 1;
        const uint32_t x = top(a), y = top(b);
        if (x == y) return;
        above_[std::max(x, y)] = std::min(x, y);
        --count_;
    }
    uint64_t count() const { return count_; }

private:
    uint32_t top(uint32_t v) {
        while (above_[v] != v) v = above_[v] = above_[above_[v]];
        return v;
    }
    std::vector<uint32_t> above_;
    uint64_t count_ = 0;
};

}  // namespace

MeshTopology topologyOf(const Mesh& mesh) {
    MeshTopology topology;
    std::vector<uint8_t> used(mesh.vertexCount(), 0), met(mesh.vertexCount(), 0);
    for (const Triangle& t : mesh.triangle) {
        for (const uint32_t v : t) used[v] = 1;
        topology.degenerate += t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
    }
    const std::vector<Use> uses = usesOf(mesh);
    Sets borders(mesh.vertexCount());
    int64_t edges = 0;
    for (size_t i = 0, end; i < uses.size(); i = end) {
        for (end = i + 1;
             end < uses.size() && uses[end].low == uses[i].low && uses[end].high == uses[i].high;)
            ++end;
        ++edges;
        if (end - i == 1) borders.join(uses[i].low, uses[i].high, met);
        topology.irregular_edges +=
            end - i > 2 || (end - i == 2 && uses[i].upward == uses[i + 1].upward);
    }
    topology.borders = borders.count();
    topology.euler = std::accumulate(used.begin(), used.end(), int64_t(0)) - edges +
                     int64_t(mesh.triangleCount());
    return topology;
}

}  // namespace pietra
