// Reading the patches of a cut, and writing a cut as a mesh.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>

#include "base/check.h"
#include "base/error.h"
#include "runtime/export_cut.h"
#include "runtime/patch_reader.h"
#include "store/model_writer.h"
#include "store/page_codec.h"

namespace pietra {
namespace {

namespace fs = std::filesystem;

constexpr int kSide = 24;    // quads of a patch's side
constexpr int kPatches = 4;  // patches of a side of the sheet

/// Patch (px, py) of a wavy sheet that goes around in x: neighbours share their border vertices.
Mesh sheetPatch(int px, int py) {
    Mesh mesh;
    const auto normal_of = [](int x, int y) {
        return encodeNormal({float(x % 7), float(y % 5), 9});
    };
    for (int y = 0; y <= kSide; ++y)
        for (int x = 0; x <= kSide; ++x) {
            const int gx = (px * kSide + x) % (kPatches * kSide), gy = py * kSide + y;
            mesh.position.push_back({1000 + 16 * gx, 2000 + 16 * gy, 500 + (gx * gy) % 11});
            mesh.normal.push_back(normal_of(gx, gy));
            mesh.scalar.push_back(float(gx));
        }
    for (uint32_t y = 0; y < kSide; ++y)
        for (uint32_t x = 0; x < kSide; ++x) {
            const uint32_t v = y * (kSide + 1) + x, w = v + kSide + 1;
            mesh.triangle.push_back({v, v + 1, w});
            mesh.triangle.push_back({v + 1, w + 1, w});
        }
    mesh.edge_class.assign(mesh.triangleCount(), 0);
    return mesh;
}

/// A model of one level, several patches a page.
class ExportTest : public ::testing::Test {
protected:
    ExportTest() {
        std::string pattern = (fs::temp_directory_path() / "pietra-export-XXXXXX").string();
        if (::mkdtemp(pattern.data()) == nullptr) std::abort();
        directory_ = pattern;
        writeModel();
    }
    ~ExportTest() override { fs::remove_all(directory_); }
    std::string pathTo(const std::string& name) const { return directory_ + "/" + name; }

