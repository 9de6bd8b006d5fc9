// Writers: what is read back is what was written, in every format; nothing is left behind on
// failure.

#include "io/mesh_writer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/hash.h"
#include "io/test_files.h"

namespace pietra {
namespace {

float noise(uint64_t i) {
    return float(int64_t(mixBits(i + 1)) >> 40) * 0x1p-23f;
}

constexpr uint64_t kVertices = 3000;
constexpr uint64_t kTriangles = 5000;

AttributeSchema fullSchema() {
    return {true, true, {"heat", "depth in m"}};
}

VertexBatch makeVertices(const AttributeSchema& schema, uint64_t begin, uint64_t end,
                         double scale) {
    VertexBatch batch;
    batch.first = begin;
    for (uint64_t v = begin; v < end; ++v) {
        const auto at = [&](uint64_t k) { return noise(16 * v + k); };
        batch.position.push_back(scale * Vec3d(at(0), at(1), at(2)));
        if (schema.normals_given) batch.normal.push_back(Vec3f(at(3), at(4), at(5)));
        if (schema.colours)
            batch.colour.push_back({uint8_t(v), uint8_t(v >> 3), uint8_t(v >> 5), uint8_t(~v)});
        for (size_t k = 0; k < schema.scalars.size(); ++k) batch.scalar.push_back(at(8 + k));
    }
    return batch;
}

std::vector<std::array<uint64_t, 3>> makeTriangles(uint64_t begin, uint64_t end,
                                                   uint64_t vertices) {
    std::vector<std::array<uint64_t, 3>> out;
    for (uint64_t t = begin; t < end; ++t)
        out.push_back({mixBits(3 * t + 1) % vertices, mixBits(3 * t + 2) % vertices,
                       mixBits(3 * t + 3) % vertices});
    return out;
}

/// What the writers below put into a file.
WholeMesh expectedMesh(const AttributeSchema& schema, double scale) {
    WholeMesh mesh;
    mesh.schema = schema;
    mesh.vertices = makeVertices(schema, 0, kVertices, scale);
    mesh.triangles = makeTriangles(0, kTriangles / 2, kVertices / 2);
    const auto rest = makeTriangles(kTriangles / 2, kTriangles, kVertices);
    mesh.triangles.insert(mesh.triangles.end(), rest.begin(), rest.end());
    return mesh;
}

/// Writes that mesh. `in_turns`: triangles come before the last vertices.
void writeMesh(const std::string& path, MeshOutput output, double scale, bool in_turns,
               bool announce_end) {
    const auto writer = createMesh(path, false, output);
    const AttributeSchema& schema = output.schema;
    writer->addVertices(makeVertices(schema, 0, kVertices / 2, scale));
    if (in_turns) writer->addTriangles(makeTriangles(0, kTriangles / 2, kVertices / 2));
    writer->addVertices(makeVertices(schema, kVertices / 2, kVertices, scale));
    if (announce_end) writer->endVertices();
    if (!in_turns) writer->addTriangles(makeTriangles(0, kTriangles / 2, kVertices / 2));
    writer->addTriangles(makeTriangles(kTriangles / 2, kTriangles, kVertices));
    EXPECT_FALSE(std::filesystem::exists(path));
    writer->finish();
    EXPECT_EQ(writer->vertexCount(), kVertices);
    EXPECT_EQ(writer->triangleCount(), kTriangles);
}

size_t fileCount(const ScratchDirectory& dir) {
    const auto entries = std::filesystem::directory_iterator(dir.path());
    return size_t(std::distance(begin(entries), end(entries)));
}

TEST(MeshWriter, plyComesBackWhole) {
    for (const bool doubles : {false, true})
        for (const bool attributes : {false, true}) {
            const ScratchDirectory dir;
            const double scale = doubles ? 1e7 / 3 : 1;
            MeshOutput output;
            if (attributes) output.schema = fullSchema();
            output.double_positions = doubles;
            output.comment = "made by a test";
            WholeMesh expected = expectedMesh(output.schema, scale);
            if (attributes) expected.schema.scalars[1] = "depth_in_m";
            std::string first;
            for (const bool in_turns : {false, true})
                for (const bool announce_end : {false, true}) {
                    const std::string path = dir.file("a.ply");
                    writeMesh(path, output, scale, in_turns, announce_end);
                    EXPECT_EQ(fileCount(dir), 1u);
                    expectSameMesh(readWhole(path), expected);
                    const std::string bytes = readWholeFile(path);
                    if (first.empty()) first = bytes;
                    EXPECT_EQ(bytes, first);  // however it came
                    std::filesystem::remove(path);
                }
        }
}

TEST(MeshWriter, objComesBackWhole) {
    const ScratchDirectory dir;
    for (const bool doubles : {false, true}) {
        MeshOutput output;
        output.schema = fullSchema();
        output.double_positions = doubles;
        const double scale = doubles ? 1e7 / 3 : 1;
        const std::string path = dir.file(doubles ? "d.obj" : "f.obj");
        writeMesh(path, output, scale, true, false);
        const WholeMesh expected = expectedMesh(output.schema, scale);
        std::ifstream file(path);
        size_t vertices = 0, normals = 0, faces = 0;
        for (std::string line; std::getline(file, line);) {
            std::istringstream words(line);
            std::string word;
            words >> word;
            if (word == "v") {
                Vec3d p, c;
                words >> p.x >> p.y >> p.z >> c.x >> c.y >> c.z;
                const Vec3d& wanted = expected.vertices.position[vertices];
                if (doubles)
                    ASSERT_EQ(p, wanted);
                else
                    ASSERT_EQ(Vec3f(p), Vec3f(wanted));
                ASSERT_EQ(std::lround(c.x * 255), expected.vertices.colour[vertices++].r);
            } else if (word == "vn") {
                Vec3f n;
                words >> n.x >> n.y >> n.z;
                ASSERT_EQ(n, expected.vertices.normal[normals++]);
            } else if (word == "f") {
                for (int k = 0; k < 3; ++k) {
                    std::string corner;
                    words >> corner;
                    const std::string index = std::to_string(expected.triangles[faces][k] + 1);
                    ASSERT_EQ(corner, index + "//" + index);
                }
                ++faces;
            }
        }
        EXPECT_EQ(vertices, kVertices);
        EXPECT_EQ(normals, kVertices);
        EXPECT_EQ(faces, kTriangles);
    }
}

TEST(MeshWriter, stlHoldsEveryCorner) {
    const ScratchDirectory dir;
    const std::string path = dir.file("a.stl");
    MeshOutput output;
    writeMesh(path, output, 1, true, false);
    const WholeMesh expected = expectedMesh(output.schema, 1);
    const std::string bytes = readWholeFile(path);
    ASSERT_EQ(bytes.size(), 84 + 50 * kTriangles);
    uint32_t count;
    std::memcpy(&count, &bytes[80], 4);
    EXPECT_EQ(count, kTriangles);
    EXPECT_EQ(bytes.find("solid"), bytes.npos);
    for (size_t t = 0; t < kTriangles; ++t) {
        Vec3f corner[4];
        std::memcpy(corner, &bytes[84 + 50 * t], sizeof corner);
        for (int k = 0; k < 3; ++k)
            ASSERT_EQ(Vec3d(corner[k + 1]), expected.vertices.position[expected.triangles[t][k]]);
        const Vec3f edge = corner[2] - corner[1];
        EXPECT_NEAR(glm::dot(corner[0], edge), 0, 1e-5);
    }
}

TEST(MeshWriter, glbIsWhatTheStandardAsks) {
    const ScratchDirectory dir;
    for (const bool in_turns : {false, true}) {
        const std::string path = dir.file(in_turns ? "a.glb" : "b.glb");
        MeshOutput output;
        output.schema = fullSchema();
        output.centre = {100, 200.5, -1e6 / 3};
        writeMesh(path, output, 1, in_turns, true);
        const WholeMesh expected = expectedMesh(output.schema, 1);
        const std::string bytes = readWholeFile(path);
        const auto word = [&](size_t at) {
            uint32_t value;
            std::memcpy(&value, &bytes[at], 4);
            return value;
        };
        ASSERT_EQ(word(0), 0x46546c67u);
        EXPECT_EQ(word(4), 2u);
        EXPECT_EQ(word(8), bytes.size());
        const size_t json_bytes = word(12), data = 28 + json_bytes;
        EXPECT_EQ(word(16), 0x4e4f534au);
        EXPECT_EQ(json_bytes % 4, 0u);
        EXPECT_EQ(word(20 + json_bytes), bytes.size() - data);
        EXPECT_EQ(word(24 + json_bytes), 0x004e4942u);
        const auto json = nlohmann::json::parse(bytes.substr(20, json_bytes));
        EXPECT_EQ(json["buffers"][0]["byteLength"], bytes.size() - data);
        EXPECT_EQ(json["nodes"][0]["translation"],
                  nlohmann::json({output.centre.x, output.centre.y, output.centre.z}));
        const auto& primitive = json["meshes"][0]["primitives"][0];
        const auto& views = json["bufferViews"];
        const size_t stride = views[0]["byteStride"];
        const auto place = [&](const std::string& name) {
            const auto& accessor = json["accessors"][int(primitive["attributes"][name])];
            EXPECT_EQ(accessor["count"], kVertices) << name;
            return data + accessor.value("byteOffset", 0);
        };
        Vec3f least(1e30f), most(-1e30f);
        for (size_t v = 0; v < kVertices; ++v) {
            Vec3f p, n;
            Rgba8 c;
            float heat;
            std::memcpy(&p, &bytes[place("POSITION") + v * stride], sizeof p);
            std::memcpy(&n, &bytes[place("NORMAL") + v * stride], sizeof n);
            std::memcpy(&c, &bytes[place("COLOR_0") + v * stride], sizeof c);
            std::memcpy(&heat, &bytes[place("_HEAT") + v * stride], sizeof heat);
            ASSERT_EQ(p, Vec3f(expected.vertices.position[v] - output.centre));
            ASSERT_EQ(n, expected.vertices.normal[v]);
            ASSERT_EQ(c, expected.vertices.colour[v]);
            ASSERT_EQ(heat, expected.vertices.scalar[2 * v]);
            least = glm::min(least, p);
            most = glm::max(most, p);
        }
        EXPECT_TRUE(primitive["attributes"].contains("_DEPTH_IN_M"));
        const auto& accessor = json["accessors"][int(primitive["attributes"]["POSITION"])];
        EXPECT_EQ(accessor["min"], nlohmann::json({least.x, least.y, least.z}));
        EXPECT_EQ(accessor["max"], nlohmann::json({most.x, most.y, most.z}));
        const auto& indices = json["accessors"][int(primitive["indices"])];
        ASSERT_EQ(indices["count"], 3 * kTriangles);
        const size_t first = data + size_t(views[1]["byteOffset"]);
        EXPECT_EQ(first + size_t(views[1]["byteLength"]), bytes.size());
        for (size_t t = 0; t < kTriangles; ++t)
            for (int k = 0; k < 3; ++k)
                ASSERT_EQ(word(first + 12 * t + 4 * k), expected.triangles[t][k]);
    }
}

TEST(MeshWriter, refusesAtOnceWhatAFormatCannotHold) {
    const ScratchDirectory dir;
    const auto faultOf = [&](const std::string& name, uint64_t vertices, uint64_t triangles) {
        MeshOutput output;
        output.expected_vertices = vertices;
        output.expected_triangles = triangles;
        try {
            createMesh(dir.file(name), false, output);
        } catch (const UsageError& e) {
            return std::string(e.what()).substr(dir.file(name).size());
        }
        return std::string();
    };
    const uint64_t million = 1000000;
    EXPECT_EQ(faultOf("a.glb", 150 * million, 200 * million), "");
    EXPECT_EQ(faultOf("a.glb", 150 * million, 300 * million),
              ": a GLB file holds at most 4 GiB; write a .ply instead");
    EXPECT_EQ(faultOf("a.stl", 1, 4294 * million), "");
    EXPECT_EQ(faultOf("a.stl", 1, 4295 * million),
              ": an STL file holds at most 2^32 - 1 triangles");
    EXPECT_EQ(faultOf("a.ply", 4294 * million, 9000 * million), "");
    EXPECT_EQ(faultOf("a.ply", 4295 * million, 9000 * million),
              ": a PLY file with 32-bit indices holds at most 2^32 vertices");
    EXPECT_EQ(fileCount(dir), 0u);
}

TEST(MeshWriter, leavesNothingBehind) {
    const ScratchDirectory dir;
    for (const char* name : {"a.ply", "a.obj", "a.stl", "a.glb"}) {
        {
            const auto writer = createMesh(dir.file(name), false, {});
            writer->addVertices(makeVertices({}, 0, 100, 1));
            writer->addTriangles(makeTriangles(0, 100, 100));
        }
        EXPECT_EQ(fileCount(dir), 0u) << name;
    }
}

TEST(MeshWriter, refusesWhatItCannotWrite) {
    const ScratchDirectory dir;
    const auto fault = [&](const std::string& path) -> std::string {
        try {
            createMesh(path, false, {});
            return "";
        } catch (const Error& e) {
            return e.what();
        }
    };
    EXPECT_EQ(fault("a.xyz"), "a.xyz: the name of a mesh ends in .ply, .obj, .stl or .glb");
    const std::string path = dir.write("a.PLY", "old");
    EXPECT_EQ(fault(path), path + ": exists; --force overwrites it");
    const std::string nowhere = dir.file("none/a.ply");
    EXPECT_NE(fault(nowhere).find("cannot create: No such file or directory"), std::string::npos);
}

TEST(MeshWriter, knowsWhenFloatsWillDo) {
    EXPECT_FALSE(needsDoubles({Vec3d(-1), Vec3d(1)}, 1e-6));
    EXPECT_TRUE(needsDoubles({Vec3d(-1), Vec3d(1)}, 1e-8));
    EXPECT_TRUE(needsDoubles({Vec3d(1737400, 0, 0), Vec3d(1737401, 1, 1)}, 1e-3));
}

}  // namespace
}  // namespace pietra
