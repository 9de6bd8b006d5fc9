#include "methods/cluster/triangulation.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/hash.h"

namespace pietra::cluster {

namespace {

/// Pairs of vertices that are joined. Open addressing; grows.
class Joined {
public:
    explicit Joined(size_t expected) : slot_(std::bit_ceil(2 * expected + 16), kEmpty) {}
    bool has(uint32_t a, uint32_t b) const { return slot_[find(key(a, b))] != kEmpty; }
    void add(uint32_t a, uint32_t b) {
        uint64_t& at = slot_[find(key(a, b))];
        count_ += at == kEmpty;
        at = key(a, b);
        if (2 * count_ < slot_.size()) return;
        std::vector<uint64_t> old(slot_.size() * 2, kEmpty);
        old.swap(slot_);
        for (const uint64_t k : old)
            if (k != kEmpty) slot_[find(k)] = k;
    }

private:
    static constexpr uint64_t kEmpty = ~uint64_t(0);
    static uint64_t key(uint32_t a, uint32_t b) {
        return uint64_t(std::min(a, b)) << 32 | std::max(a, b);
    }
    size_t find(uint64_t k) const {
        size_t i = mixBits(k) & (slot_.size() - 1);
        while (slot_[i] != kEmpty && slot_[i] != k) i = (i + 1) & (slot_.size() - 1);
        return i;
    }
    std::vector<uint64_t> slot_;
    size_t count_ = 0;
};

/// A corner of what is left of a polygon, and the edge to the next one.
struct Corner {
    uint32_t vertex;
    EdgeClass edge_class;
    glm::i64vec2 flat;  // projected along the axis nearest to the normal: exact
};

int64_t turn(const glm::i64vec2& a, const glm::i64vec2& b, const glm::i64vec2& c) {
    const glm::i64vec2 u = b - a, v = c - a;
    return u.x * v.y - u.y * v.x;
}

int64_t turn(const Corner& a, const Corner& b, const Corner& c) {
    return turn(a.flat, b.flat, c.flat);
}

class Triangulator {
    static constexpr double kFolded = -2;  // added to the quality, which is between -0.3 and 0.3

public:
    explicit Triangulator(const PolygonMesh& polygons)
        : polygons_(polygons), joined_(polygons.halfEdgeCount()) {
        for (uint32_t h = 0; h < polygons.halfEdgeCount(); ++h)
            joined_.add(polygons.corner[h], polygons.end(h));
        out_.mesh.position = polygons.position;
    }

    LayerTriangles run() {
        for (face_ = 0; face_ < polygons_.faceCount(); ++face_) {
            loadPolygon();
            const bool planned = planEars();
            folds_ = folds_ || turn(corner_[0], corner_[1], corner_[2]) <= 0;
            if (!planned || (folds_ && starFits())) {
                loadPolygon();
                emitStar();
                continue;
            }
            if (folds_) out_.folded.push_back(face_);
            for (const auto& [a, b] : diagonals_) joined_.add(a, b);
            for (const auto& ear : ears_) emit(ear);
            emit({corner_[0], corner_[1], corner_[2]});
        }
        return std::move(out_);
    }

private:
    void loadPolygon() {
        corner_.clear();
        ears_.clear();
        diagonals_.clear();
        folds_ = false;
        normal_ = polygons_.shape[face_].normal;
        const double length = glm::length(normal_);
        if (length > 0) normal_ /= length;
        const Vec3d size = glm::abs(normal_);
        const int axis = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
        across_ = {(axis + 1) % 3, (axis + 2) % 3};
        if (normal_[axis] < 0) std::swap(across_[0], across_[1]);
        for (uint32_t h = polygons_.face_begin[face_]; h < polygons_.face_begin[face_ + 1]; ++h)
            corner_.push_back({polygons_.corner[h], polygons_.edge_class[h],
                               flatOf(polygons_.position[polygons_.corner[h]])});
    }

    glm::i64vec2 flatOf(const Vec3i& p) const { return {p[across_[0]], p[across_[1]]}; }

    bool starFits() const {
        const uint32_t m = polygons_.middle[face_];
        if (m == kNone) return false;
        const glm::i64vec2 centre = flatOf(polygons_.inner_position[m]);
        for (uint32_t h = polygons_.face_begin[face_]; h < polygons_.face_begin[face_ + 1]; ++h)
            if (turn(flatOf(polygons_.position[polygons_.corner[h]]),
                     flatOf(polygons_.position[polygons_.end(h)]), centre) <= 0)
                return false;
        return true;
    }

