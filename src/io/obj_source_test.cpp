// The OBJ reader: every spelling of a mesh gives the same batches, bad files name their fault, real
// files have the counts measured by others.

#include "io/obj_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/budget.h"
#include "base/hash.h"
#include "io/test_files.h"

namespace pietra {
namespace {

using Triangles = std::vector<std::array<uint64_t, 3>>;

/// Numbers that depend on the seed alone.
class Random {
public:
    explicit Random(uint64_t seed) : state_(seed) {}
    uint64_t below(uint64_t n) { return mixBits(++state_) % n; }
    bool oneIn(uint64_t n) { return below(n) == 0; }
    double real() { return double(int64_t(mixBits(++state_)) >> 11) * 0x1p-52; }

private:
    uint64_t state_;
};

std::string format(const char* form, double value) {
    char text[512];
    std::snprintf(text, sizeof text, form, value);
    return text;
}

/// A mesh in memory, and ways to write it.
struct Model {
    std::vector<Vec3d> positions;
    std::vector<Vec3f> normals;
    std::vector<Rgba8> colours;
    Triangles triangles;

    static Model random(uint64_t seed, size_t vertices, size_t triangles, bool normals,
                        bool colours) {
        Random random(seed);
        Model model;
        const double scale = std::pow(10.0, double(random.below(20)) - 10);
        for (size_t v = 0; v < vertices; ++v) {
            model.positions.push_back(Vec3d(random.real(), random.real(), double(random.below(9))) *
                                      scale);
            const float x = float(random.real()), y = float(random.real());
            if (normals) model.normals.push_back({x, y, 1});
            const auto byte = [&] { return uint8_t(random.below(256)); };
            if (colours) model.colours.push_back({byte(), byte(), byte(), 255});
        }
        for (size_t t = 0; t < triangles; ++t)
            model.triangles.push_back(
                {random.below(vertices), random.below(vertices), random.below(vertices)});
        return model;
    }
};

/// Writes a model with all that the format allows, chosen at random.
class Speller {
public:
    Speller(const Model& model, uint64_t seed) : model_(model), random_(seed) {
        const char* line_ends[] = {"\n", "\r\n", "\r"};
        line_end_ = line_ends[random_.below(3)];
        mixed_ = random_.oneIn(2);
        with_textures_ = random_.oneIn(2);
        byte_colours_ = random_.oneIn(2);
        plain_ = random_.oneIn(3);
        if (random_.oneIn(4)) text_ += "\xef\xbb\xbf";
        write();
    }
    const std::string& text() const { return text_; }

private:
    void write() {
        size_t faces = 0;
        for (size_t v = 0; v < model_.positions.size(); ++v) {
            decorate();
            putVertex(v);
            written_ = v + 1;
            if (!mixed_) continue;
            putNormal(v);
            while (faces < model_.triangles.size() && random_.oneIn(2)) {
                const auto& t = model_.triangles[faces];
                // Normals after v alone are written, so that relative indices have a meaning.
                if (*std::max_element(t.begin(), t.end()) > v) break;
                putFace(t);
                ++faces;
            }
        }
        if (!mixed_)
            for (size_t v = 0; v < model_.normals.size(); ++v) putNormal(v);
        if (with_textures_) statement({"vt", "0.5", "0.25"});
        while (faces < model_.triangles.size()) {
            decorate();
            putFace(model_.triangles[faces++]);
        }
        if (random_.oneIn(2)) text_.resize(text_.size() - line_end_.size());
    }

    std::string number(double value) {
        std::string text = format("%.17g", value);
        if (random_.oneIn(2) && double(float(value)) == value) text = format("%.9g", value);
        if (random_.oneIn(9)) text = format("%.20e", value);
        if (random_.oneIn(9) && std::abs(value) > 1e-3) text = format("%.60f", value);
        if (value >= 0 && random_.oneIn(9)) text = "+" + text;
        if (text.starts_with("0.") && random_.oneIn(2)) text.erase(0, 1);
        return text;
    }

