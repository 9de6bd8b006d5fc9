#include "audit/model_audit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "audit/audit_testing.h"
#include "base/error.h"

namespace pietra {
namespace {

const Lattice kLattice{{100, 200, -300}, 0.02, 0};

struct Case {
    ToyTerrain model = makeToyTerrain({.quantisation_error = 0.8661f});
    MemorySource source = sourceOf(model, kLattice, 0.99);

    AuditReport audit(bool with_input = false, AuditOptions options = {.samples = 40000}) {
        Budget budget(64 << 20);
        Progress progress;
        ModelInfo info;
        info.lattice = kLattice;
        options.temp_dir = tempDir();
        const AuditReport report =
            auditModel({model.nodes, info, streamOf(model.patches)}, with_input ? &source : nullptr,
                       options, budget, progress);
        EXPECT_EQ(budget.used(), 0u);
        return report;
    }
};

TEST(ModelAudit, aGoodModelPassesWithAndWithoutItsInput) {
    Case good;
    for (const bool with_input : {false, true}) {
        const AuditReport report = good.audit(with_input, {.samples = 40000, .tightness = true});
        EXPECT_EQ(report.first_fault, "");
        EXPECT_EQ(report.patches.patches, good.model.nodes.size());
        EXPECT_EQ(report.cuts.checked, 10u);
        EXPECT_GT(report.samples(), 30000u);
        EXPECT_LE(report.worstRatio(), 1);
        EXPECT_GT(report.tightness.size(), 2u);
        EXPECT_EQ(report.input.has_value(), with_input);
    }
}

TEST(ModelAudit, namesWhatIsWrong) {
    const auto faultOf = [](bool with_input, const std::function<void(Case&)>& harm) {
        Case bad;
        harm(bad);
        const AuditReport report = bad.audit(with_input);
        EXPECT_EQ(report.ok(), report.first_fault.empty());
        return report.first_fault;
    };
    const auto leaf = [](Case& c) { return finestCut(c.model.nodes).nodes.back(); };
    EXPECT_EQ(faultOf(false, [&](Case& c) { c.model.nodes[0].child[0] = 1 << 20; }),
              "node 0: child 1048576 does not exist");
    EXPECT_EQ(faultOf(false, [&](Case& c) { c.model.patches[3].triangle[0][0] = 77; }),
              "node 3: its patch is malformed");
    EXPECT_EQ(faultOf(false, [&](Case& c) { ++c.model.nodes[4].vertices; }),
              "node 4: its patch has other counts than it states");
    EXPECT_EQ(faultOf(false, [&](Case& c) { c.model.patches[5].position[0].z = -1; }),
              "node 5: a vertex is not on the lattice");
    EXPECT_EQ(faultOf(false, [&](Case& c) { c.model.nodes[6].bounds.radius *= 0.9f; }),
              "node 6: a vertex lies outside its bounds");
    EXPECT_EQ(faultOf(false, [&](Case& c) { c.model.nodes[7].cone.cos_angle = 1; }),
              "node 7: a normal lies outside its cone");
    EXPECT_EQ(faultOf(false, [&](Case& c) { c.model.nodes[0].closed = true; }),
              "node 0: it says closed, but has a border, a fold, or a triangle turned over");
    EXPECT_EQ(faultOf(false,
                      [&](Case& c) {
                          // Without its rim it could be part of something closed...
                          Mesh& mesh = c.model.patches[0];
                          std::fill(mesh.edge_class.begin(), mesh.edge_class.end(), uint8_t(0));
                          c.model.nodes[0].closed = true;
                          // ...were it not for this triangle.
                          std::swap(mesh.triangle[1][0], mesh.triangle[1][1]);
                          c.model.nodes[0].cone.cos_angle = -1;
                      }),
              "node 0: it says closed, but has a border, a fold, or a triangle turned over");
    const std::string torn = faultOf(false, [&](Case& c) { c.model.nodes[8].error *= 1.01f; });
    EXPECT_NE(torn.find("differs from node 8 of its group"), std::string::npos) << torn;
    // A hole of one triangle, in all cuts that draw that leaf; counts made to fit.
    const std::string hole = faultOf(false, [&](Case& c) {
        Mesh& mesh = c.model.patches[leaf(c)];
        mesh.triangle.pop_back();
        mesh.edge_class.pop_back();
        --c.model.nodes[leaf(c)].triangles;
    });
    EXPECT_TRUE(hole.starts_with("the finest cut: ")) << hole;
    EXPECT_NE(hole.find(" cracked edges, the first between lattice points ("), std::string::npos);
    const std::string untrue = faultOf(false, [&](Case& c) {
        for (Node& node : c.model.nodes) node.error *= 0.3f;
    });
    EXPECT_NE(untrue.find(" samples violate the stated error, the first at"), std::string::npos)
        << untrue;
    EXPECT_EQ(faultOf(true, [&](Case& c) { c.source.triangles.pop_back(); }),
              "the finest cut is not the input");
    EXPECT_EQ(faultOf(true, [&](Case& c) { c.source.vertices.position[5].x += 0.03; }),
              "the finest cut is not the input");
}

TEST(ModelAudit, keepsWithinASmallBudget) {
    Case good;
    Budget budget(6 << 20);
    Progress progress;
    ModelInfo info;
    info.lattice = kLattice;
    AuditOptions options;
    options.temp_dir = tempDir();
    const AuditReport report = auditModel({good.model.nodes, info, streamOf(good.model.patches)},
                                          &good.source, options, budget, progress);
    EXPECT_EQ(report.first_fault, "");
    EXPECT_GT(report.samples(), 10000u);
    EXPECT_LE(budget.peak(), 6u << 20);
}

TEST(ModelAudit, emptyModel) {
    Budget budget(64 << 20);
    Progress progress;
    const PatchStream nothing = [](std::span<const NodeIndex>, const PatchVisitor&) {};
    EXPECT_TRUE(auditModel({{}, {}, nothing}, nullptr, {}, budget, progress).ok());
}

}  // namespace
}  // namespace pietra