    void writeModel() {
        Budget budget(size_t(64) << 20);
        ModelWriter writer(pathTo("sheet.pietra"), false, directory_, budget);
        writer.beginLevel(0);
        const PageSettings settings{.scalar_count = 1, .normal_bits = 16};
        for (int py = 0; py < kPatches; ++py) {
            std::vector<Mesh> meshes;
            std::vector<const Mesh*> pointers;
            std::vector<Node> nodes;
            for (int px = 0; px < kPatches; ++px) meshes.push_back(sheetPatch(px, py));
            for (const Mesh& mesh : meshes) {
                pointers.push_back(&mesh);
                Node& node = nodes.emplace_back();
                node.bounds = node.saturated = {{2000, 3000, 500}, 4000};
                node.group = uint32_t(py * kPatches) + uint32_t(nodes.size() - 1);
                node.triangles = uint32_t(mesh.triangleCount());
                node.vertices = uint32_t(mesh.vertexCount());
            }
            writer.addPage(encodePage(pointers, settings), nodes);
        }
        ModelInfo info;
        info.method = "toy";
        info.lattice = {{10, 20, 30}, 0.5, 0};
        info.schema.scalars = {"x"};
        info.bounds.add(Vec3i(1000, 2000, 500));
        info.bounds.add(Vec3i(1000 + 16 * kPatches * kSide, 2000 + 16 * kPatches * kSide, 511));
        writer.finish(info);
    }

private:
    std::string directory_;
};

/// Keeps what it is given.
class MemoryWriter : public MeshWriter {
public:
    explicit MemoryWriter(const MeshOutput& output) : MeshWriter(output) {}
    void finish() override { finished = true; }
    std::vector<Vec3d> position;
    std::vector<float> scalar;
    std::vector<std::array<uint64_t, 3>> triangle;
    bool finished = false;

private:
    void checkCounts(uint64_t, uint64_t) const override {}
    void putVertices(const VertexBatch& batch) override {
        position.insert(position.end(), batch.position.begin(), batch.position.end());
        scalar.insert(scalar.end(), batch.scalar.begin(), batch.scalar.end());
        EXPECT_TRUE(batch.normal.empty());  // computed ones stay in the model
    }
    void putTriangles(std::span<const std::array<uint64_t, 3>> triangles) override {
        triangle.insert(triangle.end(), triangles.begin(), triangles.end());
    }
};

ExportReport exportAll(const ModelReader& model, MemoryWriter& writer, size_t budget_bytes) {
    Budget budget(budget_bytes);
    Progress progress;
    const ExportSettings settings{fs::temp_directory_path().string(), 3};
    return exportCut(model, finestCut(model.nodes()), writer, settings, budget, progress);
}

TEST_F(ExportTest, sharedVerticesAreWrittenOnceAndEdgesClose) {
    const ModelReader model(pathTo("sheet.pietra"));
    MemoryWriter writer(meshOutputOf(model.info(), finestCut(model.nodes()).triangles));
    const ExportReport report = exportAll(model, writer, size_t(64) << 20);
    EXPECT_TRUE(writer.finished);
    constexpr uint64_t side = kPatches * kSide;
    EXPECT_EQ(report.triangles, 2 * side * side);
    EXPECT_EQ(report.vertices, side * (side + 1));  // around in x, open in y
    EXPECT_EQ(writer.position.size(), report.vertices);
    std::map<std::pair<uint64_t, uint64_t>, int> edges;
    for (const auto& t : writer.triangle)
        for (size_t k = 0; k < 3; ++k) ++edges[std::minmax(t[k], t[(k + 1) % 3])];
    uint64_t borders = 0;
    for (const auto& [edge, uses] : edges) {
        EXPECT_LE(uses, 2);
        borders += uses == 1;
    }
    EXPECT_EQ(borders, 2 * side);
    for (size_t v = 0; v < writer.position.size(); ++v)  // attributes stay with their vertices
        EXPECT_EQ(writer.scalar[v], float((writer.position[v].x - 10) / 0.5 - 1000) / 16);
}

TEST_F(ExportTest, memoryChangesNothing) {
    const ModelReader model(pathTo("sheet.pietra"));
    MemoryWriter all(meshOutputOf(model.info(), finestCut(model.nodes()).triangles)),
        tight(meshOutputOf(model.info(), finestCut(model.nodes()).triangles));
    exportAll(model, all, size_t(64) << 20);
    exportAll(model, tight, 200'000);
    EXPECT_EQ(tight.position, all.position);
    EXPECT_EQ(tight.scalar, all.scalar);
    EXPECT_EQ(tight.triangle, all.triangle);
    EXPECT_THROW(exportAll(model, tight, 1000), MemoryError);
}

TEST_F(ExportTest, patchesComeOnceAndInOrder) {
    const ModelReader model(pathTo("sheet.pietra"));
    const std::vector<NodeIndex> nodes{0, 2, 3, 7, 9, 15};
    std::vector<NodeIndex> seen;
    visitInOrder(model, nodes, 3, [&](DecodedRun& run) {
        ASSERT_EQ(run.nodes.size(), run.patches.size());
        for (size_t i = 0; i < run.nodes.size(); ++i) {
            seen.push_back(run.nodes[i]);
            EXPECT_EQ(run.patches[i].triangleCount(), model.nodes()[run.nodes[i]].triangles);
        }
    });
    EXPECT_EQ(seen, nodes);
    std::multiset<NodeIndex> visited;
    std::mutex mutex;
    visitPatches(model, nodes, [&](NodeIndex node, const Mesh& mesh) {
        const std::lock_guard lock(mutex);
        visited.insert(node);
        EXPECT_EQ(mesh.vertexCount(), model.nodes()[node].vertices);
    });
    EXPECT_EQ(visited, std::multiset<NodeIndex>(nodes.begin(), nodes.end()));
    EXPECT_THROW(pageRuns(model.nodes(), std::vector<NodeIndex>{1, 0}), BugError);
}

}  // namespace
}  // namespace pietra
