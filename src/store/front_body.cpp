#include "store/front_body.h"

namespace pietra {

namespace {

/// encodeNormal of geometry/octahedral.h, at any number of bits, in double.
std::array<int32_t, 2> octahedral(const Vec3d& n, double top) {
    const double sum = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
    if (sum == 0) return {0, 0};
    const double scale = top / sum;
    double x = n.x * scale, y = n.y * scale;
    if (n.z < 0) {
        const double folded = (top - std::abs(y)) * (x < 0 ? -1.0 : 1.0);
        y = (top - std::abs(x)) * (y < 0 ? -1.0 : 1.0);
        x = folded;
    }
    return {int32_t(std::floor(x + 0.5)), int32_t(std::floor(y + 0.5))};
}

}  // namespace

void predictNormals(const FrontPatch& patch, int bits, std::vector<std::array<int32_t, 2>>& codes) {
    thread_local std::vector<Vec3d> sum;
    sum.assign(patch.vertices, Vec3d(0));
    for (const Triangle& t : patch.triangle) {
        const Vec3i &a = patch.position[t[0]], &b = patch.position[t[1]], &c = patch.position[t[2]];
        const Vec3d normal = glm::cross(Vec3d(b - a), Vec3d(c - a));
        for (const uint32_t v : t) sum[v] += normal;
    }
    codes.resize(patch.vertices);
    const double top = double((1 << (bits - 1)) - 1);
    for (uint32_t v = 0; v < patch.vertices; ++v) codes[v] = octahedral(sum[v], top);
}

}  // namespace pietra
