#include "methods/cluster/face_clusters.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <queue>

#include "base/check.h"

namespace pietra::cluster {

namespace {

/// What turning away counts, beside lying across.
constexpr float kTurnWeight = 0.25f;

struct Proxy {
    Vec3f centroid, normal;
};

Proxy proxyOf(const FaceShape& shape) {
    const double length = glm::length(shape.normal);
    return {Vec3f(shape.centroid()), length > 0 ? Vec3f(shape.normal / length) : Vec3f(0)};
}

class Regions {
public:
    Regions(const PolygonMesh& mesh, uint32_t count, const ClusterSettings& settings)
        : mesh_(mesh),
          settings_(settings),
          corners_(mesh),
          label_(mesh.faceCount()),
          missing_(count - std::max(1u, uint32_t(settings.first_share * float(count)))) {
        double area = 0;
        for (const FaceShape& shape : mesh.shape) {
            face_.push_back(proxyOf(shape));
            area += shape.area;
        }
        normal_scale_ = settings.normal_weight * float(area / count);
        const uint64_t first = count - missing_;
        for (uint64_t f = 0; f < mesh.faceCount(); ++f)
            label_[f] = uint32_t(f * first / mesh.faceCount());
        seed_.resize(first);
        proxy_.resize(first);
    }

    Groups run() {
        for (int round = 1; round < settings_.most_rounds; ++round) {
            findProxies();
            const uint32_t moved = sweep();
            if (moved == 0 && missing_ == 0) break;
            addRepresentatives(missing_ / uint32_t(settings_.most_rounds - round));
        }
        findProxies();
        chooseRepresentatives();
        growDiscs();
        growRest();
        return inOrder();
    }

private:
    float cost(uint32_t f, uint32_t region) const {
        const Proxy& p = proxy_[region];
        const Vec3f d = face_[f].centroid - p.centroid;
        const float across = glm::dot(d, p.normal);
        return glm::dot(d, d) + settings_.plane_weight * (across * across) +
               normal_scale_ * (1 - glm::dot(face_[f].normal, p.normal));
    }

    /// How much a region bends to reach a face: squared, lattice units.
    float bend(uint32_t f, uint32_t region) const {
        const Proxy& p = proxy_[region];
        const Vec3f d = face_[f].centroid - p.centroid;
        const float across = glm::dot(d, p.normal);
        return across * across +
               kTurnWeight * glm::dot(d, d) * (1 - glm::dot(face_[f].normal, p.normal));
    }

    /// Waiting faces are known by their half-edge towards the region that may take them. Costs are
    /// not negative but for rounding, so their bits have their order.
    void offerNeighbours(uint32_t f) {
        for (uint32_t h = mesh_.face_begin[f]; h < mesh_.face_begin[f + 1]; ++h) {
            const uint32_t t = mesh_.twin[h];
            if (t == kNone || label_[mesh_.face[t]] != kNone) continue;
            const float c = std::max(0.0f, cost(mesh_.face[t], label_[f]));
            waiting_.push(uint64_t(std::bit_cast<uint32_t>(c)) << 32 | t);
        }
    }

    void take(uint32_t f, uint32_t region) {
        label_[f] = region;
        offerNeighbours(f);
    }

    void takeWaiting(uint32_t most) {
        for (uint32_t taken = 0; !waiting_.empty() && taken < most;) {
            const uint32_t h = uint32_t(waiting_.top());
            waiting_.pop();
            const uint32_t f = mesh_.face[h];
            if (label_[f] != kNone) continue;
            const uint32_t region = label_[mesh_.face[mesh_.twin[h]]];
            if (!staysDisc(f, region)) continue;
            take(f, region);
            ++taken;
        }
        waiting_ = {};
    }

    /// Each face goes to the region next to it that it costs least; returns how many moved.
    uint32_t sweep() {
        uint32_t moved = 0;
        for (uint32_t f = 0; f < mesh_.faceCount(); ++f) {
            const uint32_t own = label_[f];
            uint32_t best = own;
            float least = -1;
            for (uint32_t h = mesh_.face_begin[f]; h < mesh_.face_begin[f + 1]; ++h) {
                const uint32_t t = mesh_.twin[h];
                if (t == kNone) continue;
                const uint32_t other = label_[mesh_.face[t]];
                if (other == own || other == best) continue;
                if (least < 0) least = std::max(0.0f, cost(f, own));
                if (const float c = cost(f, other); c < least) least = c, best = other;
            }
            moved += best != own;
            label_[f] = best;
        }
        return moved;
    }

    void growDiscs() {
        std::fill(label_.begin(), label_.end(), kNone);
        outline_.clear();
        for (uint32_t k = 0; k < seed_.size(); ++k) {
            label_[seed_[k]] = k;
            outline_.push_back(mesh_.corners(seed_[k]));
        }
        for (const uint32_t f : seed_) offerNeighbours(f);
        takeWaiting(mesh_.faceCount());
    }