    void putVertex(size_t v) {
        const Vec3d& p = model_.positions[v];
        std::vector<std::string> words = {"v", number(p.x), number(p.y), number(p.z)};
        if (!model_.colours.empty()) {
            const Rgba8& c = model_.colours[v];
            for (const uint8_t value : {c.r, c.g, c.b})
                words.push_back(byte_colours_ ? std::to_string(value)
                                              : format("%.4f", value / 255.0));
        } else if (random_.oneIn(9)) {
            words.push_back("1.0");
        }
        statement(words);
    }
    void putNormal(size_t v) {
        if (model_.normals.empty()) return;
        const Vec3f& n = model_.normals[v];
        statement({"vn", number(n.x), number(n.y), number(n.z)});
    }
    void putFace(const std::array<uint64_t, 3>& t) {
        std::vector<std::string> words = {random_.oneIn(50) ? "fo" : "f"};
        const bool relative = random_.oneIn(3);
        const bool texture = with_textures_ && random_.oneIn(2);
        for (const uint64_t v : t) {
            const std::string index =
                relative ? std::to_string(int64_t(v) - int64_t(written_)) : std::to_string(v + 1);
            std::string corner = index;
            if (texture) corner += "/1";
            if (!model_.normals.empty()) corner += (texture ? "/" : "//") + index;
            words.push_back(corner);
        }
        statement(words);
    }

    void statement(const std::vector<std::string>& words) {
        if (!plain_ && random_.oneIn(9)) text_ += "  ";
        for (size_t i = 0; i < words.size(); ++i) {
            if (i > 0) text_ += blank();
            text_ += words[i];
        }
        if (!plain_ && random_.oneIn(9)) text_ += " ";
        if (!plain_ && random_.oneIn(9)) text_ += "# the end \\ of it";
        text_ += line_end_;
    }
    std::string blank() {
        if (plain_) return " ";
        if (random_.oneIn(9)) return "\t ";
        if (random_.oneIn(19)) return "\\" + line_end_ + (random_.oneIn(2) ? " " : "");
        if (random_.oneIn(19)) return " \\" + line_end_ + "  ";
        return " ";
    }
    /// What means nothing.
    void decorate() {
        if (plain_ || !random_.oneIn(3)) return;
        const char* lines[] = {"",           "# C:\\directory\\",   "g left right", "o thing",
                               "s off",      "usemtl Material.001", "mtllib a.mtl", "#",
                               "  # inside", "vp 0.5 0.5",          "s 1 \\"};
        const char* const line = lines[random_.below(std::size(lines))];
        text_ += line + line_end_;
        if (std::string(line).ends_with(" \\")) text_ += "f 1 2 3" + line_end_;
    }

