#include "runtime/scene_tolerance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pietra {
namespace {

/// A scene whose pages take `full / factor^power` bytes, in lumps.
struct ToyScene {
    double full, power, lump;
    SceneTolerance tolerance;
    void frame(bool same) {
        const double bytes = std::ceil(full / std::pow(tolerance.factor(), power) / lump) * lump;
        const bool blocked = bytes > 1000;
        tolerance.adapt({same, blocked, 0, std::min(bytes, 1000.0) / 1000});
    }
};

TEST(SceneTolerance, settlesWithinTheBudgetAndComesDownAgain) {
    for (const double power : {0.5, 1.0, 2.0})
        for (const double full : {10.0, 1100.0, 30'000.0, 2e6})
            for (const double lump : {1.0, 90.0, 450.0, 900.0}) {
                ToyScene scene{full, power, lump, {}};
                int frames = 0;
                for (scene.frame(false); !scene.tolerance.settled(); scene.frame(true))
                    ASSERT_LT(++frames, 1000) << power << " " << full << " " << lump;
                const double settled = scene.tolerance.factor();
                for (int i = 0; i < 100; ++i) scene.frame(true);
                EXPECT_EQ(scene.tolerance.factor(), settled);
                if (full < 1000) {
                    EXPECT_EQ(settled, 1);
                }
                scene.full = 10;
                scene.lump = 1;
                for (frames = 0; scene.tolerance.factor() > 1; ++frames) {
                    ASSERT_LT(frames, 200);
                    scene.frame(false);
                }
            }
}

}  // namespace
}  // namespace pietra
