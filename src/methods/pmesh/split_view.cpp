#include "methods/pmesh/split_view.h"

namespace pietra::pmesh {

SplitView splitView(const View& view, const Lattice& lattice, const SplitGrid& grid,
                    double pixels) {
    const double unit = grid.unit(lattice);
    const Vec3d eye = view.eye() / unit - Vec3d(grid.origin) / double(uint64_t(1) << grid.shift);
    const double tan_x = view.size().width / (2 * view.focal_px());
    const double tan_y = view.size().height / (2 * view.focal_px());
    const Vec3d forward = -view.back();
    const std::array<Vec3d, 4> side{view.right() + tan_x * forward, -view.right() + tan_x * forward,
                                    view.up() + tan_y * forward, -view.up() + tan_y * forward};
    SplitView out;
    for (int k = 0; k < 3; ++k) out.eye[size_t(k)] = float(eye[k]);
    for (size_t i = 0; i < side.size(); ++i) {
        const Vec3d n = glm::normalize(side[i]);
        for (int k = 0; k < 3; ++k) out.side[i][size_t(k)] = float(n[k]);
        out.at_eye[i] = float(glm::dot(n, eye));
    }
    out.reach = float(view.focal_px() * (1 + tan_x * tan_x + tan_y * tan_y) / pixels);
    return out;
}

SplitView splitView(const View& view, const Lattice& lattice, const SplitGrid& grid, double pixels,
                    const Box3i& bounds) {
    SplitView out = splitView(view, lattice, grid, pixels);
    const Vec3d eye = view.eye();
    out.hides_backs = glm::any(glm::lessThan(eye, Vec3d(bounds.min))) ||
                      glm::any(glm::greaterThan(eye, Vec3d(bounds.max)));
    return out;
}

SplitView wholeSplitView(bool all) {
    SplitView view;
    view.eye.fill(-1);  // not within a box
    view.reach = all ? 1e18f : 1e-18f;
    return view;
}

SplitView columnView(const LiveColumn& column, const Lattice& lattice, const SplitGrid& grid) {
    // The pyramid's four sides are the column's: whole numbers times a power of two, so that
    // nothing rounds, and so large that no error outweighs what lies outside.
    constexpr float kSteep = 0x1p80f;
    SplitView view = wholeSplitView(true);
    for (size_t i = 0; i < 2; ++i) {
        const size_t axis = size_t(column.axis[i]);
        const auto cell = [&](int32_t x) {
            return ((x >> lattice.shift) - grid.origin[int(axis)]) >> grid.shift;
        };
        view.side[2 * i][axis] = kSteep;
        view.at_eye[2 * i] = float(cell(column.low[i])) * kSteep;
        view.side[2 * i + 1][axis] = -kSteep;
        view.at_eye[2 * i + 1] = -float(cell(column.high[i]) + 1) * kSteep;
    }
    return view;
}

}  // namespace pietra::pmesh
