// Several files as one model, whatever their formats and attributes.

#include "io/joined_source.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "io/memory_source.h"
#include "io/test_files.h"

namespace pietra {
namespace {

std::string ply(const std::string& properties, const std::string& values) {
    std::string text =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
        "property float y\nproperty float z\n";
    text += properties + "element face 1\nproperty list uchar int vertex_index\nend_header\n";
    for (const char* point : {"0 0 0", "1 0 0", "0 1 0"}) text += point + (" " + values) + "\n";
    return text + "3 0 1 2\n";
}

const char kObj[] = "v 0 0 5\nv 1 0 5\nv 1 1 5\nv 0 1 5\nf 1 2 3 4\n";
const char kColouredObj[] = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf -3 -2 -1\n";

TEST(JoinedSource, shiftsIndicesAcrossFormats) {
    const ScratchDirectory dir;
    const std::string a = dir.write("a.ply", ply("", "")), b = dir.write("b.obj", kObj);
    const auto source = openSource({a, b, a});
    EXPECT_EQ(source->vertexCount(), 10u);
    EXPECT_EQ(source->triangleCountHint(), 4u);
    EXPECT_EQ(source->inputBytes(), 2 * readWholeFile(a).size() + readWholeFile(b).size());
    const WholeMesh mesh = readWhole(*source);
    EXPECT_EQ(mesh.triangles,
              (std::vector<std::array<uint64_t, 3>>{{0, 1, 2}, {3, 4, 5}, {3, 5, 6}, {7, 8, 9}}));
    EXPECT_EQ(mesh.vertices.position[3], Vec3d(0, 0, 5));
    EXPECT_EQ(mesh.schema, AttributeSchema{});
    EXPECT_EQ(mesh.notes, std::vector<std::string>{"1 polygons are cut into fans of triangles"});
    expectSameMesh(mesh, readWhole(*source));
}

TEST(JoinedSource, whitensWhatHasNoColours) {
    const ScratchDirectory dir;
    const std::string plain = dir.write("a.obj", kObj), coloured = dir.write("b.obj", kColouredObj);
    const WholeMesh mesh = readWhole(*openSource({plain, coloured}));
    EXPECT_TRUE(mesh.schema.colours);
    ASSERT_EQ(mesh.vertices.colour.size(), 7u);
    EXPECT_EQ(mesh.vertices.colour[3], Rgba8{});
    EXPECT_EQ(mesh.vertices.colour[4], (Rgba8{255, 0, 0, 255}));
    EXPECT_EQ(mesh.notes[0], "files without colours, such as " + plain + ", are white");
    EXPECT_EQ(readWhole(*openSource({coloured, coloured})).notes, std::vector<std::string>{});
}

TEST(JoinedSource, keepsNormalsAndScalarsThatAllHave) {
    const ScratchDirectory dir;
    const std::string normals = "property float nx\nproperty float ny\nproperty float nz\n";
    const std::string both = dir.write(
        "a.ply", ply("property float heat\n" + normals + "property float age\n", "7 0 0 1 9"));
    const std::string other = dir.write("b.ply", ply("property float age\n", "5"));
    const WholeMesh mesh = readWhole(*openSource({both, other}));
    EXPECT_FALSE(mesh.schema.normals_given);
    EXPECT_TRUE(mesh.vertices.normal.empty());
    EXPECT_EQ(mesh.schema.scalars, std::vector<std::string>{"age"});
    EXPECT_EQ(mesh.vertices.scalar, (std::vector<float>{9, 9, 9, 5, 5, 5}));
    EXPECT_EQ(mesh.notes,
              (std::vector<std::string>{"normals are left out, as " + other +
                                            " has none: they are computed from the triangles",
                                        "heat is left out, as " + other + " has none"}));
    const WholeMesh twice = readWhole(*openSource({both, both}));
    EXPECT_TRUE(twice.schema.normals_given);
    EXPECT_EQ(twice.schema.scalars, (std::vector<std::string>{"heat", "age"}));
    EXPECT_EQ(twice.vertices.scalar.size(), 12u);
    EXPECT_TRUE(twice.notes.empty());
}

TEST(JoinedSource, joinsMoreFilesThanMayBeOpen) {
    const ScratchDirectory dir;
    const std::string plain = dir.write("a.obj", kObj), coloured = dir.write("b.obj", kColouredObj);
    const std::string text = dir.write("c.ply", ply("", ""));
    std::vector<std::string> paths;
    for (int i = 0; i < 100; ++i) paths.insert(paths.end(), {plain, coloured, text});
    rlimit before{};
    getrlimit(RLIMIT_NOFILE, &before);
    rlimit few = before;
    few.rlim_cur = 50;
    ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
    const auto source = openSource(paths);
    const WholeMesh mesh = readWhole(*source);
    expectSameMesh(mesh, readWhole(*source));
    setrlimit(RLIMIT_NOFILE, &before);
    EXPECT_EQ(mesh.triangles.size(), 400u);
}

TEST(JoinedSource, refusesCountsThatOverflow) {
    class Endless : public MemorySource {
    public:
        Endless() : MemorySource({}, {}) {}
        uint64_t vertexCount() override { return uint64_t(1) << 63; }
    };
    std::vector<SourcePart> parts;
    for (const char* name : {"a", "b"}) parts.push_back({name, std::make_unique<Endless>()});
    try {
        joinSources(std::move(parts));
        FAIL();
    } catch (const InputError& e) {
        EXPECT_STREQ(e.what(), "b: there are too many vertices in all files");
    }
}

}  // namespace
}  // namespace pietra
