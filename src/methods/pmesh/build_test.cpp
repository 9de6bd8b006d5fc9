// Construction from end to end, by many small diamonds, into a file and out of it.

#include "methods/pmesh/build.h"

#include <filesystem>
#include <fstream>
#include <map>
#include <random>

#include "methods/pmesh/pmesh_testing.h"
#include "methods/pmesh/split_model.h"

namespace pietra::pmesh {
namespace {

class BuiltFile : public testing::TestWithParam<TestMesh> {
protected:
    ~BuiltFile() override { std::filesystem::remove(path_); }

    BuildReport build(const Mesh& mesh, uint32_t leaf_triangles) {
        std::vector<Vec3d> positions;
        for (const Vec3i& p : mesh.position) positions.push_back(Vec3d(p));
        std::vector<MemorySource::Index> triangles;
        for (const Triangle& t : mesh.triangle) triangles.push_back({t[0], t[1], t[2]});
        MemorySource source(positions, triangles);
        return build(source, leaf_triangles);
    }
    BuildReport build(MemorySource& source, uint32_t leaf_triangles) {
        BuildSettings settings;
        settings.output = path_;
        settings.force = true;
        settings.memory_bytes = size_t(256) << 20;
        settings.jobs = 2;
        settings.temp_dir = testing::TempDir();
        settings.leaf_triangles = leaf_triangles;
        settings.patch_triangles = leaf_triangles;
        settings.precision = {PrecisionSetting::Kind::kStep, 1.0};
        Progress progress;
        return pmesh::build(source, settings, progress);
    }
    std::string bytes() const {
        std::ifstream in(path_, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }

    std::string path_ = testing::TempDir() + "/pmesh-build-test.pietra";
    Budget budget_{size_t(256) << 20};
};

INSTANTIATE_TEST_SUITE_P(Pmesh, BuiltFile, testing::ValuesIn(testMeshes()),
                         [](const auto& test) { return std::string(test.param.name); });

using Corners = std::array<std::array<int32_t, 3>, 3>;

std::vector<Corners> cornersOf(const Mesh& mesh, const Vec3i& corner) {
    std::vector<Corners> all;
    for (const Triangle& t : mesh.triangle) {
        Corners c;
        for (size_t k = 0; k < 3; ++k) {
            const Vec3i p = mesh.position[t[k]] - corner;
            c[k] = {p.x, p.y, p.z};
        }
        std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
        all.push_back(c);
    }
    std::sort(all.begin(), all.end());
    return all;
}

Vec3i leastOf(const Mesh& mesh) {
    Box3i box;
    for (const Triangle& t : mesh.triangle)
        for (const uint32_t v : t) box.add(mesh.position[v]);
    return box.min;
}

TEST_P(BuiltFile, IsSoundAndItsFinestTheInput) {
    const Mesh input = GetParam().make();
    for (const uint32_t leaf : {64u, 1000u}) {
        build(input, leaf);
        const ModelReader reader(path_);
        const auto model = openModel(reader);
        for (uint32_t page = 0; page < reader.pageCount(); ++page)
            EXPECT_EQ(model->pageFault(page), "");
        EXPECT_EQ(model->modelFault(budget_), "");
        Mesh finest = model->cut({}, budget_).mesh;
        ASSERT_EQ(finest.triangleCount(), input.triangleCount());
        const int shift = reader.info().lattice.shift;
        for (Vec3i& p : finest.position) p = p >> shift;
        EXPECT_EQ(cornersOf(finest, leastOf(finest)), cornersOf(input, leastOf(input)));
    }
}

/// Of each vertex of the finest mesh, exactly: by its place.
TEST_P(BuiltFile, CarriesColoursAndScalars) {
    Mesh input = GetParam().make();
    VertexBatch vertices;
    std::mt19937 random(5);
    std::map<std::array<int32_t, 3>, std::pair<Rgba8, std::array<float, 2>>> expected;
    const Vec3i least = leastOf(input);
    for (const Vec3i& p : input.position) {
        vertices.position.push_back(Vec3d(p));
        const auto byte = [&] { return uint8_t(random()); };
        vertices.colour.push_back({byte(), byte(), byte(), byte()});
        const std::array<float, 2> scalars{float(p.x) * 0.1f, float(random() % 1000) - 500.0f};
        vertices.scalar.insert(vertices.scalar.end(), scalars.begin(), scalars.end());
        const Vec3i q = p - least;
        expected[{q.x, q.y, q.z}] = {vertices.colour.back(), scalars};
    }
    std::vector<MemorySource::Index> triangles;
    for (const Triangle& t : input.triangle) triangles.push_back({t[0], t[1], t[2]});
    MemorySource source({false, true, {"a", "b"}}, vertices, triangles);
    build(source, 64);
    const ModelReader reader(path_);
    EXPECT_EQ(reader.info().schema, source.schema());
    const auto model = openModel(reader);
    EXPECT_EQ(model->modelFault(budget_), "");
    const Mesh finest = model->cut({}, budget_).mesh;
    ASSERT_EQ(finest.colour.size(), finest.vertexCount());
    ASSERT_EQ(finest.scalar.size(), 2 * finest.vertexCount());
    const int shift = reader.info().lattice.shift;
    Mesh moved = finest;
    for (Vec3i& p : moved.position) p = p >> shift;
    const Vec3i corner = leastOf(moved);
    for (size_t v = 0; v < finest.vertexCount(); ++v) {
        const Vec3i q = moved.position[v] - corner;
        const auto& [colour, scalars] = expected.at({q.x, q.y, q.z});
        EXPECT_EQ(finest.colour[v], colour);
        EXPECT_EQ(finest.scalar[2 * v], scalars[0]);
        EXPECT_EQ(finest.scalar[2 * v + 1], scalars[1]);
    }
    CutRequest request;
    request.max_triangles = finest.triangleCount() / 4;
    const Mesh coarse = model->cut(request, budget_).mesh;
    EXPECT_EQ(coarse.colour.size(), coarse.vertexCount());
}

TEST_P(BuiltFile, ManyDiamondsLeaveAsLittleAsOne) {
    const Mesh input = GetParam().make();
    const SplitForest whole = buildInCore(input, Lattice{}, budget_);
    build(input, 64);
    const ModelReader reader(path_);
    EXPECT_LE(openForest(reader).base.root.size(), whole.base.root.size() * 11 / 10 + 8);
}

TEST_P(BuiltFile, SaysThatItIsDamaged) {
    const BuildReport report = build(GetParam().make(), 200);
    EXPECT_EQ(report.output_bytes, bytes().size());
    const ModelReader reader(path_);
    SplitForest forest = openForest(reader);
    SplitNode node;
    ASSERT_EQ(readNode(reader, forest, 0, node), "");
    forest.row[0].splits += 1;
    EXPECT_EQ(readNode(reader, forest, 0, node),
              "page 0 is damaged: it has " + std::to_string(node.split.size()) + " splits");
}

}  // namespace
}  // namespace pietra::pmesh
