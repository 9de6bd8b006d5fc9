#include "simplify/deviation_surface.h"

#include <cmath>
#include <limits>

namespace pietra::deviation {

namespace {

constexpr uint32_t kBlockFaces = 8;

float squaredDistanceToBox(const Vec3f& p, const Vec3f& min, const Vec3f& max) {
    const Vec3f outside = glm::max(glm::max(min - p, p - max), Vec3f(0));
    return glm::dot(outside, outside);
}

}  // namespace

void Surface::assign(const Mesh& mesh) {
    blocks_valid_ = false;
    vertex_.resize(mesh.position.size());
    for (size_t v = 0; v < vertex_.size(); ++v) {
        const Vec3f p(mesh.position[v]);
        vertex_[v].xyz0 = {p.x, p.y, p.z, 0};
    }
    face_.resize(mesh.triangle.size());
    face_at_.assign(mesh.position.size(), kNone);
    for (uint32_t f = 0; f < face_.size(); ++f) {
        face_[f].vertex = mesh.triangle[f];
        face_[f].opposite = {};
        for (const uint32_t v : mesh.triangle[f]) face_at_[v] = f;
    }
    linkNeighbours();
    computeNormals();
}

// Half-edges are listed by their lower vertex; the first of each pair of vertices stands for all. A
// second one is its opposite if it runs the other way; whatever comes later undoes the pair.
void Surface::linkNeighbours() {
    first_link_.assign(vertexCount(), kNone);
    link_.resize(3 * size_t(faceCount()));
    uint32_t used = 0;
    for (uint32_t f = 0; f < faceCount(); ++f) {
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t a = face_[f].vertex[k], b = face_[f].vertex[nextCorner(k)];
            const uint32_t low = std::min(a, b), high = std::max(a, b);
            uint32_t i = first_link_[low];
            while (i != kNone && link_[i].upper != high) i = link_[i].next;
            if (i == kNone) {
                link_[used] = {high, HalfEdge(f, k), first_link_[low], a < b, false};
                first_link_[low] = used++;
                continue;
            }
            Link& link = link_[i];
            HalfEdge& other = face_[link.half_edge.face()].opposite[link.half_edge.edge()];
            if (link.taken) {
                if (other.exists()) face_[other.face()].opposite[other.edge()] = {};
                other = {};
            } else if (link.ascending != (a < b)) {
                other = HalfEdge(f, k);
                face_[f].opposite[k] = link.half_edge;
            }
            link.taken = true;
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
        face.normal = Vec3f(n * inverse);
        face.inverse_area = float(inverse);
    }
}

void Surface::buildBlocks() const {
    if (blocks_valid_) return;
    blocks_valid_ = true;
    constexpr Block kEmpty{Vec3f(std::numeric_limits<float>::max()),
                           Vec3f(std::numeric_limits<float>::lowest())};
    const auto blocksOf = [](size_t count) { return (count + kBlockFaces - 1) / kBlockFaces; };
    size_t levels = 0;
    for (size_t count = blocksOf(faceCount());; count = blocksOf(count)) {
        if (blocks_.size() == levels) blocks_.emplace_back();
        blocks_[levels].assign(count, kEmpty);
        ++levels;
        if (count <= kBlockFaces) break;
    }
    blocks_.resize(levels);
    for (uint32_t f = 0; f < faceCount(); ++f) {
        Block& block = blocks_[0][f / kBlockFaces];
        for (int k = 0; k < 3; ++k) {
            block.min = glm::min(block.min, corner(f, k));
            block.max = glm::max(block.max, corner(f, k));
        }
    }
    for (size_t level = 1; level < levels; ++level) {
        for (size_t b = 0; b < blocks_[level - 1].size(); ++b) {
            Block& block = blocks_[level][b / kBlockFaces];
            block.min = glm::min(block.min, blocks_[level - 1][b].min);
            block.max = glm::max(block.max, blocks_[level - 1][b].max);
        }
    }
}

void Surface::searchBlock(size_t level, uint32_t block, const Vec3f& origin, const Vec3f& p,
                          std::span<const float> offset, Nearest& best) const {
    const Block& box = blocks_[level][block];
    if (squaredDistanceToBox(p, box.min - origin, box.max - origin) >= best.value * best.value) {
        return;
    }
    const uint32_t below = level > 0 ? uint32_t(blocks_[level - 1].size()) : faceCount();
    const uint32_t end = std::min((block + 1) * kBlockFaces, below);
    for (uint32_t i = block * kBlockFaces; i < end; ++i) {
        if (level > 0) {
            searchBlock(level - 1, i, origin, p, offset, best);
            continue;
        }
        const float value = std::sqrt(squaredDistance(p, local(i, origin))) +
                            (offset.empty() ? 0.0f : offset[i]);
        if (value < best.value) best = {i, value};
    }
}

Surface::Nearest Surface::nearest(const Vec3f& origin, const Vec3f& p,
                                  std::span<const float> offset, Nearest best) const {
    buildBlocks();
    const size_t top = blocks_.size() - 1;
    for (uint32_t b = 0; b < blocks_[top].size(); ++b) searchBlock(top, b, origin, p, offset, best);
    return best;
}

}  // namespace pietra::deviation
