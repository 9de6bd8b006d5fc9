#pragma once
// Hands triangles over to owners across edges: those that share an edge with what an owner has,
// then those that share an edge with these, and so on. Which edge is claimed first does not matter.

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "coarsen/key_map.h"
#include "geometry/mesh.h"

namespace pietra {

class EdgeSpread {
public:
    static constexpr uint32_t kNobody = ~0u;

    void clear() {
        edges_.reserve(0);
        claim_.clear();
        triangles_.clear();
    }

    /// A triangle that seeks an owner; they are numbered as they come.
    void add(const Triangle& corners) {
        Seeker& seeker = triangles_.emplace_back();
        for (size_t k = 0; k < 3; ++k) {
            const auto [edge, is_new] =
                edges_.insert(key(corners[k], corners[(k + 1) % 3]), uint32_t(claim_.size()));
            if (is_new) claim_.push_back(kNobody);
            seeker.edge[k] = edge;
        }
    }

    /// The owner has this edge. Of several, the least is heard.
    void claim(uint32_t a, uint32_t b, uint32_t owner) {
        if (const uint32_t* edge = edges_.find(key(a, b)))
            claim_[*edge] = std::min(claim_[*edge], owner);
    }

    void run() {
        for (int round = 0; round < kRounds && moveOn(); ++round) {
        }
    }

    size_t size() const { return triangles_.size(); }
    /// kNobody where no owner came that far.
    uint32_t owner(size_t triangle) const { return triangles_[triangle].owner; }

private:
    static constexpr int kRounds = 64;  // edges that a triangle may be away from its owner's
    struct Seeker {
        std::array<uint32_t, 3> edge;
        uint32_t owner = kNobody;
    };

    static uint64_t key(uint32_t a, uint32_t b) {
        return uint64_t(std::min(a, b)) << 32 | std::max(a, b);
    }

    /// Who claims most of a triangle's edges.
    uint32_t claimant(const Seeker& seeker) const {
        std::array<uint32_t, 3> claims;
        for (size_t k = 0; k < 3; ++k) claims[k] = claim_[seeker.edge[k]];
        std::sort(claims.begin(), claims.end());
        return claims[1] == claims[2] && claims[1] != kNobody ? claims[1] : claims[0];
    }

    bool moveOn() {
        std::vector<const Seeker*> found;
        for (Seeker& seeker : triangles_) {
            if (seeker.owner != kNobody) continue;
            seeker.owner = claimant(seeker);
            if (seeker.owner != kNobody) found.push_back(&seeker);
        }
        for (const Seeker* seeker : found)
            for (const uint32_t edge : seeker->edge)
                claim_[edge] = std::min(claim_[edge], seeker->owner);
        return !found.empty();
    }

    KeyMap edges_;
    std::vector<uint32_t> claim_;  // one an edge
    std::vector<Seeker> triangles_;
};

}  // namespace pietra
