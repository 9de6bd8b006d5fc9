#pragma once
// Which splits a view needs: those whose error, at the point of their box nearest to the eye,
// shows. Outside the picture the tolerance grows with the distance from its pyramid: a sharp cut
// there would force long chains of splits for nothing but order. What faces away, where backs are
// not seen, may be as coarse as if it were kHidden times farther away; so may what the last picture
// hid. It is drawn all the same, and refined as soon as it comes to light.
//
// Floats as they round, no multiply-add: the same on every machine. Monotone in error, box and box
// of normals, as each step is: what encloses a needed criterion is needed.

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "geometry/bounds.h"
#include "methods/pmesh/occlusion.h"
#include "methods/pmesh/split_node.h"
#include "multires/live_model.h"
#include "multires/view.h"

namespace pietra::pmesh {

struct SplitView {
    std::array<float, 3> eye{};                  ///< grid units
    std::array<std::array<float, 3>, 4> side{};  ///< inward normals
    std::array<float, 4> at_eye{};               ///< their products with the eye
    float reach = 0;                             ///< distance from which an error of 1 shows
    /// The eye is outside of all closed parts, which are drawn one-sided: their backs are not seen.
    bool hides_backs = false;
    /// Null: nothing is hidden.
    std::shared_ptr<const Occlusion> occlusion;
    static constexpr float kOutside = 64, kHidden = 8;

    bool shows(const NestedCriterion& c, float from) const {
        float squared = 0, inside = 0;
        for (size_t k = 0; k < 3; ++k) {
            const float d = std::max({float(c.min[k]) - eye[k], eye[k] - float(c.max[k]), 0.0f});
            squared += d * d;
        }
        for (size_t i = 0; i < side.size(); ++i) {
            float depth = -at_eye[i];
            for (size_t k = 0; k < 3; ++k)
                depth += float(side[i][k] > 0 ? c.max[k] : c.min[k]) * side[i][k];
            inside = std::min(inside, depth);
        }
        const float rest = NestedCriterion::errorOf(c.error) * from + inside * kOutside;
        return rest * std::max(rest, 0.0f) > squared;
    }
    /// From everywhere in the box, for all normals in the box of these.
    bool facesAway(const NestedCriterion& c) const {
        float along = 0;
        for (size_t k = 0; k < 3; ++k) {
            const float near = float(c.min[k]) - eye[k], far = float(c.max[k]) - eye[k];
            const auto low = float(c.normals.low(k)), high = float(c.normals.high(k));
            along += std::min({low * near, low * far, high * near, high * far});
        }
        return along > 0;
    }
    /// How large its error is at the near side of the box, where `reach` is that of one pixel: 0
    /// outside of the picture, infinite if the eye is in the box.
    double pixelsOf(const NestedCriterion& c) const {
        double squared = 0;
        for (size_t k = 0; k < 3; ++k) {
            const double d = std::max({double(c.min[k]) - eye[k], double(eye[k]) - c.max[k], 0.0});
            squared += d * d;
        }
        for (size_t i = 0; i < side.size(); ++i) {
            double depth = -double(at_eye[i]);
            for (size_t k = 0; k < 3; ++k)
                depth += double(side[i][k] > 0 ? c.max[k] : c.min[k]) * double(side[i][k]);
            if (depth < 0) return 0;
        }
        return double(NestedCriterion::errorOf(c.error)) * double(reach) / std::sqrt(squared);
    }
    bool needs(const NestedCriterion& c) const {
        if (!shows(c, reach)) return false;
        return !hidesAny() || shows(c, reach * (1 / kHidden)) || !hides(c);
    }
    bool hidesAny() const { return hides_backs || occlusion; }
    bool hides(const NestedCriterion& c) const {
        return (hides_backs && facesAway(c)) || (occlusion && occlusion->hides(c));
    }
};

/// Needed is what shows as more than `pixels`.
SplitView splitView(const View& view, const Lattice& lattice, const SplitGrid& grid, double pixels);
/// Where the eye is outside of the input's bounds, it is outside of all closed parts, whatever is
/// drawn of them.
SplitView splitView(const View& view, const Lattice& lattice, const SplitGrid& grid, double pixels,
                    const Box3i& bounds);
/// All splits, or none.
SplitView wholeSplitView(bool all);
/// All that have to do with anything in a column (multires/live_model.h).
SplitView columnView(const LiveColumn& column, const Lattice& lattice, const SplitGrid& grid);

}  // namespace pietra::pmesh
