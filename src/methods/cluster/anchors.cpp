#include "methods/cluster/anchors.h"

#include <algorithm>
#include <map>

#include "base/check.h"

namespace pietra::cluster {

namespace {

double squaredDistance(const Vec3i& p, const Vec3i& a, const Vec3i& b) {
    const Vec3d edge(b - a), w(p - a);
    const double length_sq = glm::dot(edge, edge);
    const double t = length_sq > 0 ? std::clamp(glm::dot(w, edge) / length_sq, 0.0, 1.0) : 0;
    const Vec3d rest = w - t * edge;
    return glm::dot(rest, rest);
}

/// Half-edges of an outline between two anchors.
struct Chain {
    uint32_t low, high;  // its ends
    uint32_t after_low;  // the vertex after `low`: tells it from others with these ends
    uint32_t farthest;   // of its inner vertices, kNone where there is none
    double distance_sq;  // of that one to the straight edge
    bool operator<(const Chain& o) const {
        return std::tie(low, high, distance_sq, after_low) <
               std::tie(o.low, o.high, o.distance_sq, o.after_low);
    }
};

class AnchorFinder {
public:
    AnchorFinder(const PolygonMesh& mesh, const Groups& groups)
        : mesh_(mesh), groups_(groups), keep_(mesh.interface_) {}

    std::vector<uint8_t> run() {
        findMeets();
        for (const uint32_t start : outlineStarts(mesh_, groups_)) {
            traceOutline(start);
            keepThree();
        }
        for (const uint32_t start : outlineStarts(mesh_, groups_)) {
            traceOutline(start);
            listChains();
        }
        splitChains();
        return std::move(keep_);
    }

private:
    /// Regular vertices by counting the groups around; others by what meets there.
    void findMeets() {
        std::vector<uint8_t> groups_at(mesh_.vertexCount(), 0), limit(mesh_.vertexCount(), 2);
        for (uint32_t h = 0; h < mesh_.halfEdgeCount(); ++h) {
            if (!separates(mesh_, groups_, h)) continue;
            const uint32_t v = mesh_.corner[h];
            groups_at[v] = uint8_t(std::min(255, groups_at[v] + 1));
            if (mesh_.twin[h] == kNone) limit[v] = limit[mesh_.end(h)] = 1;
            if (mesh_.irregular[v])
                irregular_[v].push_back({mesh_.end(h), groups_.of_face[mesh_.face[h]]});
            if (const uint32_t w = mesh_.end(h); mesh_.irregular[w])
                irregular_[w].push_back({v, groups_.of_face[mesh_.face[h]]});
        }
        for (uint32_t v = 0; v < mesh_.vertexCount(); ++v)
            if (!mesh_.irregular[v] && groups_at[v] > limit[v]) keep_[v] = 1;
        for (auto& [v, uses] : irregular_) keep_[v] |= !isWithinChain(uses);
    }

    /// Two edges separate here, and the same groups use both.
    static bool isWithinChain(std::vector<std::pair<uint32_t, uint32_t>>& uses) {
        std::sort(uses.begin(), uses.end());
        const size_t half = uses.size() / 2;
        if (uses.empty() || uses.size() % 2 != 0) return false;
        for (size_t i = 0; i < half; ++i)
            if (uses[i].first != uses[0].first || uses[half + i].first != uses[half].first ||
                uses[i].second != uses[half + i].second)
                return false;
        return uses[0].first != uses[half].first;
    }

    void traceOutline(uint32_t start) {
        outline_.clear();
        uint32_t h = start;
        do {
            outline_.push_back(h);
            h = nextOnOutline(mesh_, groups_, h);
        } while (h != start);
    }
    const Vec3i& point(uint32_t h) const { return mesh_.position[mesh_.corner[h]]; }

