#include "methods/pmesh/criterion.h"

#include <algorithm>
#include <cmath>

namespace pietra::pmesh {

Criterion criterionOf(const View& view, const Lattice& lattice, double pixels) {
    Criterion criterion;
    const double step = double(1 << lattice.shift);
    const double limit = Criterion::kFarthestEye;
    criterion.eye = Vec3i(glm::round(glm::clamp(view.eye() / step, -limit, limit)));
    const double tan_x = view.size().width / (2 * view.focal_px());
    const double tan_y = view.size().height / (2 * view.focal_px());
    const double reach_of_a_step = view.focal_px() * (1 + tan_x * tan_x + tan_y * tan_y) / pixels;
    const Vec3d forward = -view.back();
    const std::array<Vec3d, 4> side{view.right() + tan_x * forward, -view.right() + tan_x * forward,
                                    view.up() + tan_y * forward, -view.up() + tan_y * forward};
    for (size_t i = 0; i < side.size(); ++i)
        criterion.side[i] =
            Vec3i(glm::normalize(side[i]) * double((1 << Criterion::kSideBits) - 2));
    for (uint32_t code = 1; code < criterion.reach.size(); ++code) {
        const double reach = double(decodeError(code)) * kErrorUnit * reach_of_a_step;
        // One more for the rounding of the eye.
        criterion.reach[code] =
            int32_t(std::min<double>(std::ceil(reach) + 1, Criterion::kFarthest));
    }
    return criterion;
}

Criterion criterionOf(double error, const Lattice& lattice) {
    Criterion criterion;
    criterion.eye = Vec3i(-Criterion::kFarthestEye);
    for (uint32_t code = 1; code < criterion.reach.size(); ++code)
        if (double(decodeError(code)) * kErrorUnit * double(1 << lattice.shift) > error)
            criterion.reach[code] = 4 * Criterion::kFarthest;
    return criterion;
}

}  // namespace pietra::pmesh