    /// Down to three corners; false where no ear may be cut.
    bool planEars() {
        while (corner_.size() > 3) {
            const size_t n = corner_.size();
            size_t best = n;
            double most = 0;
            for (size_t i = 0; i < n; ++i) {
                const Corner &a = corner_[(i + n - 1) % n], &c = corner_[(i + 1) % n];
                if (polygons_.interface_[a.vertex] && polygons_.interface_[c.vertex]) continue;
                if (joined_.has(a.vertex, c.vertex)) continue;
                const double quality = qualityOfEar(i);
                if (best == n || quality > most) best = i, most = quality;
            }
            if (best == n) return false;
            folds_ |= most < 0.5 * kFolded;
            Corner &a = corner_[(best + n - 1) % n], &c = corner_[(best + 1) % n];
            ears_.push_back({a, corner_[best], c});
            ears_.back()[2].edge_class = EdgeClass::kManifold;
            a.edge_class = EdgeClass::kManifold;
            diagonals_.push_back({a.vertex, c.vertex});
            corner_.erase(corner_.begin() + ptrdiff_t(best));
        }
        return true;
    }

    /// Height over length of its sides; ears that fold over are the worst.
    double qualityOfEar(size_t i) const {
        const size_t n = corner_.size();
        const Corner &a = corner_[(i + n - 1) % n], &b = corner_[i], &c = corner_[(i + 1) % n];
        const Vec3d p(polygons_.position[a.vertex]), q(polygons_.position[b.vertex]),
            r(polygons_.position[c.vertex]);
        const Vec3d pq = q - p, pr = r - p, qr = r - q;
        const double sides = glm::dot(pq, pq) + glm::dot(pr, pr) + glm::dot(qr, qr);
        const double quality = glm::dot(glm::cross(pq, pr), normal_) / sides;
        if (turn(a, b, c) <= 0) return quality + 2 * kFolded;
        for (size_t j = 0; j + 3 < n; ++j) {
            const Corner& d = corner_[(i + 2 + j) % n];
            if (turn(a, b, d) >= 0 && turn(b, c, d) >= 0 && turn(c, a, d) >= 0)
                return quality + kFolded;
        }
        return quality;
    }

    void emitStar() {
        ++out_.stars;
        const uint32_t centre = uint32_t(out_.mesh.position.size());
        if (const uint32_t m = polygons_.middle[face_]; m != kNone) {
            out_.mesh.position.push_back(polygons_.inner_position[m]);
        } else {
            out_.to_free.push_back(centre);
            out_.mesh.position.push_back(
                Vec3i(glm::floor(polygons_.shape[face_].centroid() + 0.5)));
        }
        for (size_t i = 0; i < corner_.size(); ++i) {
            Corner a = corner_[i], b = corner_[(i + 1) % corner_.size()];
            b.edge_class = EdgeClass::kManifold;
            emit({a, b, Corner{centre, EdgeClass::kManifold, {}}});
        }
    }

    void emit(const std::array<Corner, 3>& corners) {
        Triangle triangle;
        uint32_t classes = 0;
        for (size_t k = 0; k < 3; ++k) {
            triangle[k] = corners[k].vertex;
            classes |= uint32_t(corners[k].edge_class) << (2 * k);
        }
        out_.mesh.triangle.push_back(triangle);
        out_.mesh.edge_class.push_back(uint8_t(classes));
        out_.face.push_back(face_);
    }

    const PolygonMesh& polygons_;
    Joined joined_;
    LayerTriangles out_;
    uint32_t face_ = 0;
    Vec3d normal_{0};
    std::array<int, 2> across_{};  // the axes that are left when projected
    bool folds_ = false;           // some ear does
    std::vector<Corner> corner_;   // what is left of the face
    std::vector<std::array<Corner, 3>> ears_;
    std::vector<std::pair<uint32_t, uint32_t>> diagonals_;
};

}  // namespace

LayerTriangles triangulate(const PolygonMesh& polygons) {
    return Triangulator(polygons).run();
}

}  // namespace pietra::cluster
