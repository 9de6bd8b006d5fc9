#include "simplify/deviation_surface.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace pietra::deviation {

namespace {

/// Faces under one box. Faces that follow each other are near each other in any sensible mesh;
/// where they are not, the search is slower but right.
constexpr uint32_t kRun = 1;

}  // namespace

void Surface::assign(const Mesh& mesh) {
    tree_valid_ = false;
    removed_.clear();
    vertex_.resize(mesh.position.size());
    for (size_t v = 0; v < vertex_.size(); ++v) {
        const Vec3i& p = mesh.position[v];
        vertex_[v].lanes = {0, float(p.x), float(p.y), float(p.z)};
    }
    face_.resize(mesh.triangle.size());
    for (uint32_t f = 0; f < face_.size(); ++f) {
        face_[f].vertex = mesh.triangle[f];
        face_[f].opposite = {};
    }
    listHalfEdges();
    linkNeighbours();
    computeNormals();
}

void Surface::remove(uint32_t f) {
    for (HalfEdge& opposite : face_[f].opposite) {
        if (opposite.exists()) face_[opposite.face()].opposite[opposite.edge()] = {};
        opposite = {};
    }
    removed_.resize(faceCount(), 0);
    removed_[f] = 1;
    tree_valid_ = false;
}

// Counting sort by the vertex where they begin.
void Surface::listHalfEdges() {
    first_out_.assign(vertexCount() + 2, 0);
    for (const Face& face : face_) {
        for (const uint32_t v : face.vertex) ++first_out_[v + 2];
    }
    for (size_t v = 2; v < first_out_.size(); ++v) first_out_[v] += first_out_[v - 1];
    const size_t count = 3 * size_t(faceCount());
    out_target_.resize(count + kMatchWidth, kNone);
    out_.resize(count);
    for (uint32_t f = 0; f < faceCount(); ++f) {
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t at = first_out_[face_[f].vertex[k] + 1]++;
            out_target_[at] = face_[f].vertex[nextCorner(k)];
            out_[at] = HalfEdge(f, k);
        }
    }
}

// The only half-edge from `from` to `to`, or kNone if there are none or several: its place in out_.
uint32_t Surface::onlyHalfEdge(uint32_t from, uint32_t to) const {
    const uint32_t begin = first_out_[from], end = first_out_[from + 1];
    if (end - begin <= kMatchWidth) {  // reads beyond the end, which is masked
        const uint32_t* target = out_target_.data() + begin;
        const uint32_t equal = equalLanes(target, to) | equalLanes(target + 4, to) << 4;
        const uint32_t found = equal & ((1u << (end - begin)) - 1);
        return found != 0 && (found & (found - 1)) == 0 ? begin + uint32_t(std::countr_zero(found))
                                                        : kNone;
    }
    uint32_t found = kNone;
    for (uint32_t i = begin; i < end; ++i) {
        if (out_target_[i] != to) continue;
        if (found != kNone) return kNone;
        found = i;
    }
    return found;
}

void Surface::linkNeighbours() {
    for (uint32_t f = 0; f < faceCount(); ++f) {
        Face& face = face_[f];
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t a = face.vertex[k], b = face.vertex[nextCorner(k)];
            if (a >= b) continue;  // seen from the other side, or no edge at all
            const uint32_t back = onlyHalfEdge(b, a);
            if (back == kNone) continue;
            const HalfEdge twin = out_[back];
            if (onlyHalfEdge(a, b) == kNone) continue;
            face.opposite[k] = twin;
            face_[twin.face()].opposite[twin.edge()] = HalfEdge(f, k);
        }
    }
}

// In double the cross product of lattice differences is exact.
void Surface::computeNormals() {
    for (Face& face : face_) {
        const Vec3d a(position(face.vertex[0]));
        const Vec3d n =
            glm::cross(Vec3d(position(face.vertex[1])) - a, Vec3d(position(face.vertex[2])) - a);
        const double length_sq = glm::dot(n, n);
        const double inverse = length_sq > 0 ? 1 / std::sqrt(length_sq) : 0;
        face.area_normal = {float(inverse), float(n.x * inverse), float(n.y * inverse),
                            float(n.z * inverse)};
    }
}

