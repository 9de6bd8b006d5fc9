#pragma once
// Which operations a view needs: those whose error, at the point of their sphere nearest to the
// eye, shows. Outside the picture the tolerance grows with the distance from its pyramid: a sharp
// cut there would force long chains of splits for nothing but order. What the last picture hid has
// a larger one, too; it is drawn all the same, and refined as soon as it comes to light. So has
// what faces away, where backs are not seen: from all eyes as near as that in all of the sphere.
//
// Integers only, so every body of the adaption decides alike; and monotone in error and sphere, so
// that what saturation ordered stays in order, also where a comparison is close: a sphere within
// another is neither nearer to the eye nor to the pyramid, as the sides' normals are no longer than
// one, and rounding down is monotone; and a box of normals within another has no longer vectors, so
// that it faces away by no less.

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>

#include "methods/pmesh/active_mesh.h"
#include "methods/pmesh/occlusion.h"
#include "multires/view.h"

namespace pietra::pmesh {

struct Criterion {
    /// In steps; each coordinate within +-kFarthestEye.
    Vec3i eye{0, 0, 0};
    /// For each code of an error: the distance in steps, at most kFarthest, from which it shows. 0
    /// for code 0: there is no operation.
    std::array<int32_t, 256> reach{};

    /// Inward normals of the picture's sides, through the eye, in units of 2^-kSideBits, rounded
    /// towards zero; all zero: everything is in the picture.
    std::array<Vec3i, 4> side{};
    static constexpr int kSideBits = 14;
    /// Outside the picture by some distance is as if that many times farther away.
    static constexpr int64_t kOutside = 8;

    /// Null: nothing is hidden.
    std::shared_ptr<const Occlusion> occlusion;
    /// The eye is outside of all closed parts, which are drawn one-sided: their backs are not seen.
    bool hides_backs = false;
    /// What is hidden or faces away is as if 2^kHiddenBits times farther away.
    static constexpr int kHiddenBits = 3;

    static constexpr int32_t kFarthestEye = 1 << 24, kFarthest = 1 << 25;

    /// `normals`: NormalBox::word().
    bool needs(const Vec3i& centre, uint32_t error, uint32_t radius_code, uint32_t normals) const {
        const Vec3l d(centre - eye);  // below 2^25 each
        const auto radius = int64_t(decodeRounded<11>(radius_code));
        if (!shows(d, reach[error], radius)) return false;
        if ((!occlusion && !hides_backs) || shows(d, reach[error] >> kHiddenBits, radius))
            return true;
        if (hides_backs && facesAway(d, radius, normals)) return false;
        // With the error, so that what is coarser there stays behind what hides it.
        return !occlusion ||
               !occlusion->hides(centre, radius + int64_t(decodeError(error) / 64) + 1);
    }
    /// At the tolerance that `reach_of_error` is of.
    bool shows(const Vec3l& d, int64_t reach_of_error, int64_t radius) const {
        const int64_t distance = reach_of_error + radius;
        const int64_t squared = d.x * d.x + d.y * d.y + d.z * d.z;
        if (distance * distance <= squared) return false;
        int64_t inside = 0;
        for (const Vec3i& n : side) {
            const int64_t depth = (n.x * d.x + n.y * d.y + n.z * d.z) >> kSideBits;
            inside = std::min(inside, depth + radius);
        }
        const int64_t rest = distance + kOutside * inside;
        return rest > 0 && rest * rest > squared;
    }
    /// From everywhere in the sphere; sums are below 2^31.
    static bool facesAway(const Vec3l& d, int64_t radius, uint32_t normals) {
        const NormalBox box = NormalBox::ofBits(normals);
        int64_t along = 0;
        for (int k = 0; k < 3; ++k)
            along += std::min(box.low(size_t(k)) * d[k], box.high(size_t(k)) * d[k]);
        return 2 * along > int64_t(normals >> 24) * radius;
    }
    bool needsSplit(const Vertex& v, const VertexCriteria& c) const {
        return needs(v.position(), c.split_error, c.split_radius, c.split_normals);
    }
    /// False only if the operation that the vertex came from is not needed, maybe.
    bool needsLast(const Vertex& v, const VertexCriteria& c) const {
        return c.merge_radius >= VertexCriteria::kBlocked ||
               needs(v.position(), c.merge_error, c.merge_radius, c.merge_normals);
    }
};

/// Needed is what shows as more than `pixels`. An eye beyond kFarthestEye is moved there.
Criterion criterionOf(const View& view, const Lattice& lattice, double pixels);
/// Needed is what states more than `error`, in lattice units, wherever it is.
Criterion criterionOf(double error, const Lattice& lattice);

}  // namespace pietra::pmesh