    /// What no region took: components without a representative, and what no region could take.
    void growRest() {
        const uint32_t most = 2 * mesh_.faceCount() / uint32_t(seed_.size());
        for (uint32_t f = 0; f < mesh_.faceCount(); ++f) {
            if (label_[f] != kNone) continue;
            const uint32_t region = uint32_t(seed_.size());
            seed_.push_back(f);
            proxy_.push_back(face_[f]);
            outline_.push_back(mesh_.corners(f));
            take(f, region);
            takeWaiting(most);
        }
    }

    /// Whether face and region, both discs, meet in one path of edges and nowhere else, and leave
    /// an outline of three corners or more. Then both together are a disc, and its outline is
    /// simple.
    bool staysDisc(uint32_t f, uint32_t region) {
        uint32_t shared = 0, paths = 0, met = 0;
        const uint32_t begin = mesh_.face_begin[f], end = mesh_.face_begin[f + 1];
        bool was_shared = isShared(end - 1, region);
        for (uint32_t h = begin; h < end; ++h) {
            const bool is_shared = isShared(h, region);
            shared += is_shared;
            paths += is_shared && !was_shared;
            met += is_shared || was_shared || isAt(mesh_.corner[h], region);
            was_shared = is_shared;
        }
        const uint32_t outline = outline_[region] + (end - begin) - 2 * shared;
        if (paths != 1 || met != shared + 1 || outline < 3) return false;
        outline_[region] = outline;
        return true;
    }

    bool isShared(uint32_t h, uint32_t region) const {
        const uint32_t t = mesh_.twin[h];
        return t != kNone && label_[mesh_.face[t]] == region;
    }

    bool isAt(uint32_t vertex, uint32_t region) const {
        for (const uint32_t h : corners_.at(vertex))
            if (label_[mesh_.face[h]] == region) return true;
        return false;
    }

    /// Regions without faces go.
    void findProxies() {
        std::vector<FaceShape> sum(seed_.size());
        std::vector<uint32_t> faces(seed_.size(), 0);
        for (uint32_t f = 0; f < mesh_.faceCount(); ++f) {
            sum[label_[f]].add(mesh_.shape[f]);
            ++faces[label_[f]];
        }
        uint32_t count = 0;
        for (uint32_t k = 0; k < faces.size(); ++k) {
            if (faces[k] == 0) continue;
            proxy_[count] = proxyOf(sum[k]);
            faces[k] = count++;
        }
        if (count < faces.size())
            for (uint32_t& k : label_) k = faces[k];
        proxy_.resize(count);
        seed_.resize(count);
    }

    void chooseRepresentatives() {
        std::vector<float> least(seed_.size(), std::numeric_limits<float>::infinity());
        for (uint32_t f = 0; f < mesh_.faceCount(); ++f) {
            const uint32_t k = label_[f];
            const float c = cost(f, k);
            if (c < least[k]) least[k] = c, seed_[k] = f;
        }
    }

    /// At the faces to which their regions bend most, one a region, in the regions where that is
    /// most.
    void addRepresentatives(uint32_t count) {
        std::vector<std::pair<float, uint32_t>> worst(seed_.size());
        for (uint32_t f = 0; f < mesh_.faceCount(); ++f) {
            const uint32_t k = label_[f];
            const float b = bend(f, k);
            if (b > worst[k].first) worst[k] = {b, f};
        }
        std::sort(worst.begin(), worst.end(), [](const auto& a, const auto& b) {
            return a.first > b.first || (a.first == b.first && a.second < b.second);
        });
        missing_ -= count;
        for (uint32_t i = 0; i < std::min<size_t>(count, worst.size()) && worst[i].first > 0; ++i) {
            label_[worst[i].second] = uint32_t(seed_.size());
            seed_.push_back(worst[i].second);
            proxy_.push_back(face_[worst[i].second]);
        }
    }

    /// Numbers regions by their representatives.
    Groups inOrder() const {
        std::vector<uint32_t> order(seed_.size()), number(seed_.size());
        std::iota(order.begin(), order.end(), 0u);
        std::sort(order.begin(), order.end(),
                  [&](uint32_t a, uint32_t b) { return seed_[a] < seed_[b]; });
        for (uint32_t i = 0; i < order.size(); ++i) number[order[i]] = i;
        Groups groups{uint32_t(order.size()), label_};
        for (uint32_t& g : groups.of_face) g = number[g];
        return groups;
    }

    const PolygonMesh& mesh_;
    const ClusterSettings& settings_;
    const Corners corners_;
    std::vector<Proxy> face_;        // of each face
    std::vector<uint32_t> seed_;     // of each region: the representative
    std::vector<Proxy> proxy_;       // of each region
    std::vector<uint32_t> outline_;  // of each region: corners
    std::vector<uint32_t> label_;    // of each face: its region
    uint32_t missing_;               // representatives that are still to come
    float normal_scale_ = 0;
    std::priority_queue<uint64_t, std::vector<uint64_t>, std::greater<>> waiting_;
};

}  // namespace

Groups clusterFaces(const PolygonMesh& mesh, uint32_t count, const ClusterSettings& settings) {
    if (mesh.faceCount() == 0) return {};
    count = std::clamp(count, 1u, mesh.faceCount());
    return Regions(mesh, count, settings).run();
}

}  // namespace pietra::cluster