Lanes4 Surface::BoxGroup::squaredDistance(const Vec3f& p) const {
    Lanes4 sum{};
    for (int k = 0; k < 3; ++k) {
        const Lanes4 outside = maxLanes(maxLanes(min[k] - p[k], p[k] - max[k]), Lanes4{});
        sum += outside * outside;
    }
    return sum;
}

void Surface::buildTree() const {
    if (tree_valid_) return;
    tree_valid_ = true;
    constexpr float kFar = 1e18f;  // an empty box is far from everything, its square is finite
    BoxGroup empty;
    empty.min.fill(Lanes4{kFar, kFar, kFar, kFar});
    empty.max.fill(Lanes4{-kFar, -kFar, -kFar, -kFar});
    const auto add = [](BoxGroup& group, uint32_t lane, const Vec3f& min, const Vec3f& max) {
        for (int k = 0; k < 3; ++k) {
            group.min[k][lane] = std::min(group.min[k][lane], min[k]);
            group.max[k][lane] = std::max(group.max[k][lane], max[k]);
        }
    };
    if (tree_.empty()) tree_.emplace_back();
    tree_[0].assign((faceCount() + 4 * kRun - 1) / (4 * kRun), empty);
    for (uint32_t f = 0; f < faceCount(); ++f) {
        if (isRemoved(f)) continue;
        const Vec3f a = corner(f, 0), b = corner(f, 1), c = corner(f, 2);
        add(tree_[0][f / (4 * kRun)], f / kRun % 4, glm::min(glm::min(a, b), c),
            glm::max(glm::max(a, b), c));
    }
    size_t level = 0;
    for (; tree_[level].size() > 1; ++level) {
        if (tree_.size() == level + 1) tree_.emplace_back();
        const size_t count = tree_[level].size();
        tree_[level + 1].assign((count + 3) / 4, empty);
        for (size_t g = 0; g < count; ++g) {
            const BoxGroup& group = tree_[level][g];
            for (int lane = 0; lane < 4; ++lane) {
                add(tree_[level + 1][g / 4], uint32_t(g % 4),
                    {group.min[0][lane], group.min[1][lane], group.min[2][lane]},
                    {group.max[0][lane], group.max[1][lane], group.max[2][lane]});
            }
        }
    }
    tree_.resize(level + 1);
}

void Surface::search(size_t level, uint32_t group, const Vec3f& at, const Vec3f& origin,
                     const Vec3f& p, std::span<const float> offset, Nearest& best) const {
    const Lanes4 distance = tree_[level][group].squaredDistance(at);
    std::array<bool, 4> done{};
    for (int turn = 0; turn < 4; ++turn) {
        int lane = -1;
        for (int i = 0; i < 4; ++i) {
            if (!done[i] && (lane < 0 || distance[i] < distance[lane])) lane = i;
        }
        if (!(distance[lane] < best.value * best.value)) return;
        done[lane] = true;
        const uint32_t child = 4 * group + lane;
        if (level > 0) {
            search(level - 1, child, at, origin, p, offset, best);
            continue;
        }
        const uint32_t end = std::min((child + 1) * kRun, faceCount());
        for (uint32_t f = child * kRun; f < end; ++f) {
            const float value = std::sqrt(squaredDistance(p, local(f, origin))) +
                                (offset.empty() ? 0.0f : offset[f]);
            if (value < best.value) best = {f, value};
        }
    }
}

// The boxes are in absolute coordinates: they may be missed by what a float of those loses. It is
// only the search for something better that misses it.
Surface::Nearest Surface::nearest(const Vec3f& origin, const Vec3f& p,
                                  std::span<const float> offset, Nearest best) const {
    buildTree();
    search(tree_.size() - 1, 0, origin + p, origin, p, offset, best);
    return best;
}

}  // namespace pietra::deviation