    /// The vertex of least name, then that farthest from the ones there are.
    void keepThree() {
        CHECK_LE(size_t(3), outline_.size());
        std::vector<uint32_t> kept;
        for (const uint32_t h : outline_)
            if (keep_[mesh_.corner[h]]) kept.push_back(h);
        while (kept.size() < 3) {
            uint32_t best = kNone;
            double most = -1;
            for (const uint32_t h : outline_) {
                const uint32_t v = mesh_.corner[h];
                if (keep_[v]) continue;
                const double far =
                    kept.empty() ? 0
                                 : squaredDistance(point(h), point(kept[0]), point(kept.back()));
                if (far > most || (far == most && mesh_.name[v] < mesh_.name[mesh_.corner[best]]))
                    best = h, most = far;
            }
            keep_[mesh_.corner[best]] = 1;
            kept.push_back(best);
        }
    }

    /// Each chain once, though two outlines have it or more.
    void listChains() {
        const size_t n = outline_.size();
        size_t first = 0;
        while (!keep_[mesh_.corner[outline_[first]]]) ++first;
        for (size_t i = 0; i < n;) {
            size_t j = i + 1;
            while (!keep_[mesh_.corner[outline_[(first + j) % n]]]) ++j;
            addChain(first + i, first + j);
            i = j;
        }
    }

    void addChain(size_t begin, size_t end) {
        const size_t n = outline_.size();
        const auto half_edge = [&](size_t i) { return outline_[i % n]; };
        const uint32_t a = mesh_.corner[half_edge(begin)], b = mesh_.corner[half_edge(end)];
        Chain chain{std::min(a, b), std::max(a, b), 0, kNone, 0};
        chain.after_low = mesh_.corner[half_edge(a < b ? begin + 1 : end - 1)];
        for (size_t i = begin + 1; i < end; ++i) {
            const uint32_t v = mesh_.corner[half_edge(i)];
            const double d = squaredDistance(mesh_.position[v], mesh_.position[chain.low],
                                             mesh_.position[chain.high]);
            if (chain.farthest == kNone || d > chain.distance_sq ||
                (d == chain.distance_sq && mesh_.name[v] < mesh_.name[chain.farthest])) {
                chain.farthest = v;
                chain.distance_sq = d;
            }
        }
        if (chain.farthest == kNone) chain.distance_sq = -1;  // first among those of these ends
        chains_.push_back(chain);
    }

    void splitChains() {
        std::sort(chains_.begin(), chains_.end());
        const Chain* before = nullptr;
        for (const Chain& chain : chains_) {
            const bool same_ends = before && before->low == chain.low && before->high == chain.high;
            if (same_ends && before->after_low == chain.after_low) continue;
            const bool bridges = mesh_.interface_[chain.low] && mesh_.interface_[chain.high];
            if (chain.farthest != kNone && (same_ends || bridges)) keep_[chain.farthest] = 1;
            before = &chain;
        }
    }

    const PolygonMesh& mesh_;
    const Groups& groups_;
    std::vector<uint8_t> keep_;
    std::map<uint32_t, std::vector<std::pair<uint32_t, uint32_t>>> irregular_;
    std::vector<uint32_t> outline_;  // half-edges
    std::vector<Chain> chains_;
};

}  // namespace

std::vector<uint8_t> findAnchors(const PolygonMesh& mesh, const Groups& groups) {
    return AnchorFinder(mesh, groups).run();
}

bool keepFarthest(const PolygonMesh& mesh, const Groups& groups, uint32_t start,
                  std::vector<uint8_t>& keep) {
    while (!keep[mesh.corner[start]]) start = nextOnOutline(mesh, groups, start);
    std::vector<uint32_t> chain;
    double most = -1;
    uint32_t best = kNone, h = start;
    do {
        chain = {mesh.corner[h]};
        do {
            h = nextOnOutline(mesh, groups, h);
            chain.push_back(mesh.corner[h]);
        } while (!keep[chain.back()]);
        for (size_t i = 1; i + 1 < chain.size(); ++i) {
            const double d = squaredDistance(mesh.position[chain[i]], mesh.position[chain.front()],
                                             mesh.position[chain.back()]);
            if (d > most) most = d, best = chain[i];
        }
    } while (h != start);
    if (best != kNone) keep[best] = 1;
    return best != kNone;
}

}  // namespace pietra::cluster
