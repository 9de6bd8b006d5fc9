#include "runtime/pick.h"

#include <gtest/gtest.h>

#include <random>

#include "base/scratch_directory.h"
#include "multires/cut.h"
#include "runtime/patch_reader.h"
#include "store/terrain_model.h"

namespace pietra {
namespace {

/// By the other way: the height of the finest surface over a point, from its plane.
double heightAt(const ModelReader& model, const Vec2d& at) {
    double height = -1;
    visitInOrder(model, finestCut(model.nodes()).nodes, 1, [&](DecodedRun& run) {
        for (const Mesh& mesh : run.patches)
            for (const Triangle& t : mesh.triangle) {
                const Vec3d a(mesh.position[t[0]]), b(mesh.position[t[1]]), c(mesh.position[t[2]]);
                const auto area = [](const Vec3d& p, const Vec3d& q, const Vec3d& r) {
                    return (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
                };
                const Vec3d p(at, 0);
                const double u = area(p, b, c), v = area(a, p, c), w = area(a, b, p);
                if (u >= 0 && v >= 0 && w >= 0)
                    height = (u * a.z + v * b.z + w * c.z) / area(a, b, c);
            }
    });
    return height;
}

class PickTest : public ::testing::Test {
protected:
    PickTest() {
        ToyTerrainSettings settings;
        settings.depth = 8;
        writeTerrainModel(makeToyTerrain(settings), path_, scratch_.path(), {0, 0, 0});
        model_.emplace(path_);
    }
    const Lattice& lattice() const { return model_->info().lattice; }

    const ScratchDirectory scratch_;
    const std::string path_ = scratch_.file("model");
    std::optional<ModelReader> model_;
};

TEST_F(PickTest, aRayFromAboveMeetsTheFinestSurface) {
    const Box3i box = model_->info().bounds;
    const ModelReader* models[] = {&*model_};
    std::mt19937 random(1);
    std::uniform_real_distribution<double> unit(0.01, 0.99);
    for (int i = 0; i < 50; ++i) {
        const Vec2d at = Vec2d(box.min) +
                         Vec2d(unit(random), unit(random)) * Vec2d(Vec2i(box.max) - Vec2i(box.min));
        const Vec3d eye = lattice().toInput(Vec3d(at, box.max.z + 1000.0));
        const auto point = pickFinest(models, eye, {0, 0, -2});
        ASSERT_TRUE(point);
        const Vec3d found = lattice().toLattice(*point);
        EXPECT_NEAR(found.x, at.x, 1e-6);
        EXPECT_NEAR(found.z, heightAt(*model_, at), 1e-6);
        EXPECT_FALSE(pickFinest(models, eye, {0, 0, 1}));
    }
}

TEST_F(PickTest, theNearestOfSeveralModelsIsFound) {
    const ModelReader* models[] = {&*model_, &*model_};
    const Box3i box = model_->info().bounds;
    const Vec3d eye = lattice().toInput(Vec3d(box.min) - Vec3d(100, 90, -400));
    const Vec3d middle = lattice().toInput(0.5 * (Vec3d(box.min) + Vec3d(box.max)));
    const auto point = pickFinest(models, eye, middle - eye);
    ASSERT_TRUE(point);
    EXPECT_LE(glm::length(*point - eye), glm::length(middle - eye) + lattice().step * 500);
}

}  // namespace
}  // namespace pietra
