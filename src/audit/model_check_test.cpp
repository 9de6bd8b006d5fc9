#include "audit/model_check.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "runtime/export_cut.h"
#include "store/terrain_model.h"

namespace pietra {
namespace {

namespace fs = std::filesystem;

class ModelCheckTest : public ::testing::Test {
protected:
    ModelCheckTest() {
        std::string pattern = (fs::temp_directory_path() / "pietra-check-XXXXXX").string();
        if (::mkdtemp(pattern.data()) == nullptr) std::abort();
        directory_ = pattern;
    }
    ~ModelCheckTest() override { fs::remove_all(directory_); }
    std::string pathTo(const std::string& name) const { return directory_ + "/" + name; }

    ModelCheckReport check(const ToyTerrain& terrain, const std::string& input = "") const {
        writeTerrainModel(terrain, pathTo("model"), directory_);
        return checkFile(input);
    }
    ModelCheckReport checkFile(const std::string& input = "") const {
        const ModelReader model(pathTo("model"));
        ModelCheckSettings settings;
        settings.cuts = 12;
        settings.samples = 50'000;
        settings.temp_dir = directory_;
        if (!input.empty()) settings.input = {pathTo(input)};
        Budget budget(size_t(64) << 20);
        Progress progress;
        ModelCheckReport report = checkModel(model, settings, budget, progress);
        EXPECT_EQ(budget.used(), 0u);
        return report;
    }
    /// A cut of the model as a mesh.
    void write(const std::string& name, const Cut& cut) const {
        const ModelReader model(pathTo("model"));
        const auto writer = createMesh(pathTo(name), true, meshOutputOf(model.info(), cut.triangles));
        Budget budget(size_t(64) << 20);
        Progress progress;
        exportCut(model, cut, *writer, {directory_, 2}, budget, progress);
    }

    std::string directory_;
};

TEST_F(ModelCheckTest, AGoodModelIsGoodAloneAndAgainstItsInput) {
    const ModelCheckReport alone = check(makeToyTerrain());
    EXPECT_TRUE(alone.ok()) << (alone.faults.empty() ? "" : alone.faults[0]);
    EXPECT_FALSE(alone.input);
    EXPECT_EQ(alone.cuts.checked, 12u);
    EXPECT_GT(alone.certificate.samples, 10'000u);

    const ModelReader model(pathTo("model"));
    write("input.ply", finestCut(model.nodes()));
    const ModelCheckReport both = checkFile("input.ply");
    EXPECT_TRUE(both.ok()) << (both.faults.empty() ? "" : both.faults[0]);
    ASSERT_TRUE(both.input);
    EXPECT_EQ(both.input->triangles, finestCut(model.nodes()).triangles);
    EXPECT_GT(both.input->border_edges, 0u);
    EXPECT_GT(both.certificate.samples, 10'000u);
}

TEST_F(ModelCheckTest, AnotherInputIsNoticed) {
    writeTerrainModel(makeToyTerrain(), pathTo("model"), directory_);
    const ModelReader model(pathTo("model"));
    // Leaves some triangles out, within the error that the coarser ones state.
    write("input.ply", cutByTriangles(model.nodes(), finestCut(model.nodes()).triangles - 1));
    const ModelCheckReport report = checkFile("input.ply");
    ASSERT_TRUE(report.input);
    EXPECT_FALSE(report.input->same_surface);
    EXPECT_TRUE(report.input->same_drops);
    EXPECT_FALSE(report.ok());
    ASSERT_FALSE(report.faults.empty());
    EXPECT_NE(report.faults[0].find("the finest cut, of "), std::string::npos);
}

TEST_F(ModelCheckTest, AnErrorStatedTooSmallIsNoticed) {
    ToyTerrain terrain = makeToyTerrain();
    for (Node& node : terrain.nodes) node.error *= 0.3f;
    const ModelCheckReport report = check(terrain);
    EXPECT_TRUE(report.file.ok());
    EXPECT_EQ(report.cuts.faults(), 0u);
    EXPECT_GT(report.certificate.violations, 0u);
    EXPECT_FALSE(report.ok());
}

TEST_F(ModelCheckTest, ACrackIsNoticed) {
    ToyTerrain terrain = makeToyTerrain();
    for (NodeIndex i = 0; i < terrain.nodes.size(); ++i)
        if (i % 3 == 0)
            for (Vec3i& p : terrain.patches[i].position) p.z += 1;
    const ModelCheckReport report = check(terrain);
    EXPECT_GT(report.cuts.cracked_edges, 0u);
    EXPECT_FALSE(report.ok());
}

TEST_F(ModelCheckTest, NothingIsReadFromADamagedModel) {
    writeTerrainModel(makeToyTerrain(), pathTo("model"), directory_);
    std::fstream file(pathTo("model"), std::ios::in | std::ios::out | std::ios::binary);
    const ModelReader model(pathTo("model"));
    file.seekp(std::streamoff(model.page(0).offset + 3));
    file.put('\x55');
    file.close();
    const ModelCheckReport report = checkFile();
    EXPECT_EQ(report.file.pages.bad, 1u);
    EXPECT_EQ(report.cuts.checked, 0u);
    EXPECT_EQ(report.certificate.samples, 0u);
    EXPECT_FALSE(report.ok());
}

}  // namespace
}  // namespace pietra
