// The STL reader: every spelling of a mesh gives the same triangles, bad files name their fault.

#include "io/stl_source.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <set>
#include <sstream>

#include "base/budget.h"
#include "base/hash.h"
#include "io/memory_source.h"
#include "io/mesh_writer.h"
#include "io/test_files.h"

namespace pietra {
namespace {

/// Triangles whose corners depend on their number alone.
Soup randomSoup(size_t triangles) {
    Soup soup(triangles);
    uint64_t i = 0;
    for (auto& t : soup)
        for (Vec3d& p : t)
            for (int k = 0; k < 3; ++k)
                p[k] = double(float(int64_t(mixBits(++i)) >> 40) * 0x1p-20f);
    return soup;
}

std::string bytesOf(const void* data, size_t bytes) {
    return {static_cast<const char*>(data), bytes};
}

std::string binaryStl(const Soup& soup, std::string header = "made for a test",
                      uint16_t attribute = 0) {
    header.resize(80);
    const auto count = uint32_t(soup.size());
    std::string out = header + bytesOf(&count, 4);
    for (const auto& t : soup) {
        float values[12] = {};
        for (int k = 0; k < 9; ++k) values[3 + k] = float(t[k / 3][k % 3]);
        out += bytesOf(values, sizeof values) + bytesOf(&attribute, 2);
    }
    return out;
}

struct TextStyle {
    std::string line_end = "\n";
    std::string normal = "0 0 1";
    std::string name = " made for a test";
    size_t solids = 1;
    bool capitals = false;
    std::string indent = "  ";
};

std::string textStl(const Soup& soup, const TextStyle& style = {}) {
    std::string out;
    const auto line = [&](const std::string& text) { out += style.indent + text + style.line_end; };
    const size_t each = (soup.size() + style.solids - 1) / style.solids;
    for (size_t i = 0; i < soup.size(); ++i) {
        if (i % each == 0) line("solid" + style.name);
        line("facet normal " + style.normal);
        line("outer loop");
        for (const Vec3d& p : soup[i]) {
            char numbers[100];
            std::snprintf(numbers, sizeof numbers, "vertex %.17g\t%.17g  %.17g", p.x, p.y, p.z);
            line(numbers);
        }
        line("endloop");
        line("endfacet");
        if (i % each == each - 1 || i + 1 == soup.size()) line("endsolid" + style.name);
    }
    if (style.capitals)
        for (char& c : out) c = char(std::toupper(c));
    return out;
}

TEST(StlSource, givesTheSameForEverySpelling) {
    const ScratchDirectory dir;
    const Soup soup = randomSoup(500);
    const std::string texts[] = {
        binaryStl(soup),
        binaryStl(soup, "solid of a binary file"),
        binaryStl(soup, "solid " + std::string(74, ' ')),
        textStl(soup),
        textStl(soup, {.line_end = "\r\n"}),
        textStl(soup, {.line_end = "\r"}),
        textStl(soup, {.capitals = true}),
        textStl(soup, {.name = ""}),
        textStl(soup, {.name = " facet normal endsolid \xc3\xa4"}),
        textStl(soup, {.name = " " + std::string(3000, 'x'), .solids = 7}),
        textStl(soup, {.normal = "0 0 0"}),
        textStl(soup, {.normal = "nan -1.#IND inf"}),
        textStl(soup, {.indent = "\n \t \n"}),
        "\xef\xbb\xbf" + textStl(soup, {.indent = ""}),
        textStl(soup) + std::string(3, '\0') + "\x1a",
    };
    for (const std::string& text : texts) {
        SCOPED_TRACE(text.substr(0, 60));
        const WholeMesh mesh = readWhole(dir.write("a.stl", text));
        EXPECT_EQ(soupOf(mesh), soup);
        EXPECT_EQ(mesh.schema, AttributeSchema{});
        EXPECT_TRUE(mesh.notes.empty());
        EXPECT_EQ(soupOf(readWhole(dir.write("b.stl.gz", gzipped(text)))), soup);
    }
    EXPECT_EQ(soupOf(readWhole(dir.write("text.txt", textStl(soup, {.indent = ""})))), soup);
}

TEST(StlSource, facetsMayBeSpelledInTurns) {
    // The reader knows facets and points again that are like others; these are, but not quite.
    const std::string points[] = {" 1.2 3 4",
                                  " 1.25 3 4",
                                  " 1.2 3 4e0",
                                  "\t1.2\t3 4",
                                  " 1.2\n3 4 ",
                                  " 1.20000000000 3.00000000 4",
                                  " 1.20000000000 3.00000000 40",
                                  " 1.20000000000 3.00000000 5",
                                  "  1.20000000000000000000000000000000000000001 3 -0"};
    const std::string ends[] = {"\nendloop\nendfacet\n", "\n\n endloop\r\nendfacet ",
                                "\nENDLOOP\n endfacet\n"};
    const std::string normals[] = {" 0 0 1", " 0  0 1", " nan 1e400 x", " 0\n0\n1"};
    std::string text = "solid\n";
    uint64_t state = 0;
    const auto pick = [&](const auto& from) { return from[mixBits(++state) % std::size(from)]; };
    Soup soup;
    for (int i = 0; i < 5000; ++i) {
        text += "facet normal" + pick(normals) + "\nouter loop";
        soup.emplace_back();
        for (Vec3d& corner : soup.back()) {
            const std::string point = pick(points);
            text += "\nvertex" + point;
            std::istringstream(point) >> corner.x >> corner.y >> corner.z;
        }
        text += pick(ends);
        if (i % 1000 == 999) text += "endsolid\nsolid again\n";
    }
    ScratchDirectory scratch;
    EXPECT_EQ(soupOf(readWhole(scratch.write("a.stl", text + "endsolid"))), soup);
    // Whatever lies before, a fault is found, on its line.
    const std::string good = "solid\n" + std::string(3, '\n') + text.substr(6);
    const auto lines = std::count(good.begin(), good.end(), '\n');
    EXPECT_NE(
        faultOf(scratch.write("b.stl", good + "facet normal 0 0 1\nouter loop\nvertex 1 2 nan")),
        "");
    EXPECT_NE(faultOf(scratch.file("b.stl")).find(fmt::format("line {}", lines + 3)),
              std::string::npos);
}

TEST(StlSource, readsManyBatches) {
    const ScratchDirectory dir;
    const Soup soup = randomSoup(150000);
    EXPECT_EQ(soupOf(readWhole(dir.write("a.stl", binaryStl(soup)))), soup);
    EXPECT_EQ(soupOf(readWhole(dir.write("b.stl", textStl(soup)))), soup);
}

TEST(StlSource, keepsDoublesOfATextWhole) {
    const ScratchDirectory dir;
    const Soup soup{{Vec3d(1737400.123456789, 0, 0), Vec3d(1, 1e-300, 2), Vec3d(-0.1, 3, 1e300)}};
    EXPECT_EQ(soupOf(readWhole(dir.write("a.stl", textStl(soup)))), soup);
}

TEST(StlSource, notesWhatItLeavesOut) {
    const ScratchDirectory dir;
    const Soup soup = randomSoup(10);
    const std::string text = binaryStl(soup, "COLOR=abcd", 0x8123) + "tail";
    const auto source = openSource({dir.write("a.stl", text)});
    readWhole(*source);
    const WholeMesh mesh = readWhole(*source);  // counts once, however often it is read
    EXPECT_EQ(soupOf(mesh), soup);
    EXPECT_EQ(mesh.notes,
              (std::vector<std::string>{
                  "the 16-bit attributes of 10 facets (colours, in some programs) are left out",
                  "4 bytes after the last triangle are left out"}));
}

TEST(StlSource, namesEveryFaultOfATextByItsLine) {
    const ScratchDirectory dir;
    const std::string facet =
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
        "endfacet\n";
    const auto with = [&](const std::string& from, const std::string& to) {
        std::string text = "solid\n" + facet + "endsolid\n";
        return text.replace(text.find(from), from.size(), to);
    };
    struct Case {
        std::string text, fault;
    };
    const Case cases[] = {
        {"solid\nendsolid\n", "has no triangles: nothing to show"},
        {"solid", "line 1: the file ends within a solid, after 0 triangles"},
        {"solid\n" + facet, "line 9: the file ends within a solid, after 1 triangles"},
        {with("endsolid", "endsolid\nmore"),
         "line 10: \"more\" stands where \"solid\" is expected"},
        {with("facet", "face"),
         "line 2: \"face\" stands where \"facet\" or \"endsolid\" is expected"},
        {with("normal 0 0 1", "normal 0 1"), "line 3: \"loop\" stands where \"outer\" is expected"},
        {with("vertex 1 0 0", "vertex 1 0"),
         "line 6: \"vertex\" stands where a number is expected"},
        {with("vertex 1 0 0", "vertex 1,0 0 0"),
         "line 5: \"1,0\" stands where a number is expected"},
        {with("vertex 1 0 0", "vertex nan 0 0"),
         "line 5: a corner is at (nan, 0, 0), which is no point"},
        {with("vertex 1 0 0", "vertex 0 1e999 0"),
         "line 5: a corner is at (0, inf, 0), which is no point"},
        {with("vertex 1 0 0\n", ""), "line 6: \"endloop\" stands where \"vertex\" is expected"},
        {with("endloop", "vertex 5 5 5\nendloop"),
         "line 7: \"vertex\" stands where \"endloop\" is expected"},
        {with("vertex 1 0 0", "vertex 0 0 " + std::string(2000, 'x')),
         "line 5: a word of more than 1024 characters"},
    };
    for (const Case& c : cases) {
        const std::string path = dir.write("bad.stl", c.text);
        EXPECT_EQ(faultOf(path), path + ": " + c.fault) << c.text;
    }
}

TEST(StlSource, namesEveryFaultOfABinaryFile) {
    const ScratchDirectory dir;
    const std::string good = binaryStl(randomSoup(20));
    const auto fault = [&](const std::string& text, const std::string& name = "bad.stl") {
        const std::string path = dir.write(name, text);
        return faultOf(path).substr(path.size() + 2);
    };
    const auto counting = [&](uint32_t count) {
        return good.substr(0, 80) + bytesOf(&count, 4) + good.substr(84);
    };
    EXPECT_EQ(fault("short"), "is too short for an STL file: 5 bytes");
    EXPECT_EQ(fault(counting(21)),
              "byte 80: the header counts 21 triangles, but the file has room for 20");
    EXPECT_EQ(fault(counting(0)),
              "byte 80: the header counts 0 triangles, but the file has room for 20");
    EXPECT_EQ(fault(counting(4294967295)),
              "byte 80: the header counts 4294967295 triangles, but the file has room for 20");
    EXPECT_EQ(fault(binaryStl({})), "has no triangles: nothing to show");
    // Of a compressed file the size is not known before.
    EXPECT_EQ(fault(gzipped(counting(21)), "bad.stl.gz"),
              "byte 80 of the unpacked data: the header counts 21 triangles, but the file ends "
              "after 20");
    EXPECT_EQ(fault(gzipped(counting(19)), "bad.stl.gz"),
              "byte 80 of the unpacked data: the header counts 19 triangles, but the file goes on "
              "after them");
    for (size_t corner = 0; corner < 60; ++corner)
        for (size_t k = 0; k < 3; ++k)
            for (const char* bits : {"\xc0\x7f", "\x80\xff"}) {
                std::string bad = good;
                const size_t at = 84 + corner / 3 * 50 + 12 + corner % 3 * 12;
                bad.replace(at + 4 * k, 4, std::string(2, '\0') + bits);
                const std::string found = fault(bad);
                ASSERT_TRUE(found.starts_with("byte " + std::to_string(at) + ": corner " +
                                              std::to_string(corner % 3) + " of triangle " +
                                              std::to_string(corner / 3) + " is at ("))
                    << found;
            }
}

TEST(StlSource, noticesATruncationAtEveryByte) {
    const ScratchDirectory dir;
    const Soup soup = randomSoup(4);
    for (const std::string& text :
         {binaryStl(soup), binaryStl(soup, "solid"), textStl(soup), gzipped(binaryStl(soup))}) {
        // Of a text the name behind the last word can be missing.
        const size_t sure =
            text.find("endsolid") == text.npos ? text.size() : text.rfind("endsolid") + 8;
        for (size_t size = 0; size < sure; ++size)
            ASSERT_NE(faultOf(dir.write("cut.stl", text.substr(0, size))), "") << size;
    }
}

TEST(StlSource, readsWhatTheWriterWrites) {
    const ScratchDirectory dir;
    std::vector<Vec3d> positions;
    for (const auto& t : randomSoup(100)) positions.push_back(t[0]);
    std::vector<std::array<uint64_t, 3>> triangles;
    for (uint64_t i = 0; i + 3 <= 100; ++i) triangles.push_back({i, i + 1, i + 2});
    const auto writer = createMesh(dir.file("a.stl"), false, {});
    VertexBatch vertices;
    vertices.position = positions;
    writer->addVertices(vertices);
    writer->addTriangles(triangles);
    writer->finish();
    WholeMesh expected;
    expected.vertices.position = positions;
    expected.triangles = triangles;
    EXPECT_EQ(soupOf(readWhole(dir.file("a.stl"))), soupOf(expected));
}

TEST(StlSource, readsLargeFilesInLittleMemory) {
    const ScratchDirectory dir;
    std::string path;
    {
        const Soup part = randomSoup(1000);
        Soup soup;
        for (int i = 0; i < 600; ++i) soup.insert(soup.end(), part.begin(), part.end());
        path = dir.write("a.stl", binaryStl(soup));
    }
    EXPECT_EQ(trianglesReadWithin(8, {path}), 600'000u);
}

TEST(StlSource, realFilesHaveTheCountsMeasuredByOthers) {
    struct Case {
        const char* name;
        size_t triangles, points;
    };
    for (const Case& c : {Case{"cad/counter.unitsmm.STL", 83750, 41837},
                          {"dirty/Grey_Nurse_Shark.stl", 49702, 25057}}) {
        const std::string path = sharedData(c.name);
        if (path.empty()) GTEST_SKIP() << "no " << c.name << " in the shared data";
        const WholeMesh mesh = readWhole(path);
        EXPECT_EQ(mesh.triangles.size(), c.triangles) << c.name;
        std::set<std::array<double, 3>> points;
        for (const Vec3d& p : mesh.vertices.position) points.insert({p.x, p.y, p.z});
        EXPECT_EQ(points.size(), c.points) << c.name;
    }
}

}  // namespace
}  // namespace pietra
