#include "simplify/deviation_surface.h"

#include <cmath>
#include <limits>

namespace pietra::deviation {

namespace {

constexpr uint32_t kBlockFaces = 16;

float squaredDistanceToBox(const Vec3f& p, const Vec3f& min, const Vec3f& max) {
    const Vec3f outside = glm::max(glm::max(min - p, p - max), Vec3f(0));
    return glm::dot(outside, outside);
}

}  // namespace

void Surface::assign(const Mesh& mesh) {
    mesh_ = &mesh;
    blocks_valid_ = false;
    face_.resize(mesh.triangle.size());
    face_at_.assign(mesh.position.size(), kNone);
    for (uint32_t f = 0; f < face_.size(); ++f) {
        face_[f].vertex = mesh.triangle[f];
        face_[f].opposite = {kNone, kNone, kNone};
        for (const uint32_t v : mesh.triangle[f]) face_at_[v] = f;
    }
    linkNeighbours();
    computeNormals();
}

// Half-edges are listed by their lower vertex; a second one with the same upper vertex is the
// opposite. A third marks all of them as having none.
void Surface::linkNeighbours() {
    first_at_vertex_.assign(vertexCount(), kNone);
    next_half_edge_.resize(3 * size_t(faceCount()));
    for (uint32_t f = 0; f < faceCount(); ++f) {
        for (int k = 0; k < 3; ++k) {
            const uint32_t a = face_[f].vertex[k], b = face_[f].vertex[(k + 1) % 3];
            const uint32_t low = std::min(a, b), high = std::max(a, b);
            const uint32_t half_edge = 3 * f + k;
            uint32_t twin = first_at_vertex_[low];
            const auto upper = [&](uint32_t h) {
                const Face& other = face_[h / 3];
                return std::max(other.vertex[h % 3], other.vertex[(h % 3 + 1) % 3]);
            };
            bool many = false;
            uint32_t found = kNone;
            for (; twin != kNone; twin = next_half_edge_[twin]) {
                if (upper(twin) != high) continue;
                many = found != kNone;
                found = twin;
                const uint32_t partner = face_[twin / 3].opposite[twin % 3];
                if (partner != kNone || many) {
                    many = true;
                    if (partner != kNone) face_[partner / 3].opposite[partner % 3] = kNone;
                    face_[twin / 3].opposite[twin % 3] = kNone;
                }
            }
            if (found != kNone && !many) {
                face_[f].opposite[k] = found;
                face_[found / 3].opposite[found % 3] = half_edge;
            }
            next_half_edge_[half_edge] = first_at_vertex_[low];
            first_at_vertex_[low] = half_edge;
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
        face.normal = length_sq > 0 ? Vec3f(n / std::sqrt(length_sq)) : Vec3f(0);
    }
}

void Surface::buildBlocks() const {
    if (blocks_valid_) return;
    blocks_valid_ = true;
    block_.clear();
    for (uint32_t begin = 0; begin < faceCount(); begin += kBlockFaces) {
        const uint32_t end = std::min(begin + kBlockFaces, faceCount());
        Block block{Vec3f(std::numeric_limits<float>::max()),
                    Vec3f(std::numeric_limits<float>::lowest())};
        for (uint32_t f = begin; f < end; ++f) {
            for (int k = 0; k < 3; ++k) {
                block.min = glm::min(block.min, Vec3f(corner(f, k)));
                block.max = glm::max(block.max, Vec3f(corner(f, k)));
            }
        }
        block_.push_back(block);
    }
}

Surface::Nearest Surface::nearest(const Vec3i& origin, const Vec3f& p,
                                  std::span<const float> offset, Nearest best) const {
    buildBlocks();
    const Vec3f shift(origin);  // exact: lattice coordinates fit a float
    for (uint32_t b = 0; b < block_.size(); ++b) {
        const Block& block = block_[b];
        if (squaredDistanceToBox(p, block.min - shift, block.max - shift) >=
            best.value * best.value) {
            continue;
        }
        const uint32_t end = std::min((b + 1) * kBlockFaces, faceCount());
        for (uint32_t f = b * kBlockFaces; f < end; ++f) {
            const float value = std::sqrt(squaredDistance(p, local(f, origin))) +
                                (offset.empty() ? 0.0f : offset[f]);
            if (value < best.value) best = {f, value};
        }
    }
    return best;
}

}  // namespace pietra::deviation
