// The glTF reader: every spelling of a scene gives the same triangles, bad files name their fault.

#include "io/gltf_source.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "base/budget.h"
#include "base/hash.h"
#include "io/mesh_writer.h"
#include "io/test_files.h"

namespace pietra {
namespace {

using Json = nlohmann::json;

float noise(uint64_t i) {
    return float(int64_t(mixBits(i + 1)) >> 40) * 0x1p-23f;
}

template <class T>
void append(std::string& bytes, const T& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string base64(const std::string& bytes) {
    const char* const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    for (size_t i = 0; i < bytes.size(); i += 3) {
        uint32_t bits = 0;
        for (size_t k = 0; k < 3; ++k)
            bits = bits << 8 | (i + k < bytes.size() ? uint8_t(bytes[i + k]) : 0);
        for (size_t k = 0; k < 4; ++k)
            out += i + k > bytes.size() ? '=' : digits[bits >> (18 - 6 * k) & 63];
    }
    return out;
}

/// A scene in the making: JSON, and one buffer.
struct Builder {
    Json json = {{"asset", {{"version", "2.0"}}}};
    std::string data;

    /// A view of bytes at the end of the buffer.
    size_t view(const std::string& bytes, size_t stride = 0) {
        data.resize((data.size() + 3) / 4 * 4);
        Json v = {{"buffer", 0}, {"byteOffset", data.size()}, {"byteLength", bytes.size()}};
        if (stride > 0) v["byteStride"] = stride;
        json["bufferViews"].push_back(v);
        data += bytes;
        return json["bufferViews"].size() - 1;
    }
    size_t accessor(size_t view, int component, const char* type, size_t count, size_t offset = 0,
                    bool normalized = false) {
        Json a = {{"bufferView", view}, {"componentType", component}, {"type", type}};
        a["count"] = count;
        if (offset > 0) a["byteOffset"] = offset;
        if (normalized) a["normalized"] = true;
        json["accessors"].push_back(a);
        return json["accessors"].size() - 1;
    }
    template <class T>
    size_t values(const std::vector<T>& values, int component, const char* type, size_t components,
                  bool normalized = false) {
        std::string bytes;
        for (const T& v : values) append(bytes, v);
        return accessor(view(bytes), component, type, values.size() / components, 0, normalized);
    }
    /// A mesh of one primitive.
    size_t mesh(const Json& primitive) {
        json["meshes"].push_back({{"primitives", {primitive}}});
        return json["meshes"].size() - 1;
    }

    std::string glb() const {
        Json all = json;
        all["buffers"] = {{{"byteLength", data.size()}}};
        std::string text = all.dump(), bytes = data;
        text.resize((text.size() + 3) / 4 * 4, ' ');
        bytes.resize((bytes.size() + 3) / 4 * 4);
        std::string out = "glTF";
        append(out, uint32_t(2));
        append(out, uint32_t(12 + 8 + text.size() + 8 + bytes.size()));
        append(out, uint32_t(text.size()));
        out += "JSON" + text;
        append(out, uint32_t(bytes.size()));
        return out + "BIN" + '\0' + bytes;
    }
    std::string gltf(const std::string& uri) const {
        Json all = json;
        all["buffers"] = {{{"byteLength", data.size()}, {"uri", uri}}};
        return all.dump(2);
    }
    std::string embedded() const {
        return gltf("data:application/octet-stream;base64," + base64(data));
    }
};

constexpr int kByte = 5120, kUbyte = 5121, kShort = 5122, kUshort = 5123, kUint = 5125,
              kReal = 5126;

/// n x n quads with random heights.
struct Grid {
    size_t n;
    size_t vertexCount() const { return (n + 1) * (n + 1); }
    std::vector<float> positions() const {
        std::vector<float> out;
        for (size_t v = 0; v < vertexCount(); ++v)
            out.insert(out.end(), {float(v % (n + 1)), noise(v), float(v / (n + 1))});
        return out;
    }
    template <class T>
    std::vector<T> indices() const {
        std::vector<T> out;
        for (size_t j = 0; j < n; ++j)
            for (size_t i = 0; i < n; ++i) {
                const size_t a = j * (n + 1) + i, b = a + 1, c = a + n + 2, d = a + n + 1;
                for (const size_t v : {a, b, c, a, c, d}) out.push_back(T(v));
            }
        return out;
    }
    Soup soup() const {
        const auto p = positions();
        const auto index = indices<size_t>();
        const auto at = [&](size_t k) {
            return Vec3d(p[3 * index[k]], p[3 * index[k] + 1], p[3 * index[k] + 2]);
        };
        Soup out;
        for (size_t k = 0; k < index.size(); k += 3) out.push_back({at(k), at(k + 1), at(k + 2)});
        return out;
    }
};

Builder plainGrid(const Grid& grid) {
    Builder b;
    const size_t positions = b.values(grid.positions(), kReal, "VEC3", 3);
    const size_t indices = b.values(grid.indices<uint32_t>(), kUint, "SCALAR", 1);
    b.mesh({{"attributes", {{"POSITION", positions}}}, {"indices", indices}});
    return b;
}

TEST(GltfSource, givesTheSameForEveryContainer) {
    const ScratchDirectory dir;
    const Grid grid{50};
    const Builder b = plainGrid(grid);
    dir.write("the data.bin", b.data);
    const std::string escaped = [&] {  // as some programs write the slashes of base64
        std::string text = b.embedded(), out;
        for (const char c : text) out += c == '/' ? std::string("\\/") : std::string(1, c);
        return out;
    }();
    for (const std::string& path :
         {dir.write("a.glb", b.glb()), dir.write("b.gltf", b.embedded()),
          dir.write("c.gltf", b.gltf("the%20data.bin")), dir.write("d.txt", b.embedded()),
          dir.write("e.gltf", "\xef\xbb\xbf  " + b.embedded()), dir.write("f.gltf", escaped),
          dir.write("a.glb", b.glb() + "more")}) {
        SCOPED_TRACE(path);
        const WholeMesh mesh = readWhole(path);
        EXPECT_EQ(soupOf(mesh), grid.soup());
        EXPECT_EQ(mesh.vertices.position.size(), grid.vertexCount());
        EXPECT_EQ(mesh.schema, AttributeSchema{});
    }
    const auto source = openSource({dir.file("c.gltf")});
    EXPECT_EQ(source->inputBytes(), b.data.size() + b.gltf("the%20data.bin").size());
}

TEST(GltfSource, readsManyBatches) {
    const ScratchDirectory dir;
    const Grid grid{300};
    EXPECT_EQ(soupOf(readWhole(dir.write("a.glb", plainGrid(grid).glb()))), grid.soup());
    EXPECT_EQ(soupOf(readWhole(dir.write("a.gltf", plainGrid(grid).embedded()))), grid.soup());
}

TEST(GltfSource, takesEveryTypeOfIndexAndNone) {
    const ScratchDirectory dir;
    const Grid grid{14};
    const size_t count = grid.indices<uint8_t>().size();
    for (int kind = 0; kind < 4; ++kind) {
        Builder b;
        Json primitive;
        if (kind < 3) {
            const size_t positions = b.values(grid.positions(), kReal, "VEC3", 3);
            primitive["indices"] =
                kind == 0   ? b.values(grid.indices<uint8_t>(), kUbyte, "SCALAR", 1)
                : kind == 1 ? b.values(grid.indices<uint16_t>(), kUshort, "SCALAR", 1)
                            : b.values(grid.indices<uint32_t>(), kUint, "SCALAR", 1);
            primitive["attributes"]["POSITION"] = positions;
        } else {
            std::vector<float> corners;
            for (const auto& t : grid.soup())
                for (const Vec3d& p : t)
                    corners.insert(corners.end(), {float(p.x), float(p.y), float(p.z)});
            primitive["attributes"]["POSITION"] = b.values(corners, kReal, "VEC3", 3);
        }
        b.mesh(primitive);
        const WholeMesh mesh = readWhole(dir.write("a.glb", b.glb()));
        EXPECT_EQ(mesh.triangles.size(), count / 3);
        EXPECT_EQ(soupOf(mesh), grid.soup());
    }
}

TEST(GltfSource, unrollsStripsAndFans) {
    const ScratchDirectory dir;
    for (const bool indexed : {false, true})
        for (const int mode : {4, 5, 6}) {
            Builder b;
            std::vector<float> positions(18);
            for (size_t i = 0; i < 18; ++i) positions[i] = float(i);
            Json primitive = {{"mode", mode}};
            primitive["attributes"]["POSITION"] = b.values(positions, kReal, "VEC3", 3);
            if (indexed)
                primitive["indices"] =
                    b.values(std::vector<uint16_t>{5, 4, 3, 2, 1}, kUshort, "SCALAR", 1);
            b.mesh(primitive);
            const WholeMesh mesh = readWhole(dir.write("a.glb", b.glb()));
            using Triangles = std::vector<std::array<uint64_t, 3>>;
            const Triangles expected =
                mode == 4   ? (indexed ? Triangles{{5, 4, 3}} : Triangles{{0, 1, 2}, {3, 4, 5}})
                : mode == 5 ? (indexed ? Triangles{{5, 4, 3}, {3, 4, 2}, {3, 2, 1}}
                                       : Triangles{{0, 1, 2}, {2, 1, 3}, {2, 3, 4}, {4, 3, 5}})
                            : (indexed ? Triangles{{5, 4, 3}, {5, 3, 2}, {5, 2, 1}}
                                       : Triangles{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}});
            EXPECT_EQ(mesh.triangles, expected) << mode << indexed;
            EXPECT_EQ(mesh.notes.size(), mode == 4 && indexed ? 1u : 0u);
        }
}

TEST(GltfSource, stripsGoOnAcrossBatches) {
    const ScratchDirectory dir;
    const size_t corners = 200001;
    for (const int mode : {5, 6}) {
        Builder b;
        std::vector<float> positions(3 * corners);
        for (size_t i = 0; i < positions.size(); ++i) positions[i] = noise(i);
        b.mesh({{"mode", mode},
                {"attributes", {{"POSITION", b.values(positions, kReal, "VEC3", 3)}}}});
        const WholeMesh mesh = readWhole(dir.write("a.glb", b.glb()));
        ASSERT_EQ(mesh.triangles.size(), corners - 2);
        for (uint64_t t = 0; t < corners - 2; ++t) {
            const std::array<uint64_t, 3> strip = t % 2 == 0
                                                      ? std::array<uint64_t, 3>{t, t + 1, t + 2}
                                                      : std::array<uint64_t, 3>{t + 1, t, t + 2};
            const std::array<uint64_t, 3> fan = {0, t + 1, t + 2};
            ASSERT_EQ(mesh.triangles[t], mode == 5 ? strip : fan);
        }
    }
}

/// All attributes, interleaved or one after the other.
Builder attributeMesh(bool interleaved, int colour_type, int colours) {
    Builder b;
    const size_t count = 300;
    const size_t colour_bytes = size_t(colours) * (colour_type == kReal     ? 4
                                                   : colour_type == kUshort ? 2
                                                                            : 1);
    const size_t widths[] = {12, 12, (colour_bytes + 3) / 4 * 4, 4, 4};
    std::string columns[5], rows;
    for (size_t v = 0; v < count; ++v) {
        std::string cell[5];
        for (size_t k = 0; k < 3; ++k) append(cell[0], noise(8 * v + k));
        for (size_t k = 0; k < 3; ++k) append(cell[1], noise(8 * v + 3 + k));
        for (size_t k = 0; k < size_t(colours); ++k) {
            const uint8_t value = uint8_t(v * (k + 1));
            if (colour_type == kReal)
                append(cell[2], float(value) / 255);
            else if (colour_type == kUshort)
                append(cell[2], uint16_t(value * 257));
            else
                append(cell[2], value);
        }
        append(cell[3], float(v) / 4);
        append(cell[4], uint16_t(v));
        for (size_t i = 0; i < 5; ++i) {
            cell[i].resize(widths[i]);
            columns[i] += cell[i];
            rows += cell[i];
        }
    }
    const struct {
        const char *name, *type;
        int component;
    } attributes[] = {{"POSITION", "VEC3", kReal},
                      {"NORMAL", "VEC3", kReal},
                      {"COLOR_0", colours == 3 ? "VEC3" : "VEC4", colour_type},
                      {"_HEAT", "SCALAR", kReal},
                      {"_ID", "SCALAR", kUshort}};
    Json primitive;
    const size_t stride = rows.size() / count;
    const size_t shared = interleaved ? b.view(rows, stride) : 0;
    size_t offset = 0;
    for (size_t i = 0; i < 5; ++i) {
        const bool normalized = i == 2 && colour_type != kReal;
        const size_t view = interleaved ? shared : b.view(columns[i], widths[i]);
        primitive["attributes"][attributes[i].name] =
            b.accessor(view, attributes[i].component, attributes[i].type, count,
                       interleaved ? offset : 0, normalized);
        offset += widths[i];
    }
    b.mesh(primitive);
    return b;
}

TEST(GltfSource, carriesAttributes) {
    const ScratchDirectory dir;
    for (const bool interleaved : {false, true})
        for (const int colour_type : {kUbyte, kUshort, kReal})
            for (const int colours : {3, 4}) {
                const WholeMesh mesh = readWhole(
                    dir.write("a.glb", attributeMesh(interleaved, colour_type, colours).glb()));
                EXPECT_EQ(mesh.schema, (AttributeSchema{true, true, {"HEAT", "ID"}}));
                for (size_t v = 0; v < 300; ++v) {
                    ASSERT_EQ(mesh.vertices.position[v],
                              Vec3d(noise(8 * v), noise(8 * v + 1), noise(8 * v + 2)));
                    ASSERT_EQ(mesh.vertices.normal[v],
                              Vec3f(noise(8 * v + 3), noise(8 * v + 4), noise(8 * v + 5)));
                    ASSERT_EQ(mesh.vertices.colour[v],
                              (Rgba8{uint8_t(v), uint8_t(2 * v), uint8_t(3 * v),
                                     colours == 4 ? uint8_t(4 * v) : uint8_t(255)}));
                    ASSERT_EQ(mesh.vertices.scalar[2 * v], float(v) / 4);
                    ASSERT_EQ(mesh.vertices.scalar[2 * v + 1], float(v));
                }
            }
}

TEST(GltfSource, takesQuantisedPositions) {
    const ScratchDirectory dir;
    for (const bool normalized : {false, true}) {
        Builder b;
        b.json["extensionsRequired"] = {"KHR_mesh_quantization"};
        std::string bytes;
        for (const int v : {32767, -32768, 0, 0, 16384, 0, -32767, 1, 0, 0, 0, 0})
            append(bytes, int16_t(v));
        const size_t a = b.accessor(b.view(bytes, 8), kShort, "VEC3", 3, 0, normalized);
        b.mesh({{"attributes", {{"POSITION", a}}}});
        const WholeMesh mesh = readWhole(dir.write("a.glb", b.glb()));
        EXPECT_EQ(mesh.vertices.position[0],
                  normalized ? Vec3d(1, -1, 0) : Vec3d(32767, -32768, 0));
        EXPECT_EQ(mesh.vertices.position[1],
                  normalized ? Vec3d(16384.0 / 32767, 0, -1) : Vec3d(16384, 0, -32767));
    }
}

TEST(GltfSource, appliesSparseReplacements) {
    const ScratchDirectory dir;
    const size_t count = 60000;  // several blocks
    for (const bool with_base : {true, false}) {
        Builder b;
        std::vector<float> positions(3 * count);
        for (size_t i = 0; i < positions.size(); ++i) positions[i] = noise(i);
        const size_t a = b.values(positions, kReal, "VEC3", 3);
        if (!with_base) {
            b.json["accessors"][a].erase("bufferView");
            std::fill(positions.begin(), positions.end(), 0.0f);
        }
        std::string indices, values;
        size_t replaced = 0;
        for (size_t v = 5; v < count; v += 1 + mixBits(v) % 9, ++replaced) {
            append(indices, uint16_t(v));
            for (size_t k = 0; k < 3; ++k) append(values, positions[3 * v + k] = noise(7 * v + k));
        }
        const size_t index_view = b.view(indices), value_view = b.view(values);
        b.json["accessors"][a]["sparse"] = {
            {"count", replaced},
            {"indices", {{"bufferView", index_view}, {"componentType", kUshort}}},
            {"values", {{"bufferView", value_view}}}};
        b.mesh({{"attributes", {{"POSITION", a}}}});
        const auto source = openSource({dir.write("a.glb", b.glb())});
        for (int i = 0; i < 2; ++i) {
            const WholeMesh mesh = readWhole(*source);
            for (size_t v = 0; v < count; ++v)
                for (int k = 0; k < 3; ++k)
                    ASSERT_EQ(mesh.vertices.position[v][k], positions[3 * v + size_t(k)]) << v;
        }
    }
}

TEST(GltfSource, placesMeshesByTheirNodes) {
    const ScratchDirectory dir;
    Builder b;
    const size_t positions =
        b.values(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, kReal, "VEC3", 3);
    const size_t normals =
        b.values(std::vector<float>{0, 0, 1, 0.6f, 0, 0.8f, 0, 0, 1}, kReal, "VEC3", 3);
    b.mesh({{"attributes", {{"POSITION", positions}, {"NORMAL", normals}}}});
    const double r = std::sqrt(0.5);
    b.json["nodes"] = {
        {{"children", {1, 2}}, {"translation", {10, 0, 0}}},
        {{"mesh", 0}, {"rotation", {0, 0, r, r}}, {"scale", {2, 2, 2}}},  // x to y
        {{"children", {3}}, {"matrix", {0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1}}},
        {{"mesh", 0}},  // mirrored
        {{"mesh", 0}, {"scale", {4, 1, 1}}},
        {{"mesh", 0}}};
    b.json["scenes"] = {{{"nodes", {5}}}, {{"nodes", {0, 4}}}};
    b.json["scene"] = 1;
    const WholeMesh mesh = readWhole(dir.write("a.glb", b.glb()));
    EXPECT_EQ(mesh.notes, std::vector<std::string>{"1 other scenes are left out"});
    ASSERT_EQ(mesh.vertices.position.size(), 9u);
    const auto near = [](const Vec3d& a, const Vec3d& b) {
        EXPECT_LT(glm::dot(a - b, a - b), 1e-12) << a.x << ' ' << a.y << ' ' << a.z;
    };
    near(mesh.vertices.position[1], {10, 2, 0});
    near(mesh.vertices.position[2], {8, 0, 0});
    near(Vec3d(mesh.vertices.normal[1]), {0, 0.6, 0.8});
    EXPECT_EQ(mesh.vertices.position[4], Vec3d(10, 1, 5));
    EXPECT_EQ(mesh.vertices.position[5], Vec3d(11, 0, 5));
    near(Vec3d(mesh.vertices.normal[4]), {0, 0.6, 0.8});
    EXPECT_EQ(mesh.vertices.position[7], Vec3d(4, 0, 0));
    near(Vec3d(mesh.vertices.normal[7]), Vec3d(0.15, 0, 0.8) / std::sqrt(0.15 * 0.15 + 0.64));
    EXPECT_EQ(mesh.triangles,
              (std::vector<std::array<uint64_t, 3>>{{0, 1, 2}, {3, 5, 4}, {6, 7, 8}}));
    // Outside stays outside: each triangle's own normal points up, as those of its corners do.
    for (const auto& t : soupOf(mesh)) EXPECT_GT(glm::cross(t[1] - t[0], t[2] - t[0]).z, 0);

    b.json.erase("scene");
    EXPECT_EQ(readWhole(dir.write("b.glb", b.glb())).triangles.size(), 1u);
    b.json.erase("scenes");
    EXPECT_EQ(readWhole(dir.write("c.glb", b.glb())).triangles.size(), 4u);
    b.json.erase("nodes");
    EXPECT_EQ(readWhole(dir.write("d.glb", b.glb())).triangles.size(), 1u);
}

TEST(GltfSource, sharesVerticesAmongPrimitives) {
    const ScratchDirectory dir;
    const Grid grid{20};
    const auto indices = grid.indices<uint16_t>();
    for (const bool one_mesh : {true, false}) {
        Builder b;
        const size_t positions = b.values(grid.positions(), kReal, "VEC3", 3);
        Json primitives = Json::array(), nodes = Json::array();
        for (size_t row = 0; row < grid.n; ++row) {
            const auto from = indices.begin() + ptrdiff_t(row * grid.n * 6);
            const std::vector<uint16_t> part(from, from + ptrdiff_t(grid.n * 6));
            primitives.push_back({{"attributes", {{"POSITION", positions}}},
                                  {"indices", b.values(part, kUshort, "SCALAR", 1)}});
        }
        if (one_mesh)
            b.json["meshes"] = {{{"primitives", primitives}}};
        else
            for (const Json& primitive : primitives) b.mesh(primitive);
        const WholeMesh mesh = readWhole(dir.write("a.glb", b.glb()));
        EXPECT_EQ(soupOf(mesh), grid.soup());
        EXPECT_EQ(mesh.vertices.position.size(),
                  one_mesh ? grid.vertexCount() : 2 * grid.n * (grid.n + 1));
    }
}

TEST(GltfSource, keepsAttributesThatAllPrimitivesHave) {
    const ScratchDirectory dir;
    Builder b = attributeMesh(false, kUbyte, 3);
    Json other = b.json["meshes"][0]["primitives"][0];
    other["attributes"].erase("NORMAL");
    other["attributes"].erase("COLOR_0");
    other["attributes"].erase("_ID");
    other["attributes"]["TEXCOORD_0"] = 0;
    other["attributes"]["_VECTOR"] = 0;
    other["targets"] = {{{"POSITION", 0}}};
    b.json["meshes"][0]["primitives"].push_back(other);
    other["mode"] = 1;
    b.json["meshes"][0]["primitives"].push_back(other);
    b.json["materials"] = {Json::object()};
    b.json["animations"] = {Json::object()};
    const WholeMesh mesh = readWhole(dir.write("a.glb", b.glb()));
    EXPECT_EQ(mesh.schema, (AttributeSchema{false, true, {"HEAT"}}));
    ASSERT_EQ(mesh.vertices.colour.size(), 600u);
    EXPECT_EQ(mesh.vertices.colour[7], (Rgba8{7, 14, 21, 255}));
    EXPECT_EQ(mesh.vertices.colour[307], (Rgba8{255, 255, 255, 255}));
    EXPECT_EQ(mesh.notes,
              (std::vector<std::string>{
                  "texture coordinates, materials, morph targets and animations are left out",
                  "1 primitives of points or lines are left out",
                  "attributes that not all primitives have are left out",
                  "custom attributes that are no scalars are left out"}));
}

TEST(GltfSource, readsWhatTheWriterWrites) {
    const ScratchDirectory dir;
    MeshOutput output;
    output.schema = {true, true, {"A", "B"}};
    output.centre = {1000, 2000, 3000};
    VertexBatch vertices;
    for (uint64_t v = 0; v < 100; ++v) {
        vertices.position.push_back(output.centre + Vec3d(noise(v), noise(v + 1), noise(v + 2)));
        vertices.normal.push_back({0, 0.6f, 0.8f});
        vertices.colour.push_back({uint8_t(v), 1, 2, 3});
        vertices.scalar.insert(vertices.scalar.end(), {float(v), noise(v)});
    }
    std::vector<std::array<uint64_t, 3>> triangles;
    for (uint64_t i = 0; i + 3 <= 100; ++i) triangles.push_back({i, i + 1, i + 2});
    const auto writer = createMesh(dir.file("a.glb"), false, output);
    writer->addVertices(vertices);
    writer->addTriangles(triangles);
    writer->finish();
    const WholeMesh mesh = readWhole(dir.file("a.glb"));
    EXPECT_EQ(mesh.schema, output.schema);
    EXPECT_EQ(mesh.triangles, triangles);
    EXPECT_EQ(mesh.vertices.colour, vertices.colour);
    EXPECT_EQ(mesh.vertices.scalar, vertices.scalar);
    for (size_t v = 0; v < 100; ++v) {
        const Vec3d d = mesh.vertices.position[v] - vertices.position[v];
        EXPECT_LT(glm::dot(d, d), 1e-12);
        EXPECT_LT(std::abs(mesh.vertices.normal[v].z - 0.8f), 1e-6f);
    }
}

/// A triangle, to be spoilt.
Builder triangle() {
    Builder b;
    const size_t positions =
        b.values(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, kReal, "VEC3", 3);
    const size_t indices = b.values(std::vector<uint16_t>{0, 1, 2}, kUshort, "SCALAR", 1);
    b.mesh({{"attributes", {{"POSITION", positions}}}, {"indices", indices}});
    b.json["nodes"] = {{{"mesh", 0}}};
    b.json["scenes"] = {{{"nodes", {0}}}};
    return b;
}

TEST(GltfSource, namesEveryFaultOfTheJson) {
    const ScratchDirectory dir;
    struct Case {
        const char *pointer, *value, *fault;
    };
    const Case cases[] = {
        {"/asset/version", "\"1.0\"", "asset.version: Pietra reads glTF 2, not \"1.0\""},
        {"/asset", "{}", "asset.version: is missing"},
        {"/scene", "1", "scene: there is no scene 1: there are 1"},
        {"/scene", "-1", "scene: is no index"},
        {"/accessors", "3", "accessors: is no array"},
        {"/accessors", "[3]", "accessors[0]: is no object"},
        {"/accessors", "[[{}]]", "accessors[0]: is no object"},
        {"/extensionsRequired", "[\"KHR_draco_mesh_compression\"]",
         "extensionsRequired: Pietra does not know the extension KHR_draco_mesh_compression, "
         "without which the file cannot be read"},
        {"/scenes/0/nodes/0", "1", "scenes[0].nodes: there is no node 1: there are 1"},
        {"/scenes/0/nodes/1", "0",
         "scenes[0].nodes: node 0 has another parent, or is below itself"},
        {"/nodes/0/children", "[0]",
         "nodes[0].children: node 0 has another parent, or is below itself"},
        {"/nodes/0/children", "[7]", "nodes[0].children: there is no node 7: there are 1"},
        {"/nodes/0/mesh", "1", "nodes[0].mesh: there is no mesh 1: there are 1"},
        {"/nodes/0/mesh", "0.5", "nodes[0].mesh: is no whole number"},
        {"/nodes/0/matrix", "[1,2]", "nodes[0].matrix: is no array of 16 numbers"},
        {"/nodes/0/rotation", "[0,0,0,0]", "nodes[0].rotation: is no quaternion"},
        {"/meshes/0/primitives", "{}", "meshes[0].primitives: is no array"},
        {"/meshes/0/primitives", "[]", "has no triangles to show in its scene"},
        {"/meshes/0/primitives/0/mode", "7", "meshes[0].primitives[0].mode: 7 is none of glTF"},
        {"/meshes/0/primitives/0/indices", "2",
         "meshes[0].primitives[0].indices: there is no accessor 2: there are 2"},
        {"/meshes/0/primitives/0/indices", "0",
         "meshes[0].primitives[0].indices: are no unsigned whole numbers"},
        {"/meshes/0/primitives/0/attributes/POSITION", "1",
         "meshes[0].primitives[0].attributes.POSITION: is no VEC3"},
        {"/meshes/0/primitives/0/attributes/NORMAL", "1",
         "meshes[0].primitives[0].attributes.NORMAL: has 1 components"},
        {"/accessors/0/count", "4",
         "accessors[0]: 4 elements of 12 bytes from 0 on, every 12, are not within a bufferView of "
         "36 bytes"},
        {"/accessors/0/count", "18446744073709551615",
         "accessors[0]: 18446744073709551615 elements of 12 bytes from 0 on, every 12, are not "
         "within a bufferView of 36 bytes"},
        {"/accessors/0/byteOffset", "18446744073709551615",
         "accessors[0]: 3 elements of 12 bytes from 18446744073709551615 on, every 12, are not "
         "within a bufferView of 36 bytes"},
        {"/accessors/0/componentType", "5124", "accessors[0].componentType: 5124 is none of glTF"},
        {"/accessors/0/type", "\"VEC9\"", "accessors[0].type: \"VEC9\" is none of glTF"},
        {"/accessors/0/type", "\"MAT3\"", "accessors[0].type: is a matrix"},
        {"/accessors/0/bufferView", "9",
         "accessors[0].bufferView: there is no view 9: there are 2"},
        {"/bufferViews/0/buffer", "1", "bufferViews[0].buffer: there is no buffer 1: there are 1"},
        {"/bufferViews/0/byteLength", "99",
         "bufferViews[0]: 99 bytes from 0 on are not within a buffer of 42"},
        {"/bufferViews/0/byteOffset", "18446744073709551615",
         "bufferViews[0]: 36 bytes from 18446744073709551615 on are not within a buffer of 42"},
        {"/bufferViews/0/byteStride", "8",
         "bufferViews[0].byteStride: 8 is less than the 12 bytes of an element"},
    };
    for (const Case& c : cases) {
        Builder b = triangle();
        b.json[Json::json_pointer(c.pointer)] = Json::parse(c.value);
        const std::string path = dir.write("bad.glb", b.glb());
        EXPECT_EQ(faultOf(path), path + ": " + c.fault) << c.pointer << ' ' << c.value;
    }
}

TEST(GltfSource, namesEveryFaultOfTheData) {
    const ScratchDirectory dir;
    const std::string good = triangle().glb();
    const size_t data = good.find("BIN") + 4;
    const auto fault = [&](std::string text, const char* name = "bad.glb") {
        const std::string path = dir.write(name, text);
        return faultOf(path).substr(path.size() + 2);
    };
    const auto with = [&](size_t at, const std::string& bytes) {
        return std::string(good).replace(at, bytes.size(), bytes);
    };
    const auto byte = [](size_t at) { return "byte " + std::to_string(at); };
    EXPECT_EQ(fault(with(data + 12, std::string("\0\0\xc0\x7f", 4))),
              "accessors[0], element 1 (" + byte(data + 12) +
                  "): vertex 1 is at (nan, 0, 0), which is no point");
    EXPECT_EQ(fault(with(data + 40, "\3")), "accessors[1], element 2 (" + byte(data + 40) +
                                                "): vertex index 3 in a primitive of 3 vertices");
    EXPECT_EQ(fault(with(4, "\1")), "byte 4: Pietra reads glTF 2, not 1");
    EXPECT_EQ(fault(with(8, "\xff\xff")), "byte 8: the head counts 65535 bytes, but the file has " +
                                              std::to_string(good.size()));
    EXPECT_EQ(fault(with(14, "\1")), "byte 12: a chunk of " +
                                         std::to_string(data - 8 - 20 + 65536) +
                                         " bytes in a file of " + std::to_string(good.size()));
    EXPECT_EQ(fault(with(16, "BIN")), "byte 16: the first chunk is not the JSON");
    EXPECT_EQ(fault(with(30, "\1")).substr(0, 8), "byte 31:");
    EXPECT_EQ(fault("{\"asset\":{\"version\":\"2.0\"},}", "bad.gltf"),
              "byte 28: the JSON is damaged here");

    const Builder b = triangle();
    const auto withUri = [&](const std::string& uri) { return fault(b.gltf(uri), "bad.gltf"); };
    EXPECT_EQ(withUri("data:application/octet-stream;base64,AAAA"),
              "buffers[0].byteLength: counts 42 bytes, but there are 3");
    EXPECT_EQ(withUri("data:application/octet-stream;base64,AA!A"),
              "buffers[0].uri: its base64 data is damaged");
    EXPECT_EQ(withUri("data:application/octet-stream,AA"),
              "buffers[0].uri: holds data that is not base64");
    for (const char* uri : {"http://example.org/a.bin", "/a.bin", "a%zz", ""})
        EXPECT_EQ(withUri(uri), "buffers[0].uri: is no name of a file beside the glTF file");
    const std::string path = dir.write("lost.gltf", b.gltf("none.bin"));
    try {
        readWhole(path);
        FAIL();
    } catch (const IoError& e) {
        EXPECT_EQ(e.what(), dir.file("none.bin") + ": cannot open: No such file or directory");
    }
    dir.write("short.bin", "short");
    EXPECT_EQ(withUri("short.bin"), "buffers[0].byteLength: counts 42 bytes, but there are 5 in " +
                                        dir.file("short.bin"));
    Builder none = triangle();
    none.json["buffers"] = {{{"byteLength", 42}}};
    EXPECT_EQ(fault(none.json.dump(), "bad.gltf"),
              "buffers[0].uri: is missing, so its data is nowhere");

    for (size_t more = 0; more < 3; ++more) {  // with each kind of padding
        Builder padded = plainGrid(Grid{30});
        padded.data.resize(padded.data.size() + more);
        Json json = Json::parse(padded.embedded());
        const size_t size = padded.data.size();
        json["buffers"][0]["byteLength"] = size + 1;
        EXPECT_EQ(fault(json.dump(), "bad.gltf"),
                  "buffers[0].byteLength: counts " + std::to_string(size + 1) +
                      " bytes, but there are " + std::to_string(size));
    }

    const Builder grid = plainGrid(Grid{30});
    std::string embedded = grid.embedded();
    const size_t at = embedded.find("base64,") + 7 + 5000;
    embedded[at] = '!';
    EXPECT_EQ(fault(embedded, "bad.gltf"), byte(at) + ": is no character of base64");
}

TEST(GltfSource, neverHangsOnBombs) {
    const ScratchDirectory dir;
    // Each node is a child of the one before, twice: 2^40 places of one triangle.
    Builder b = triangle();
    b.json["nodes"] = Json::array();
    for (int i = 0; i < 40; ++i) b.json["nodes"].push_back({{"children", {i + 1, i + 1}}});
    b.json["nodes"].push_back({{"mesh", 0}});
    std::string path = dir.write("bad.glb", b.glb());
    EXPECT_EQ(faultOf(path), path +
                                 ": nodes[0].children: node 1 has another parent, or is below "
                                 "itself");
    // A ring that no root leads to.
    b = triangle();
    b.json["nodes"] = {{{"mesh", 0}}, {{"children", {2}}}, {{"children", {1}}}};
    b.json.erase("scenes");
    path = dir.write("bad.glb", b.glb());
    EXPECT_EQ(faultOf(path), path + ": nodes[1]: is below itself");
    // Many places of many primitives of many corners.
    b = plainGrid(Grid{100});
    const Json primitive = b.json["meshes"][0]["primitives"][0];
    for (int i = 0; i < 9999; ++i) b.json["meshes"][0]["primitives"].push_back(primitive);
    for (int i = 0; i < 10000; ++i) b.json["nodes"].push_back({{"mesh", 0}});
    path = dir.write("bad.glb", b.glb());
    EXPECT_EQ(faultOf(path), path +
                                 ": its meshes and instances add up to more than 2^40 "
                                 "triangles or vertices");
    // Less of them: a valid file, read as far as one likes.
    b.json["nodes"].erase(b.json["nodes"].begin() + 1000, b.json["nodes"].end());
    const auto source = openSource({dir.write("large.glb", b.glb())});
    EXPECT_EQ(source->triangleCountHint(), 20000ull * 10000 * 1000);
    TriangleBatch triangles;
    EXPECT_TRUE(source->readTriangles(triangles));
    // Zeros that nothing backs.
    b = triangle();
    b.json["accessors"][0].erase("bufferView");
    b.json["accessors"][0]["count"] = uint64_t(1) << 39;
    b.json["accessors"][0]["sparse"] = {
        {"count", 1},
        {"indices", {{"bufferView", 1}, {"componentType", kUshort}}},
        {"values", {{"bufferView", 0}}}};
    path = dir.write("bad.glb", b.glb());
    EXPECT_EQ(faultOf(path), path +
                                 ": accessors[0].count: 549755813888 zeros are more than the 42 "
                                 "bytes of all buffers");
    // Deep nesting.
    path = dir.write("bad.gltf", "{\"asset\":" + std::string(1000000, '['));
    EXPECT_EQ(faultOf(path), path + ": byte 1000009: the JSON is damaged here");
}

TEST(GltfSource, noticesATruncationAtEveryByte) {
    const ScratchDirectory dir;
    Builder b = triangle();
    for (const std::string& text : {b.glb(), b.embedded()})
        for (size_t size = 0; size < text.size(); ++size)
            ASSERT_NE(faultOf(dir.write("cut.gltf", text.substr(0, size))), "") << size;
}

TEST(GltfSource, survivesAnyChangeOfAByte) {
    const ScratchDirectory dir;
    const std::string text = attributeMesh(true, kUbyte, 4).glb();
    const size_t end = text.find("BIN") + 40;
    for (size_t i = 0; i < end; ++i)
        for (const int flip : {0x01, 0x10, 0x80}) {
            std::string bad = text;
            bad[i] = char(uint8_t(bad[i]) ^ flip);
            faultOf(dir.write("bad.glb", bad));  // an error or a mesh, whichever
        }
}

TEST(GltfSource, readsPackedFilesBesideIt) {
    const ScratchDirectory dir;
    const Builder b = triangle();
    const std::string plain = dir.write("plain.bin", b.data), packed = gzipped(b.data);
    const WholeMesh expected = readWhole(dir.write("a.gltf", b.gltf("plain.bin")));
    dir.write("data.bin", packed);
    dir.write("other.bin.gz", packed);
    for (const char* uri : {"data.bin", "other.bin", "other.bin.gz"}) {
        const std::string path = dir.write("a.gltf", b.gltf(uri));
        expectSameMesh(readWhole(path), expected);
        EXPECT_EQ(openSource({path})->inputBytes(), b.gltf(uri).size() + packed.size());
    }
    const std::string cut = dir.write("cut.bin", packed.substr(0, packed.size() - 9));
    EXPECT_EQ(faultOf(dir.write("a.gltf", b.gltf("cut.bin"))),
              fmt::format("{}: byte {}: the gzip data ends early", cut, packed.size() - 9));
}

TEST(GltfSource, namesExtensionsThatItDoesNotKnow) {
    const ScratchDirectory dir;
    Builder b = triangle();
    b.json["extensionsUsed"] = {"KHR_draco_mesh_compression", "KHR_materials_unlit",
                                "EXT_mesh_gpu_instancing", "KHR_mesh_quantization"};
    EXPECT_EQ(readWhole(dir.write("a.glb", b.glb())).notes,
              std::vector<std::string>{"extension KHR_draco_mesh_compression is left out"});
    b.json["extensionsUsed"].push_back("EXT_meshopt_compression");
    EXPECT_EQ(readWhole(dir.write("a.glb", b.glb())).notes,
              std::vector<std::string>{"extensions KHR_draco_mesh_compression and "
                                       "EXT_meshopt_compression are left out"});
    b.json["extensionsUsed"].erase(4);
    const std::string why =
        " (the file uses KHR_draco_mesh_compression, which Pietra does not know)";
    Builder nowhere = b;
    nowhere.json["accessors"][0].erase("bufferView");
    const std::string path = dir.write("b.glb", nowhere.glb());
    EXPECT_EQ(faultOf(path), path + ": accessors[0].bufferView: is missing" + why);
    Json text = Json::parse(b.gltf("data.bin"));
    text["buffers"][0].erase("uri");
    EXPECT_EQ(faultOf(dir.write("b.gltf", text.dump())),
              dir.file("b.gltf") + ": buffers[0].uri: is missing, so its data is nowhere" + why);
}

TEST(GltfSource, readsLargeFilesInLittleMemory) {
    const ScratchDirectory dir;
    std::vector<std::string> paths;
    {
        const Builder b = plainGrid(Grid{700});
        paths = {dir.write("a.glb", b.glb()), dir.write("a.gltf", b.embedded())};
    }
    for (const std::string& path : paths)
        EXPECT_EQ(trianglesReadWithin(10, {path}, FreedMemory::kIsSpared), 980000u);
}

TEST(GltfSource, realFilesHaveTheCountsMeasuredByOthers) {
    const std::string folder = sharedData("textured/mars_dingo_gap_3dtiles");
    if (folder.empty()) GTEST_SKIP() << "no mars_dingo_gap_3dtiles in the shared data";
    const ScratchDirectory dir;
    size_t leaves = 0, triangles = 0;
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
        if (entry.path().extension() == ".b3dm") names.push_back(entry.path().stem().string());
    for (const std::string& name : names) {
        const bool leaf = std::none_of(names.begin(), names.end(), [&](const std::string& other) {
            return other.size() > name.size() && other.starts_with(name);
        });
        if (!leaf || name == "root") continue;
        // A b3dm is a GLB behind a head.
        const std::string tile = readWholeFile(folder + "/" + name + ".b3dm");
        const WholeMesh mesh = readWhole(dir.write("a.glb", tile.substr(tile.find("glTF"))));
        EXPECT_TRUE(mesh.schema.normals_given);
        EXPECT_EQ(mesh.notes, std::vector<std::string>{
                                  "texture coordinates, materials and textures are left out"});
        ++leaves;
        triangles += mesh.triangles.size();
    }
    EXPECT_EQ(leaves, 220u);
    EXPECT_EQ(triangles, 177950u);
}

}  // namespace
}  // namespace pietra
