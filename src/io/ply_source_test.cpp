// The PLY reader: every form of a mesh gives the same batches, bad files name their fault, real
// files have the counts measured by others.

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstring>

#include "base/budget.h"
#include "base/hash.h"
#include "io/test_files.h"

namespace pietra {
namespace {

/// Builds PLY files row by row in any of the three encodings.
class PlyBuilder {
public:
    enum Encoding { kAscii, kLittle, kBig };
    explicit PlyBuilder(Encoding encoding, std::string line_end = "\n")
        : encoding_(encoding), line_end_(line_end) {
        const char* names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
        line("ply").line(std::string("format ") + names[encoding] + " 1.0");
    }
    PlyBuilder& line(const std::string& text) {
        text_ += text + line_end_;
        return *this;
    }
    template <class T>
    PlyBuilder& value(T v) {
        if (encoding_ == kAscii) {
            char digits[64];
            if constexpr (std::is_floating_point_v<T>)
                std::snprintf(digits, sizeof digits, "%.*g", sizeof v == 4 ? 9 : 17, double(v));
            else
                std::snprintf(digits, sizeof digits, "%lld", static_cast<long long>(v));
            text_ += text_.ends_with(line_end_) ? digits : std::string(" ") + digits;
            return *this;
        }
        char bytes[sizeof v];
        std::memcpy(bytes, &v, sizeof v);
        if (encoding_ == kBig) std::reverse(bytes, bytes + sizeof v);
        text_.append(bytes, sizeof v);
        return *this;
    }
    /// A value of the type that the header calls `type`.
    PlyBuilder& typed(const std::string& type, double v) {
        if (type == "char") return value(int8_t(v));
        if (type == "uchar") return value(uint8_t(v));
        if (type == "short") return value(int16_t(v));
        if (type == "ushort") return value(uint16_t(v));
        if (type == "int") return value(int32_t(v));
        if (type == "uint") return value(uint32_t(v));
        if (type == "int64") return value(int64_t(v));
        if (type == "uint64") return value(uint64_t(v));
        if (type == "float") return value(float(v));
        return value(v);
    }
    PlyBuilder& endRow() {
        if (encoding_ == kAscii) text_ += line_end_;
        return *this;
    }
    const std::string& text() const { return text_; }

private:
    Encoding encoding_;
    std::string line_end_;
    std::string text_;
};

constexpr PlyBuilder::Encoding kEncodings[] = {PlyBuilder::kAscii, PlyBuilder::kLittle,
                                               PlyBuilder::kBig};

/// A number in [-1, 1) that depends on i alone.
float noise(uint64_t i) {
    return float(int64_t(mixBits(i + 1)) >> 40) * 0x1p-23f;
}

/// A grid of n x n quads, as triangles: (n+1)^2 vertices.
struct Grid {
    int n;
    uint64_t vertexCount() const { return uint64_t(n + 1) * (n + 1); }
    std::vector<std::array<int, 3>> triangles() const {
        std::vector<std::array<int, 3>> out;
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i) {
                const int a = j * (n + 1) + i, b = a + 1, c = a + n + 2, d = a + n + 1;
                out.push_back({a, b, c});
                out.push_back({a, c, d});
            }
        return out;
    }
    Vec3f position(uint64_t v) const { return {noise(3 * v), noise(3 * v + 1), noise(3 * v + 2)}; }
};

void addTriangle(PlyBuilder& ply, const std::array<int, 3>& t,
                 const std::string& count_type = "uchar", const std::string& index_type = "int") {
    ply.typed(count_type, 3);
    for (const int k : t) ply.typed(index_type, k);
    ply.endRow();
}

std::string plainGrid(const Grid& grid, PlyBuilder::Encoding encoding,
                      const std::string& count_type = "uchar",
                      const std::string& index_type = "int", const std::string& line_end = "\n",
                      bool faces_first = false) {
    PlyBuilder ply(encoding, line_end);
    const auto triangles = grid.triangles();
    const std::string vertex_count = std::to_string(grid.vertexCount());
    const auto vertexHeader = [&] {
        ply.line("element vertex " + vertex_count);
        for (const char* axis : {"x", "y", "z"}) ply.line(std::string("property float ") + axis);
    };
    const auto faceHeader = [&] {
        ply.line("element face " + std::to_string(triangles.size()));
        ply.line("property list " + count_type + " " + index_type + " vertex_indices");
    };
    ply.line("comment made for a test");
    if (faces_first) faceHeader();
    vertexHeader();
    if (!faces_first) faceHeader();
    ply.line("end_header");
    const auto vertices = [&] {
        for (uint64_t v = 0; v < grid.vertexCount(); ++v) {
            const Vec3f p = grid.position(v);
            ply.value(p.x).value(p.y).value(p.z).endRow();
        }
    };
    if (!faces_first) vertices();
    for (const auto& t : triangles) addTriangle(ply, t, count_type, index_type);
    if (faces_first) vertices();
    return ply.text();
}

TEST(PlySource, readsPositionsAndTrianglesExactly) {
    const ScratchDirectory dir;
    const Grid grid{260};  // more vertices and triangles than a batch holds
    const WholeMesh mesh = readWhole(dir.write("a.ply", plainGrid(grid, PlyBuilder::kLittle)));
    ASSERT_EQ(mesh.vertices.position.size(), grid.vertexCount());
    for (uint64_t v = 0; v < grid.vertexCount(); ++v)
        ASSERT_EQ(mesh.vertices.position[v], Vec3d(grid.position(v)));
    const auto triangles = grid.triangles();
    ASSERT_EQ(mesh.triangles.size(), triangles.size());
    for (size_t t = 0; t < triangles.size(); ++t)
        for (int k = 0; k < 3; ++k) ASSERT_EQ(mesh.triangles[t][k], uint64_t(triangles[t][k]));
    EXPECT_TRUE(mesh.notes.empty());
    EXPECT_EQ(mesh.schema, AttributeSchema{});
}

TEST(PlySource, givesTheSameForEveryEncodingAndLineEnd) {
    const ScratchDirectory dir;
    const Grid grid{120};
    const WholeMesh expected = readWhole(dir.write("a.ply", plainGrid(grid, PlyBuilder::kLittle)));
    for (const auto encoding : kEncodings)
        for (const char* line_end : {"\n", "\r\n", "\r"})
            for (const bool faces_first : {false, true}) {
                const std::string text =
                    plainGrid(grid, encoding, "uchar", "int", line_end, faces_first);
                SCOPED_TRACE(text.substr(0, 60));
                expectSameMesh(expected, readWhole(dir.write("b.ply", text)));
                expectSameMesh(expected, readWhole(dir.write("c.ply.gz", gzipped(text))));
            }
}

TEST(PlySource, takesEveryTypeOfListCountAndIndex) {
    const ScratchDirectory dir;
    const Grid grid{10};
    const WholeMesh expected = readWhole(dir.write("a.ply", plainGrid(grid, PlyBuilder::kLittle)));
    const char* types[] = {"char", "uchar", "short", "ushort", "int", "uint", "int64", "uint64"};
    for (const auto encoding : kEncodings)
        for (const char* count_type : types)
            for (const char* index_type : types) {
                SCOPED_TRACE(std::string(count_type) + " " + index_type);
                const std::string text = plainGrid(grid, encoding, count_type, index_type);
                expectSameMesh(expected, readWhole(dir.write("b.ply", text)));
            }
}

TEST(PlySource, takesEveryTypeOfVertexProperty) {
    const ScratchDirectory dir;
    for (const char* type : {"char", "uchar", "short", "ushort", "int", "uint", "int64", "uint64",
                             "float", "double"}) {
        for (const auto encoding : kEncodings) {
            SCOPED_TRACE(std::string(type) + " " + std::to_string(encoding));
            PlyBuilder ply(encoding);
            ply.line("element vertex 3");
            for (const char* name : {"x", "y", "z", "quality"})
                ply.line(std::string("property ") + type + " " + name);
            ply.line("element face 1").line("property list uchar int vertex_index");
            ply.line("end_header");
            for (int v = 0; v < 3; ++v) {
                for (int k = 0; k < 4; ++k) ply.typed(type, 10 * v + k);
                ply.endRow();
            }
            addTriangle(ply, {2, 1, 0});
            const WholeMesh mesh = readWhole(dir.write("a.ply", ply.text()));
            EXPECT_EQ(mesh.vertices.position[2], Vec3d(20, 21, 22));
            EXPECT_EQ(mesh.schema.scalars, std::vector<std::string>{"quality"});
            EXPECT_EQ(mesh.vertices.scalar, (std::vector<float>{3, 13, 23}));
        }
    }
}

TEST(PlySource, keepsDoublesWhole) {
    const ScratchDirectory dir;
    const double far = 1737400.123456789;
    for (const auto encoding : kEncodings) {
        PlyBuilder ply(encoding);
        ply.line("element vertex 3");
        for (const char* name : {"x", "y", "z"}) ply.line(std::string("property double ") + name);
        ply.line("element face 1").line("property list uchar int vertex_index").line("end_header");
        for (int v = 0; v < 3; ++v) ply.value(far).value(far / 3).value(1.0 + v).endRow();
        addTriangle(ply, {0, 1, 2});
        const WholeMesh mesh = readWhole(dir.write("a.ply", ply.text()));
        EXPECT_EQ(mesh.vertices.position[1], Vec3d(far, far / 3, 2));
    }
}

/// Vertices with everything: lists, normals, colours of `colour_type`, scalars, texture
/// coordinates.
std::string attributeMesh(PlyBuilder::Encoding encoding, bool vertex_list,
                          const std::string& colour_type) {
    PlyBuilder ply(encoding);
    ply.line("comment TextureFile a.png")
        .line("obj_info anything")
        .line("element camera 2")
        .line("property float view_px");
    ply.line("property list uchar short crop").line("element vertex 4");
    ply.line("property double heat").line("property float x").line("property float y");
    if (vertex_list) ply.line("property list ushort float rest");
    ply.line("property float z");
    for (const char* name : {"nx", "ny", "nz"}) ply.line(std::string("property float ") + name);
    for (const char* name : {"red", "green", "blue", "alpha"})
        ply.line("property " + colour_type + " " + name);
    ply.line("property float s").line("property float t").line("property short label");
    ply.line("element face 2")
        .line("property uchar red")
        .line("property list uint uint vertex_index");
    ply.line("property list uchar float texcoord")
        .line("element edge 1")
        .line("property int vertex1");
    ply.line("end_header");
    for (int i = 0; i < 2; ++i) {
        ply.value(1.5f).value(uint8_t(i + 1));
        for (int k = 0; k <= i; ++k) ply.value(int16_t(k));
        ply.endRow();
    }
    const double full = colour_type == "uchar" ? 255 : colour_type == "ushort" ? 65535 : 1;
    for (int v = 0; v < 4; ++v) {
        ply.value(v * 0.25).value(float(v)).value(float(v * v));
        if (vertex_list) {
            ply.value(uint16_t(v));
            for (int k = 0; k < v; ++k) ply.value(0.5f);
        }
        ply.value(float(-v)).value(0.f).value(0.6f).value(0.8f);
        for (const double c : {0.0, 0.2, 0.6, 1.0}) ply.typed(colour_type, c * full);
        ply.value(0.1f).value(0.2f).value(int16_t(-v)).endRow();
    }
    ply.value(uint8_t(9)).value(3u).value(0u).value(1u).value(2u).value(uint8_t(0)).endRow();
    ply.value(uint8_t(9)).value(4u).value(0u).value(1u).value(2u).value(3u);
    ply.value(uint8_t(1)).value(0.5f).endRow();
    ply.value(7).endRow();
    return ply.text();
}

TEST(PlySource, carriesAttributesAndSkipsTheRest) {
    const ScratchDirectory dir;
    for (const auto encoding : kEncodings)
        for (const bool vertex_list : {false, true})
            for (const char* colour_type : {"uchar", "ushort", "float", "double"}) {
                SCOPED_TRACE(std::to_string(encoding) + colour_type);
                const WholeMesh mesh = readWhole(
                    dir.write("a.ply", attributeMesh(encoding, vertex_list, colour_type)));
                EXPECT_TRUE(mesh.schema.normals_given);
                EXPECT_TRUE(mesh.schema.colours);
                EXPECT_EQ(mesh.schema.scalars, (std::vector<std::string>{"heat", "label"}));
                EXPECT_EQ(mesh.vertices.position[3], Vec3d(3, 9, -3));
                EXPECT_EQ(mesh.vertices.normal[2], Vec3f(0.f, 0.6f, 0.8f));
                EXPECT_EQ(mesh.vertices.colour[1], (Rgba8{0, 51, 153, 255}));
                EXPECT_EQ(mesh.vertices.scalar,
                          (std::vector<float>{0, 0, 0.25f, -1, 0.5f, -2, 0.75f, -3}));
                EXPECT_EQ(mesh.triangles,
                          (std::vector<std::array<uint64_t, 3>>{{0, 1, 2}, {0, 1, 2}, {0, 2, 3}}));
                std::vector<std::string> notes;
                if (vertex_list) notes.push_back("property rest of element vertex is left out");
                notes.insert(
                    notes.end(),
                    {"texture coordinates are left out",
                     "property texcoord of element face is left out",
                     "colours of faces are left out", "1 polygons are cut into fans of triangles",
                     "elements camera and edge are left out", "textures are left out"});
                EXPECT_EQ(mesh.notes, notes);
            }
}

TEST(PlySource, namesWhatIsLeftOutInFewWords) {
    std::string head =
        "ply\nformat ascii 1.0\nelement \x1b[31m 1\nproperty int a\nelement none 0\n";
    for (int i = 0; i < 20; ++i) head += "element e" + std::to_string(i) + " 1\nproperty int a\n";
    head +=
        "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    std::string rows;
    for (int i = 0; i < 21; ++i) rows += "7\n";
    const ScratchDirectory dir;
    EXPECT_EQ(readWhole(dir.write("a.ply", head + rows + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")).notes,
              (std::vector<std::string>{
                  "elements ?[31m, e0, e1, e2, e3, e4, e5, e6, e7 and 12 others are left out"}));
}

TEST(PlySource, fansLongPolygonsAcrossBatches) {
    const ScratchDirectory dir;
    const int corners = 200000;
    for (const auto encoding : kEncodings) {
        PlyBuilder ply(encoding);
        ply.line("element vertex " + std::to_string(corners));
        for (const char* name : {"x", "y", "z"}) ply.line(std::string("property short ") + name);
        ply.line("element face 3").line("property list int int vertex_indices").line("end_header");
        for (int v = 0; v < corners; ++v)
            ply.value(int16_t(0)).value(int16_t(1)).value(int16_t(2)).endRow();
        ply.value(2).value(0).value(1).endRow();
        ply.value(corners);
        for (int v = 0; v < corners; ++v) ply.value(v);
        ply.endRow();
        ply.value(0).endRow();
        const WholeMesh mesh = readWhole(dir.write("a.ply", ply.text()));
        ASSERT_EQ(mesh.triangles.size(), size_t(corners - 2));
        for (uint64_t t = 0; t < mesh.triangles.size(); ++t)
            ASSERT_EQ(mesh.triangles[t], (std::array<uint64_t, 3>{0, t + 1, t + 2}));
        EXPECT_EQ(mesh.notes,
                  (std::vector<std::string>{"1 polygons are cut into fans of triangles",
                                            "2 faces of fewer than three corners are left out"}));
    }
}

/// Faces of 1 to 9 corners, mixed at random, between other properties; larger than window and
/// batch.
std::string mixedPolygons(PlyBuilder::Encoding encoding, const std::string& count_type, int faces) {
    const int vertices = 1000;
    PlyBuilder ply(encoding);
    ply.line("element vertex " + std::to_string(vertices));
    for (const char* name : {"x", "y", "z"}) ply.line(std::string("property char ") + name);
    ply.line("element face " + std::to_string(faces)).line("property short before");
    ply.line("property list " + count_type + " int vertex_indices").line("property uchar after");
    ply.line("end_header");
    for (int v = 0; v < vertices; ++v)
        ply.value(int8_t(v)).value(int8_t(1)).value(int8_t(2)).endRow();
    for (int f = 0; f < faces; ++f) {
        const uint64_t random = mixBits(uint64_t(f));
        const int corners = random % 2 ? 3 : 1 + int(random / 2 % 9);
        ply.value(int16_t(f)).typed(count_type, corners);
        for (int k = 0; k < corners; ++k) ply.value(int(mixBits(random + uint64_t(k)) % vertices));
        ply.value(uint8_t(f)).endRow();
    }
    return ply.text();
}

TEST(PlySource, mixedPolygonsAreTheSameInEveryForm) {
    const ScratchDirectory dir;
    const int faces = 80000;
    const WholeMesh expected =
        readWhole(dir.write("a.ply", mixedPolygons(PlyBuilder::kAscii, "int", faces)));
    EXPECT_GT(expected.triangles.size(), 2 * kMaxBatch);
    for (const auto encoding : kEncodings)
        for (const char* count_type : {"uchar", "char", "ushort"}) {
            const WholeMesh mesh =
                readWhole(dir.write("b.ply", mixedPolygons(encoding, count_type, faces)));
            expectSameMesh(mesh, expected);
            EXPECT_EQ(mesh.notes, expected.notes);
        }
}

TEST(PlySource, unrollsStrips) {
    const ScratchDirectory dir;
    for (const auto encoding : kEncodings)
        for (const char* type : {"int", "uint"}) {
            PlyBuilder ply(encoding);
            ply.line("element vertex 6");
            for (const char* name : {"x", "y", "z"})
                ply.line(std::string("property float ") + name);
            ply.line("element tristrips 1");
            ply.line(std::string("property list int ") + type + " vertex_indices");
            ply.line("end_header");
            for (int v = 0; v < 18; ++v) {
                ply.value(float(v));
                if (v % 3 == 2) ply.endRow();
            }
            ply.value(11);
            for (const int k : {0, 1, 2, 3, -1, 5, 4, 3, 3, 2, 1}) {
                if (std::string(type) == "uint")
                    ply.value(uint32_t(k));
                else
                    ply.value(k);
                if (k == -1) ply.endRow();  // in text a strip may go over several lines
            }
            ply.endRow();
            const WholeMesh mesh = readWhole(dir.write("a.ply", ply.text()));
            EXPECT_EQ(mesh.triangles, (std::vector<std::array<uint64_t, 3>>{
                                          {0, 1, 2}, {2, 1, 3}, {5, 4, 3}, {2, 3, 1}}));
        }
}

TEST(PlySource, joinsManyFilesInTheMemoryOfOne) {
    const ScratchDirectory dir;
    const std::string path = dir.write("a.ply", plainGrid(Grid{250}, PlyBuilder::kLittle));
    const std::vector<std::string> paths(40, path);
    EXPECT_EQ(trianglesReadWithin(12, paths, FreedMemory::kIsSpared), 40u * 125000);
}

const char kVertexHeader[] =
    "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
const char kFaceHeader[] = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";

TEST(PlySource, namesEveryFault) {
    const ScratchDirectory dir;
    const std::string vertices = kVertexHeader, faces = kFaceHeader;
    const std::string head = "ply\nformat ascii 1.0\n" + vertices + faces;
    const std::string points = "0 0 0\n1 0 0\n0 1 0\n";
    struct Case {
        std::string text, fault;
    };
    const Case cases[] = {
        {"", "the file is empty"},
        {"plywood", "is of no format that Pietra reads (PLY, STL, glTF, OBJ)"},
        {"ply\nformat ascii 1.0\n", "line 3: the header has no end_header"},
        {"ply \n", "line 2: the header has no end_header"},
        {"ply x\n", "is no PLY file: its first line is not \"ply\""},
        {"ply\nformat binary_middle_endian 1.0\nend_header\n",
         "line 2: \"binary_middle_endian\" is no format of a PLY file"},
        {"ply\nformat\n", "line 2: the format is missing"},
        {"ply\n" + vertices + faces + points, "line 8: the header names no format"},
        {"ply\nformat ascii 1.0\nproperty float x\n",
         "line 3: a property stands before the first element"},
        {"ply\nformat ascii 1.0\nelement vertex\n", "line 3: an element has a name and a count"},
        {"ply\nformat ascii 1.0\nelement vertex -1\n",
         "line 3: the count of element \"vertex\" is no number: \"-1\""},
        {"ply\nformat ascii 1.0\nelement vertex 99999999999999999999\n",
         "line 3: the count of element \"vertex\" is no number: \"99999999999999999999\""},
        {"ply\nformat ascii 1.0\nelement vertex 1\nelement vertex 1\n",
         "line 4: element \"vertex\" stands there twice"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\n",
         "line 4: \"half\" is no type of a property"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float x\n",
         "line 5: property \"x\" of element \"vertex\" stands there twice"},
        {"ply\nformat ascii 1.0\nelement face 1\nproperty list uchar vertex_indices\n",
         "line 4: a property has a type and a name, a list two types and a name"},
        {"ply\nformat ascii 1.0\nelement face 1\nproperty list float int vertex_indices\n",
         "line 4: the count of a list cannot be a real number"},
        {"ply\nformat ascii 1.0\nfoo\x01 bar\n", "line 3: \"foo?\" is no word of a PLY header"},
        {"ply\nformat ascii 1.0\n" + faces, "the header has no element vertex"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
         "the vertices have no properties x, y and z"},
        {"ply\nformat ascii 1.0\n" + vertices + "element face 1\nproperty uchar red\nend_header\n" +
             points + "3\n",
         "element face has no list vertex_indices"},
        {"ply\nformat ascii 1.0\n" + vertices +
             "element face 1\nproperty list uchar float vertex_indices\nend_header\n" + points +
             "3 0 1 2\n",
         "the vertex indices of element face are real numbers"},
        {"ply\nformat ascii 1.0\n" + vertices + "end_header\n" + points,
         "has vertices but no faces: a cloud of points is nothing to show"},
        {"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
         "property float z\n" +
             faces + "3 0 1 2\n",
         "has no vertices: nothing to show"},
        {head + points + "2 0 1\n", "has no face of three corners or more: nothing to show"},
        {head + points,
         "the file is too short for the 1 rows of element face that its header counts"},
        {head + "0 0 0\n1 0 0\n\n\n\n\n\n\n\n",
         "line 19: the file ends within element vertex, after 2 of 3 rows"},
        {head + points + "3 0 1", "line 13: the file ends within element face, after 0 of 1 rows"},
        {head + points + "3 0 1 2\n3 0 1 2\n",
         "line 14: the file goes on after the last element that its header counts"},
        {head + "0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
         "line 10: the line ends where property z of element vertex is expected"},
        {head + "0 0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
         "line 10: more values than element vertex has properties"},
        {head + "0 0 zero\n1 0 0\n0 1 0\n3 0 1 2\n",
         "line 10: \"zero\" is no number (property z of element vertex)"},
        {head + "0 0 1.5mm\n1 0 0\n0 1 0\n3 0 1 2\n",
         "line 10: \"1.5mm\" is no number (property z of element vertex)"},
        {head + "0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n",
         "line 11: vertex 1 is at (1, nan, 0), which is no point"},
        {head + "0 0 0\n1 1e99 0\n0 1 0\n3 0 1 2\n",
         "line 11: vertex 1 is at (1, inf, 0), which is no point"},
        {head + points + "3 0 1 3\n", "line 13: vertex index 3 in a mesh of 3 vertices"},
        {head + points + "3 0 1 -1\n", "line 13: vertex index -1 in a mesh of 3 vertices"},
        {head + points + "3 0 1 1.5\n",
         "line 13: \"1.5\" is no number (property vertex_indices of element face)"},
        {head + points + "-3 0 1 2\n",
         "line 13: a list of -3 items (property vertex_indices of element face)"},
        {head + points + "99 0 1 2\n", "line 13: a face of 99 corners in a mesh of 3 vertices"},
    };
    for (const Case& c : cases) {
        const std::string path = dir.write("bad.ply", c.text);
        EXPECT_EQ(faultOf(path), path + ": " + c.fault) << c.text;
    }
}

TEST(PlySource, namesFaultsOfBinaryFilesByOffset) {
    const ScratchDirectory dir;
    const Grid grid{4};
    for (const auto encoding : {PlyBuilder::kLittle, PlyBuilder::kBig}) {
        const std::string good = plainGrid(grid, encoding);
        const size_t body = good.find("end_header\n") + 11, faces = body + 25 * 12;
        const auto faultWith = [&](size_t at, const std::string& bytes) {
            std::string text = good;
            std::string swapped(bytes.rbegin(), bytes.rend());
            text.replace(at, bytes.size(), encoding == PlyBuilder::kBig ? swapped : bytes);
            const std::string path = dir.write("bad.ply", text);
            return faultOf(path).substr(path.size() + 2);
        };
        const auto at = [](size_t offset) { return "byte " + std::to_string(offset) + ": "; };
        const std::string nan("\0\0\xc0\x7f", 4), inf("\0\0\x80\x7f", 4);
        EXPECT_TRUE(
            faultWith(body + 5 * 12 + 4, nan).starts_with(at(body + 60) + "vertex 5 is at ("));
        EXPECT_TRUE(faultWith(body + 24 * 12 + 8, inf).ends_with("inf), which is no point"));
        EXPECT_EQ(faultWith(faces + 2 * 13 + 5, std::string("\x19\0\0\0", 4)),
                  at(faces + 31) + "vertex index 25 in a mesh of 25 vertices");
        EXPECT_EQ(faultWith(faces + 2 * 13 + 1, "\xff\xff\xff\xff"),
                  at(faces + 27) + "vertex index -1 in a mesh of 25 vertices");
        EXPECT_EQ(faultWith(faces + 31 * 13, "\x04"),
                  at(good.size()) + "the file ends within element face, after 31 of 32 rows");
        EXPECT_EQ(faultWith(faces, "\xff"),
                  at(faces) + "a face of 255 corners in a mesh of 25 vertices");
    }
}

TEST(PlySource, checksEveryIndexOfEveryPolygon) {
    const ScratchDirectory dir;
    const int faces = 300;
    const std::string good = mixedPolygons(PlyBuilder::kLittle, "uchar", faces);
    size_t at = good.find("end_header\n") + 11 + 1000 * 3;
    for (int f = 0; f < faces; ++f) {
        const size_t corners = uint8_t(good[at + 2]);
        for (size_t k = 0; k < corners; ++k) {
            std::string bad = good;
            const size_t place = at + 3 + 4 * k;
            bad.replace(place, 4, std::string("\xe8\x03\0\0", 4));
            const std::string path = dir.write("bad.ply", bad);
            ASSERT_EQ(faultOf(path), path + ": byte " + std::to_string(place) +
                                         ": vertex index 1000 in a mesh of 1000 vertices");
        }
        at += 2 + 1 + 4 * corners + 1;
    }
}

TEST(PlySource, noticesATruncationAtEveryByte) {
    const ScratchDirectory dir;
    const Grid grid{3};
    for (const auto encoding : kEncodings) {
        const std::string texts[] = {plainGrid(grid, encoding),
                                     attributeMesh(encoding, true, "uchar")};
        for (const std::string& text : texts) {
            // The last line end of a text may be missing; the digits of its last number cannot be
            // missed.
            const size_t digits = encoding == PlyBuilder::kAscii ? 2 : 0;
            for (size_t size = 0; size + digits < text.size(); ++size) {
                const std::string fault = faultOf(dir.write("cut.ply", text.substr(0, size)));
                ASSERT_NE(fault, "") << size << " of " << text.size();
            }
            if (encoding == PlyBuilder::kAscii) continue;
            const std::string packed = gzipped(text);
            for (size_t size = 0; size < packed.size(); ++size)
                ASSERT_NE(faultOf(dir.write("cut.ply.gz", packed.substr(0, size))), "") << size;
        }
    }
}

TEST(PlySource, refusesCountsThatTheFileCannotHold) {
    const ScratchDirectory dir;
    for (const char* format : {"ascii", "binary_little_endian"})
        for (const char* count : {"4000000000", "18446744073709551615"})
            for (const bool packed : {false, true}) {
                std::string text = std::string("ply\nformat ") + format + " 1.0\nelement vertex " +
                                   count +
                                   "\nproperty float x\nproperty float y\nproperty float z\n" +
                                   kFaceHeader + std::string(100, '0');
                if (packed) text = gzipped(text);
                const std::string path = dir.write("bad.ply", text);
                EXPECT_EQ(faultOf(path), path + ": the file is too short for the " + count +
                                             " rows of element vertex that its header counts");
            }
}

TEST(PlySource, namesWhatIsNoFile) {
    const ScratchDirectory dir;
    EXPECT_EQ(faultOf("/dev/zero"), "/dev/zero: is a device, not a file or pipe");
    EXPECT_EQ(faultOf(dir.path()), dir.path() + ": cannot open: Is a directory");
    EXPECT_EQ(faultOf(dir.file("none")),
              dir.file("none") + ": cannot open: No such file or directory");
}

TEST(PlySource, namesDamagedGzipData) {
    const ScratchDirectory dir;
    std::string packed = gzipped(plainGrid(Grid{30}, PlyBuilder::kLittle));
    packed[packed.size() - 6] = char(packed[packed.size() - 6] ^ 1);  // of the check sum
    const std::string path = dir.write("a.ply.gz", packed);
    EXPECT_EQ(faultOf(path).substr(0, path.size() + 7), path + ": byte ");
    EXPECT_TRUE(faultOf(path).ends_with(": the gzip data is damaged"));
}

TEST(PlySource, readsLargeFilesInLittleMemory) {
    const ScratchDirectory dir;
    const std::string path = dir.write("a.ply", plainGrid(Grid{1600}, PlyBuilder::kLittle));
    ASSERT_GT(std::filesystem::file_size(path), uint64_t(90) << 20);
    ASSERT_EQ(truncate((path + "").c_str(), off_t(std::filesystem::file_size(path))), 0);
    EXPECT_EQ(trianglesReadWithin(12, {path}), 2u * 1600 * 1600);
}

TEST(PlySource, realFilesHaveTheCountsMeasuredByOthers) {
    struct Case {
        const char* name;
        size_t triangles;
    };
    for (const Case& c : {Case{"scans/igea_tristrip.ply", 268686},
                          {"scans/turbineblade.ply", 199034},
                          {"scans/dragon_vrip.ply.gz", 871414},
                          {"coloured/gargo_vcolor.ply", 50000},
                          {"coloured/laurana_vcolor.ply", 50000},
                          {"cad/cycloidal.ply", 43368},
                          {"dirty/snowden_bust.ply", 109259}}) {
        const std::string path = sharedData(c.name);
        if (path.empty()) GTEST_SKIP() << "no " << c.name << " in the shared data";
        const WholeMesh mesh = readWhole(path);
        EXPECT_EQ(mesh.triangles.size(), c.triangles) << c.name;
        EXPECT_EQ(mesh.schema.colours,
                  std::string(c.name).starts_with("co") || std::string(c.name).starts_with("cad"));
    }
}

}  // namespace
}  // namespace pietra
