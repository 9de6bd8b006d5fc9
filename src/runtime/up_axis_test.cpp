#include "runtime/up_axis.h"

#include <gtest/gtest.h>

#include <numbers>

namespace pietra {
namespace {

/// A cone on its base, or without one, whose tip points along z; with y up it is turned.
Surface cone(bool with_base, UpAxis up) {
    Surface surface;
    const auto add = [&](Vec3d p, Vec3d n) {
        if (up == UpAxis::kY) p = {p.x, p.z, -p.y}, n = {n.x, n.z, -n.y};
        surface.points.push_back({p, n});
    };
    for (int i = 0; i < 2000; ++i) {
        const double angle = 2 * std::numbers::pi * i / 100, h = double(i) / 2000;
        const Vec3d side(std::cos(angle), std::sin(angle), 0);
        add(side * (1 - h) + Vec3d(0, 0, 1.2 * h), glm::normalize(side + Vec3d(0, 0, 0.8)));
        if (with_base) add(side * h, {0, 0, -1});
    }
    return surface;
}

TEST(UpAxis, isWhereAModelStands) {
    for (const UpAxis up : {UpAxis::kY, UpAxis::kZ})
        for (const bool with_base : {false, true}) EXPECT_EQ(guessUpAxis(cone(with_base, up)), up);
}

TEST(UpAxis, ofWhatIsFlatIsAcrossIt) {
    for (const UpAxis up : {UpAxis::kY, UpAxis::kZ}) {
        Surface relief = cone(true, up == UpAxis::kY ? UpAxis::kZ : UpAxis::kY);
        for (Surface::Point& p : relief.points) p.position[up == UpAxis::kY ? 1 : 2] *= 0.1;
        EXPECT_EQ(guessUpAxis(relief), up);
    }
}

TEST(UpAxis, isZWhereNothingTells) {
    EXPECT_EQ(guessUpAxis({}), UpAxis::kZ);
    Surface ball;
    for (int i = 0; i < 1000; ++i) {
        const double z = 2 * (i + 0.5) / 1000 - 1, angle = 2.4 * i, r = std::sqrt(1 - z * z);
        const Vec3d n(r * std::cos(angle), r * std::sin(angle), z);
        ball.points.push_back({n, n});
    }
    EXPECT_EQ(guessUpAxis(ball), UpAxis::kZ);
}

}  // namespace
}  // namespace pietra