    const Model& model_;
    Random random_;
    std::string line_end_;
    bool mixed_, with_textures_, byte_colours_, plain_;
    size_t written_ = 0;
    std::string text_;
};

std::unique_ptr<TriangleSource> openText(const std::string& text, uint64_t block_bytes = uint64_t(1)
                                                                                         << 18) {
    auto bytes = bytesInMemory("text", std::vector<uint8_t>(text.begin(), text.end()));
    return openObjInBlocks(std::make_unique<ByteReader>(std::move(bytes)), block_bytes);
}

WholeMesh readText(const std::string& text) {
    return readWhole(*openText(text));
}

void expectModel(const WholeMesh& mesh, const Model& model) {
    EXPECT_EQ(mesh.vertices.position, model.positions);
    EXPECT_EQ(mesh.vertices.normal, model.normals);
    EXPECT_EQ(mesh.vertices.colour, model.colours);
    EXPECT_EQ(mesh.triangles, model.triangles);
    EXPECT_EQ(mesh.schema.normals_given, !model.normals.empty());
    EXPECT_EQ(mesh.schema.colours, !model.colours.empty());
}

TEST(ObjSource, takesEverySpellingOfAMesh) {
    for (uint64_t seed = 0; seed < 400; ++seed) {
        Random random(seed * 1000);
        const Model model = Model::random(seed, 3 + random.below(40), 1 + random.below(80),
                                          random.oneIn(2), random.oneIn(2));
        const Speller spelled(model, seed);
        SCOPED_TRACE(spelled.text());
        // A block a statement, or all in one: what is leapt over changes nothing.
        for (const uint64_t block_bytes : {1, 100, 1 << 18}) {
            const auto source = openText(spelled.text(), block_bytes);
            expectModel(readWhole(*source), model);
            expectModel(readWhole(*source), model);
        }
        if (HasFailure()) break;
    }
}

TEST(ObjSource, readsMoreThanABatchAndAWindow) {
    const Model model = Model::random(7, 70000, 140000, true, true);
    const Speller spelled(model, 3);
    ASSERT_GT(spelled.text().size(), 5 * ByteReader::kWindow);
    const auto source = openText(spelled.text());
    expectModel(readWhole(*source), model);
    // More blocks than the table holds, so that it is thinned out several times.
    expectModel(readWhole(*openText(spelled.text(), 1)), model);
}

TEST(ObjSource, carriesOnlyNormalsThatMatchTheVertices) {
    const std::string points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    const std::string normals = "vn 0 0 1\nvn 0 1 0\nvn 1 0 0\n";
    struct Case {
        std::string text;
        bool carried;
    };
    const std::string note =
        "normals are left out, as they are not one to one with the vertices: they are computed "
        "from the triangles";
    for (const Case& c : {Case{points + normals + "f 1//1 2//2 3//3\n", true},
                          {normals + "f 1//1 2//2 3//3\n" + points, true},
                          {points + normals + "f -3//-3 2//-2 3//3\n", true},
                          {points + normals + "f 1//1 2//2 3//1\n", false},
                          {points + normals + "f 1//1 2//2 3//3\nf 1 2 3\n", false},
                          {points + normals + "f 1 2 3\n", false},
                          {points + "vn 0 0 1\n" + "f 1//1 2//1 3//1\n", false},
                          {points + normals + "vn 0 0 1\nf 1//1 2//2 3//3\n", false}}) {
        const WholeMesh mesh = readText(c.text);
        EXPECT_EQ(mesh.schema.normals_given, c.carried) << c.text;
        EXPECT_EQ(mesh.notes,
                  c.carried ? std::vector<std::string>{} : std::vector<std::string>{note});
        if (c.carried) {
            EXPECT_EQ(mesh.vertices.normal, (std::vector<Vec3f>{{0, 0, 1}, {0, 1, 0}, {1, 0, 0}}));
        }
    }
}

TEST(ObjSource, scalesColoursByTheWholeFile) {
    const std::string face = "f 1 2 3\n";
    const WholeMesh unit = readText("v 0 0 0 0 0.2 1\nv 1 0 0\nv 0 1 0 1 1.01 -1\n" + face);
    EXPECT_EQ(unit.vertices.colour,
              (std::vector<Rgba8>{{0, 51, 255, 255}, {255, 255, 255, 255}, {255, 255, 0, 255}}));
    const WholeMesh bytes =
        readText("v 0 0 0 0 1 1\nv 1 0 0 7 8 9 128\nv 0 1 0 1 254.6 300\n" + face);
    EXPECT_EQ(bytes.vertices.colour,
              (std::vector<Rgba8>{{0, 1, 1, 255}, {7, 8, 9, 128}, {1, 255, 255, 255}}));
}

TEST(ObjSource, fansPolygonsOfAnyLength) {
    const size_t corners = 300000;
    std::string text;
    for (size_t v = 0; v < corners; ++v) text += "v 1 2 3\n";
    text += "f 1 2 3 4 5\nf";
    for (size_t v = 0; v < corners; ++v)
        text += (v % 1000 == 999 ? " \\\n " : " ") + std::to_string(v + 1) + "/7";
    text += "\nf 3 2 1";
    const WholeMesh mesh = readText(text);
    ASSERT_EQ(mesh.triangles.size(), 3 + corners - 2 + 1);
    EXPECT_EQ(mesh.triangles[2], (std::array<uint64_t, 3>{0, 3, 4}));
    for (uint64_t t = 0; t < corners - 2; ++t)
        ASSERT_EQ(mesh.triangles[3 + t], (std::array<uint64_t, 3>{0, t + 1, t + 2}));
    EXPECT_EQ(mesh.triangles.back(), (std::array<uint64_t, 3>{2, 1, 0}));
    EXPECT_EQ(mesh.notes, std::vector<std::string>{"2 polygons are cut into fans of triangles"});
}

TEST(ObjSource, saysWhatIsLeftOut) {
    const WholeMesh mesh = readText(
        "mtllib a.mtl\nv 0 0 0 1\nv 1 0 0 0.5\nv 0 1 0\nvt 0 0\nl 1 2\nl 2 3\np 1\nusemtl a\n"
        "cstype bezier\nfrob 1\nfrob 2\ns 1\ng a\no b\nf 1/1 2/1 3/1 1/1\n");
    EXPECT_EQ(mesh.notes, (std::vector<std::string>{
                              "texture coordinates are left out", "materials are left out",
                              "2 lines and 1 statements of points are left out",
                              "free-form curves and surfaces are left out",
                              "2 statements of no known kind are left out (\"frob\" on line 11)",
                              "the weights of 1 vertices are left out",
                              "1 polygons are cut into fans of triangles"}));
    EXPECT_EQ(mesh.triangles, (Triangles{{0, 1, 2}, {0, 2, 0}}));
}

TEST(ObjSource, isRecognisedByNameOrContent) {
    const ScratchDirectory dir;
    const std::string good = "# made by hand\n\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    EXPECT_EQ(readWhole(dir.write("mesh.txt", good)).triangles.size(), 1u);
    EXPECT_EQ(readWhole(dir.write("MESH.OBJ", good)).triangles.size(), 1u);
    const std::string path = dir.write("mesh.txt", "vertices\n" + good);
    EXPECT_TRUE(faultOf(path).starts_with(path + ": is of no format that Pietra reads ("));
}

TEST(ObjSource, namesEveryFault) {
    const ScratchDirectory dir;
    const std::string points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n", face = "f 1 2 3\n";
    struct Case {
        std::string text, fault;
    };
    const std::string corner = "is no corner of a face: v, v/vt, v//vn or v/vt/vn";
    const std::string huge = "999999999999999999999";
    const Case cases[] = {
        {"", "the file is empty"},
        {"# nothing\n", "has no vertices: nothing to show"},
        {face, "has no vertices: nothing to show"},
        {points, "has vertices but no faces: a cloud of points is nothing to show"},
        {points + "l 1 2\np 1\n",
         "has vertices but no faces: a cloud of points is nothing to show"},
        {std::string("\x4c\x01\x05\0\0\0", 6),
         "line 1: \"L?????\" begins no statement of an OBJ file"},
        {"\x80\x81 1 2\n" + points + face, "line 1: \"??\" begins no statement of an OBJ file"},
        {points + "1 2 3\n" + face, "line 4: \"1\" begins no statement of an OBJ file"},
        {points + "v 1 2\n" + face, "line 4: a vertex of 2 coordinates, not three"},
        {points + "v\n" + face, "line 4: a vertex of 0 coordinates, not three"},
        {points + "v 1 2 three\n" + face, "line 4: \"three\" is no number (z of a vertex)"},
        {points + "v 1 2,5 3\n" + face, "line 4: \"2,5\" is no number (y of a vertex)"},
        {points + "v 1 - 3\n" + face, "line 4: \"-\" is no number (y of a vertex)"},
        {points + "v 1 2 3mm\n" + face, "line 4: \"3mm\" is no number (z of a vertex)"},
        {points + "v 1 2 " + std::string(2000, '3') + "\n" + face,
         "line 4: \"" + std::string(40, '3') + "...\" is no number (z of a vertex)"},
        {points + std::string("v 1 2\0 3\n", 9) + face,
         "line 4: \"2?\" is no number (y of a vertex)"},
        {points + "v 1 nan 3\n" + face, "line 4: vertex 4 is at (1, nan, 3), which is no point"},
        {points + "v 1 2 -1e999\n" + face,
         "line 4: vertex 4 is at (1, 2, -inf), which is no point"},
        {points + "v 1 2 3 4 5\n" + face,
         "line 4: a vertex of 5 numbers: 3 are a point, 4 have a weight, 6 and 7 a colour"},
        {points + "v 1 2 3 4 5 red\n" + face, "line 4: \"red\" is no number (of a vertex)"},
        {points + "v 1 2 3 4 5 6 7 8\n" + face, "line 4: \"8\" stands after a vertex"},
        {points + "f 1 2\n", "line 4: a face of 2 corners; it needs three at least"},
        {points + "f\n", "line 4: a face of 0 corners; it needs three at least"},
        {points + "f 1 2 0\n", "line 4: a face has a vertex of index 0, but indices count from 1"},
        {points + "f 1 2 4\n", "line 4: vertex index 4 in a mesh of 3 vertices"},
        {points + "f 1 2 -4\n", "line 4: vertex index -4 after 3 vertices"},
        {"f -1 -2 -3\n" + points, "line 1: vertex index -1 after 0 vertices"},
        {points + "f 1 2 " + huge + "\n", "line 4: \"" + huge + "\" " + corner},
        {points + "f 1 2 3.0\n", "line 4: \"3.0\" " + corner},
        {points + "f 1 2 a\n", "line 4: \"a\" " + corner},
        {points + "f 1/1/1/1 2 3\n", "line 4: \"1/1/1/1\" " + corner},
        {points + "f 1/x 2 3\n", "line 4: \"1/x\" " + corner},
        {points + "f /1 2 3\n", "line 4: \"/1\" " + corner},
        {points + "f 1 2 - 3\n", "line 4: \"-\" " + corner},
        {points + "f 1 \\\n\n", "line 5: a face of 1 corners; it needs three at least"},
        {points + "f 1 2 \\\r\n\\\n 9\n", "line 6: vertex index 9 in a mesh of 3 vertices"},
        {points + "vn 0 0 1\nvn 0 0 1\nvn 0 1\nf 1//1 2//2 3//3\n",
         "line 6: a normal of fewer than three numbers"},
        {points + "vn 0 0 1\nvn 0 0 x\nvn 0 1 1\nf 1//1 2//2 3//3\n",
         "line 5: \"x\" is no number (of a normal)"},
    };
    for (const Case& c : cases) {
        const std::string path = dir.write("bad.obj", c.text);
        EXPECT_EQ(faultOf(path), path + ": " + c.fault) << c.text;
    }
}

TEST(ObjSource, noticesATruncationOrGivesTheBeginning) {
    const ScratchDirectory dir;
    for (const uint64_t seed : {1, 2, 3, 4, 5, 6}) {
        const Model model = Model::random(seed, 9, 12, seed % 2, seed % 3);
        const std::string text = Speller(model, seed).text();
        for (size_t size = 0; size < text.size(); ++size) {
            WholeMesh mesh;
            try {
                mesh = readText(text.substr(0, size));
            } catch (const InputError&) {
                continue;
            }
            // Only what stands last may have lost digits, or words that are not needed.
            ASSERT_LE(mesh.triangles.size(), model.triangles.size());
            ASSERT_LE(mesh.vertices.position.size(), model.positions.size());
            for (size_t t = 0; t + 1 < mesh.triangles.size(); ++t)
                ASSERT_EQ(mesh.triangles[t], model.triangles[t]) << size;
            for (size_t v = 0; v + 1 < mesh.vertices.position.size(); ++v)
                ASSERT_EQ(mesh.vertices.position[v], model.positions[v]) << size;
        }
    }
}

TEST(ObjSource, readsLargeFilesInLittleMemory) {
    const ScratchDirectory dir;
    std::string text;
    for (int i = 0; i < 200000; ++i) text += "v 0.123456 1.234567 2.345678\nvn 0 0 1\n";
    for (int i = 0; i < 400000; ++i) text += "f 1//1 100000//100000 200000//200000\n";
    for (const char* long_line : {"# ", "g "})
        text += long_line + std::string(20 << 20, 'x') + "\n";
    const std::string path = dir.write("a.obj", text);
    std::string().swap(text);
    EXPECT_EQ(trianglesReadWithin(12, {path}, FreedMemory::kIsSpared), 400000u);
}

TEST(ObjSource, realFilesHaveTheCountsMeasuredByOthers) {
    struct Case {
        const char* name;
        size_t vertices, triangles;
        bool normals;
    };
    for (const Case& c :
         {Case{"scans/armadillo_86k.obj", 43243, 86482, false},
          {"scans/lionstatue.obj", 31825, 63338, false},
          {"scans/nefertiti.obj", 49971, 99938, false},
          {"textured/YcbBanana/textured_simple_reoriented.obj", 7866, 15728, true}}) {
        const std::string path = sharedData(c.name);
        if (path.empty()) GTEST_SKIP() << "no " << c.name << " in the shared data";
        const auto source = openSource({path});
        EXPECT_EQ(source->triangleCountHint(), c.triangles);
        const WholeMesh mesh = readWhole(*source);
        EXPECT_EQ(mesh.vertices.position.size(), c.vertices) << c.name;
        EXPECT_EQ(mesh.triangles.size(), c.triangles) << c.name;
        EXPECT_EQ(mesh.schema.normals_given, c.normals) << c.name;
    }
}

}  // namespace
}  // namespace pietra
