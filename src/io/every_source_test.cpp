// What holds for every format alike: streams are independent, a pipe gives the same mesh, and a
// file that changes while it is read is noticed.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <thread>

#include "base/hash.h"
#include "io/mesh_writer.h"
#include "io/test_files.h"

namespace pietra {
namespace {

/// A sheet of (n + 1)^2 vertices with all attributes.
WholeMesh sheet(uint64_t n) {
    WholeMesh mesh;
    mesh.schema = {.normals_given = true, .colours = true, .scalars = {"heat"}};
    VertexBatch& v = mesh.vertices;
    for (uint64_t i = 0; i <= n; ++i)
        for (uint64_t j = 0; j <= n; ++j) {
            const uint64_t hash = mixBits(i * (n + 1) + j);
            v.position.push_back(Vec3f(float(i), float(j), float(hash % 1000) * 1e-3f));
            v.normal.push_back({float(hash % 7), float(hash % 11), 1});
            v.colour.push_back({uint8_t(hash), uint8_t(hash >> 8), uint8_t(hash >> 16), 255});
            v.scalar.push_back(float(hash % 100));
        }
    for (uint64_t i = 0; i < n; ++i)
        for (uint64_t j = 0; j < n; ++j) {
            const uint64_t a = i * (n + 1) + j, b = a + n + 1;
            mesh.triangles.push_back({a, b, b + 1});
            mesh.triangles.push_back({a, b + 1, a + 1});
        }
    return mesh;
}

std::string asciiPly(const WholeMesh& mesh) {
    std::string text = fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
        "property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices.position.size(), mesh.triangles.size());
    for (const Vec3d& p : mesh.vertices.position) text += fmt::format("{} {} {}\n", p.x, p.y, p.z);
    for (const auto& t : mesh.triangles) text += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
    return text;
}

std::string textStl(const WholeMesh& mesh) {
    std::string text = "solid sheet\n";
    for (const auto& t : mesh.triangles) {
        text += "facet normal 0 0 1\n outer loop\n";
        for (const uint64_t v : t) {
            const Vec3d& p = mesh.vertices.position[v];
            text += fmt::format("  vertex {} {} {}\n", p.x, p.y, p.z);
        }
        text += " endloop\nendfacet\n";
    }
    return text + "endsolid sheet\n";
}

/// A file of each form, of several windows and several batches: its name, its bytes.
const std::vector<std::pair<std::string, std::string>>& forms() {
    static const auto all = [] {
        const ScratchDirectory dir;
        const WholeMesh mesh = sheet(258);
        MeshOutput output;
        output.schema = mesh.schema;
        std::vector<std::pair<std::string, std::string>> files;
        for (const std::string name : {"a.ply", "a.obj", "a.stl", "a.glb"}) {
            const auto writer = createMesh(dir.file(name), true, output);
            writer->addVertices(mesh.vertices);
            writer->addTriangles(mesh.triangles);
            writer->finish();
            files.emplace_back(name, readWholeFile(dir.file(name)));
        }
        files.emplace_back("ascii.ply", asciiPly(mesh));
        files.emplace_back("text.stl", textStl(sheet(182)));
        return files;
    }();
    return all;
}

class EverySource : public testing::TestWithParam<size_t> {
protected:
    const std::string& name() const { return forms()[GetParam()].first; }
    const std::string& bytes() const { return forms()[GetParam()].second; }
    const ScratchDirectory dir_;
};

template <class T>
bool isPart(const std::vector<T>& part, const std::vector<T>& whole, size_t first) {
    return part.size() <= whole.size() - first &&
           std::equal(part.begin(), part.end(), whole.begin() + ptrdiff_t(first));
}

/// Reads the next batch of both streams, which must be parts of `whole`.
void readSome(TriangleSource& source, const WholeMesh& whole) {
    VertexBatch v;
    TriangleBatch t;
    ASSERT_TRUE(source.readTriangles(t));
    ASSERT_TRUE(source.readVertices(v));
    EXPECT_TRUE(isPart(t.triangle, whole.triangles, t.first));
    EXPECT_TRUE(isPart(v.position, whole.vertices.position, v.first));
    EXPECT_TRUE(isPart(v.normal, whole.vertices.normal, v.first));
    EXPECT_TRUE(isPart(v.colour, whole.vertices.colour, v.first));
}

TEST_P(EverySource, streamsCanBeReadInAnyOrderAgain) {
    for (const std::string& text : {bytes(), gzipped(bytes())}) {
        const auto source = openSource({dir_.write(name(), text)});
        const WholeMesh whole = readWhole(*source);
        source->rewindVertices();
        source->rewindTriangles();
        for (int i = 0; i < 2 && !HasFailure(); ++i) readSome(*source, whole);
        source->rewindTriangles();
        expectSameMesh(readWhole(*source), whole);
    }
}

TEST_P(EverySource, isTheSameFromASlowPipe) {
    const WholeMesh plain = readWhole(dir_.write(name(), bytes()));
    const std::string pipe = dir_.file("pipe");
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    std::jthread writer([&] {
        std::ofstream out(pipe, std::ios::binary);
        out.write(bytes().data(), 10).flush();
        std::this_thread::sleep_for(std::chrono::milliseconds(150));
        out.write(bytes().data() + 10, std::streamsize(bytes().size() - 10));
    });
    const auto source = openSource({pipe}, dir_.path());
    EXPECT_EQ(source->inputBytes(), bytes().size());
    for (int i = 0; i < 2; ++i) expectSameMesh(readWhole(*source), plain);
}

/// What reading on and reading again fail with.
std::pair<std::string, std::string> faultsAfter(TriangleSource& source, const WholeMesh& whole) {
    const auto faultOf = [](auto&& work) -> std::string {
        try {
            work();
            return "";
        } catch (const InputError& e) {
            return e.what();
        }
    };
    const std::string reading_on = faultOf([&] {
        VertexBatch v;
        TriangleBatch t;
        while (source.readVertices(v))
            EXPECT_TRUE(isPart(v.position, whole.vertices.position, v.first));
        while (source.readTriangles(t)) EXPECT_TRUE(isPart(t.triangle, whole.triangles, t.first));
    });
    return {reading_on, faultOf([&] { expectSameMesh(readWhole(source), whole); })};
}

TEST_P(EverySource, noticesThatTheFileShrinksOrGrows) {
    const std::string path = dir_.write(name(), bytes());
    const WholeMesh whole = readWhole(path);
    for (const bool shrinks : {true, false}) {
        SCOPED_TRACE(shrinks);
        const auto source = openSource({dir_.write(name(), bytes())});
        readSome(*source, whole);
        if (shrinks)
            std::filesystem::resize_file(path, bytes().size() / 2);
        else
            std::ofstream(path, std::ios::binary | std::ios::app) << bytes();
        const auto [reading_on, again] = faultsAfter(*source, whole);
        EXPECT_TRUE((!shrinks && reading_on.empty()) || reading_on.starts_with(path + ": "))
            << reading_on;
        EXPECT_TRUE((!shrinks && again.empty()) || again.starts_with(path + ": ")) << again;
    }
}

INSTANTIATE_TEST_SUITE_P(Forms, EverySource, testing::Range(size_t(0), size_t(6)),
                         [](const auto& info) {
                             std::string name = forms()[info.param].first;
                             std::replace(name.begin(), name.end(), '.', '_');
                             return name;
                         });

}  // namespace
}  // namespace pietra
