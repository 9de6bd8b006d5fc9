#include "methods/cluster/placement.h"

#include <algorithm>
#include <cmath>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

namespace pietra::cluster {

namespace {

/// What staying counts beside the planes: keeps places on flat surfaces and along ridges.
constexpr double kStay = 0.03;
/// Of the way to the nearest vertex, at most.
constexpr double kReach = 0.5;

}  // namespace

std::vector<MovedAnchor> moveAnchors(PolygonMesh& mesh, const Box3i& room) {
    // By vertex: the planes' normal equations, and how far the next vertex is.
    struct Place {
        glm::dmat3 a{0};
        Vec3d b{0};
        double area = 0, nearest_sq = HUGE_VAL;
    };
    std::vector<Place> places(mesh.vertexCount());
    std::vector<uint8_t> fixed(mesh.vertexCount());
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v)
        fixed[v] = mesh.interface_[v] || mesh.irregular[v];
    for (uint32_t f = 0; f < mesh.faceCount(); ++f) {
        const FaceShape& shape = mesh.shape[f];
        const double length = glm::length(shape.normal);
        const Vec3d normal = length > 0 ? shape.normal / length : Vec3d(0);
        const glm::dmat3 plane = shape.area * glm::outerProduct(normal, normal);
        for (uint32_t h = mesh.face_begin[f]; h < mesh.face_begin[f + 1]; ++h) {
            const uint32_t v = mesh.corner[h], w = mesh.end(h);
            if (mesh.twin[h] == kNone) fixed[v] = fixed[w] = 1;
            const Vec3d p(mesh.position[v]), edge = Vec3d(mesh.position[w]) - p;
            Place& place = places[v];
            place.a += plane;
            place.b += shape.area * glm::dot(normal, shape.centroid() - p) * normal;
            place.area += shape.area;
            place.nearest_sq = std::min(place.nearest_sq, glm::dot(edge, edge));
        }
    }
    std::vector<MovedAnchor> moved;
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v) {
        Place& place = places[v];
        if (fixed[v] || !(place.area > 0)) continue;
        for (int k = 0; k < 3; ++k) place.a[k][k] += kStay * place.area;
        Vec3d way = glm::inverse(place.a) * place.b;
        const double most = kReach * std::sqrt(place.nearest_sq), length = glm::length(way);
        if (length > most) way *= most / length;
        const Vec3i p(glm::floor(Vec3d(mesh.position[v]) + way + 0.5));
        if (p == mesh.position[v] || p != glm::clamp(p, room.min, room.max)) continue;
        moved.push_back({v, mesh.position[v]});
        mesh.position[v] = p;
    }
    return moved;
}

}  // namespace pietra::cluster
