#include "audit/conformance_inputs.h"

#include <gtest/gtest.h>

#include "audit/audit_testing.h"
#include "audit/input_survey.h"

namespace pietra {
namespace {

/// The inputs are what they are called: counted by the survey, on a lattice that fits each.
TEST(ConformanceInputs, areWhatTheyAreCalled) {
    struct Expected {
        const char* name;
        bool border;
        uint64_t degenerate, duplicate;
    };
    const std::vector<Expected> expected = {
        {"ball", false, 0, 0},
        {"sheet with holes", true, 0, 0},
        {"shuffled soup of squares", true, 0, 0},
        {"flat", true, 0, 0},
        {"dust", false, 0, 0},
        {"non-manifold", true, 0, 0},
        {"dirty", true, 52, 78},
        {"one triangle", true, 0, 0},
    };
    const std::vector<ConformanceInput> inputs = conformanceInputs();
    ASSERT_EQ(inputs.size(), expected.size());
    for (size_t k = 0; k < inputs.size(); ++k) {
        SCOPED_TRACE(inputs[k].name);
        const std::unique_ptr<TriangleSource> source = inputs[k].open();
        Budget budget(64 << 20);
        InputTriangles triangles(*source, budget, 8 << 20, tempDir());
        Box3d box;
        triangles.forEachBatch([&](uint64_t, std::span<const InputTriangles::Corners> batch) {
            for (const InputTriangles::Corners& t : batch)
                for (const Vec3d& p : t) box.add(p);
        });
        const Vec3d size = box.max - box.min;
        const Lattice lattice{box.min, std::max({size.x, size.y, size.z}) / kLatticeMax, 0};
        const InputSurvey survey = surveyInput(triangles, lattice, budget, 16 << 20, tempDir());
        EXPECT_EQ(inputs[k].name, expected[k].name);
        EXPECT_EQ(!survey.border.empty(), expected[k].border);
        EXPECT_EQ(survey.degenerate, expected[k].degenerate);
        EXPECT_EQ(survey.duplicate, expected[k].duplicate);
    }
}

}  // namespace
}  // namespace pietra
