// Generated meshes: closed and oriented where they say so, no vertex twice, the same for any number
// of threads, of the size asked for.

#include "io/synth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/budget.h"
#include "base/parallel.h"
#include "io/netcdf.h"
#include "io/noise.h"
#include "io/relief.h"
#include "io/subdivide.h"
#include "io/synth_shapes.h"
#include "io/test_files.h"

namespace pietra {
namespace {

struct Topology {
    uint64_t border_edges = 0;    ///< used once
    uint64_t bad_edges = 0;       ///< used twice the same way round, or more than twice
    uint64_t equal_vertices = 0;  ///< whose position another one has
    uint64_t unused_vertices = 0;
    double volume = 0;
};

Topology examine(const WholeMesh& mesh) {
    Topology result;
    std::vector<std::array<uint64_t, 3>> edges;  // low, high, direction
    std::vector<bool> used(mesh.vertices.position.size(), false);
    const auto& p = mesh.vertices.position;
    for (const auto& t : mesh.triangles) {
        result.volume += glm::dot(p[t[0]], glm::cross(p[t[1]], p[t[2]])) / 6;
        for (int k = 0; k < 3; ++k) {
            const uint64_t a = t[k], b = t[(k + 1) % 3];
            EXPECT_NE(a, b);
            edges.push_back({std::min(a, b), std::max(a, b), a < b});
            used[a] = true;
        }
    }
    std::sort(edges.begin(), edges.end());
    for (size_t i = 0, end; i < edges.size(); i = end) {
        for (end = i;
             end < edges.size() && edges[end][0] == edges[i][0] && edges[end][1] == edges[i][1];)
            ++end;
        if (end - i == 1)
            ++result.border_edges;
        else if (end - i > 2 || edges[i][2] == edges[i + 1][2])
            ++result.bad_edges;
    }
    result.unused_vertices = uint64_t(std::count(used.begin(), used.end(), false));
    std::vector<std::array<float, 3>> points;
    for (const Vec3d& v : p) points.push_back({float(v.x), float(v.y), float(v.z)});
    std::sort(points.begin(), points.end());
    result.equal_vertices = uint64_t(points.end() - std::unique(points.begin(), points.end()));
    return result;
}

void expectClosed(const WholeMesh& mesh) {
    const Topology topology = examine(mesh);
    EXPECT_EQ(topology.border_edges, 0u);
    EXPECT_EQ(topology.bad_edges, 0u);
    EXPECT_EQ(topology.equal_vertices, 0u);
    EXPECT_EQ(topology.unused_vertices, 0u);
    EXPECT_GT(topology.volume, 0);
}

/// A netCDF file with a grid `height` of rows x columns, as version 1 or 2.
std::string heightFile(int rows, int columns, bool north_first, char version) {
    std::string out = std::string("CDF") + version + std::string(4, '\0');
    const auto word = [&](uint32_t v) {
        for (int shift = 24; shift >= 0; shift -= 8) out += char(v >> shift);
    };
    const auto name = [&](std::string text) {
        word(uint32_t(text.size()));
        out += text;
        while (out.size() % 4) out += '\0';
    };
    const auto real = [&](double v) {
        uint64_t bits;
        std::memcpy(&bits, &v, 8);
        word(uint32_t(bits >> 32));
        word(uint32_t(bits));
    };
    word(10), word(2), name("lat"), word(uint32_t(rows)), name("lon"), word(uint32_t(columns));
    word(12), word(1), name("title"), word(2), word(5), out += "hello", out += std::string(3, '\0');
    word(11), word(3);
    const size_t offset_words = version == 1 ? 1 : 2;
    // Each variable: name, rank, dimensions, attributes, type, size, offset.
    const size_t data = out.size() + 2 * (8 + 4 + 4 + 8 + 4 + 4 + 4 * offset_words) +
                        (4 + 8 + 4 + 8 + 8 + 4 + 4 + 4 * offset_words);
    const auto variable = [&](const char* text, std::vector<uint32_t> dimensions, uint32_t type,
                              uint32_t bytes, size_t offset) {
        name(text), word(uint32_t(dimensions.size()));
        for (const uint32_t d : dimensions) word(d);
        word(0), word(0), word(type), word(bytes);
        if (offset_words == 2) word(0);
        word(uint32_t(offset));
    };
    const uint32_t lat_bytes = uint32_t(rows) * 8, lon_bytes = uint32_t(columns) * 4;
    variable("lat", {0}, 6, lat_bytes, data);
    variable("lon", {1}, 5, lon_bytes, data + lat_bytes);
    variable("height", {0, 1}, 4, uint32_t(rows * columns) * 4, data + lat_bytes + lon_bytes);
    EXPECT_EQ(out.size(), data);
    for (int j = 0; j < rows; ++j)
        real((north_first ? 90 : -90) + (north_first ? -1 : 1) * 180.0 * j / (rows - 1));
    for (int i = 0; i < columns; ++i) {
        const float lon = 360.0f * float(i) / float(columns);
        uint32_t bits;
        std::memcpy(&bits, &lon, 4);
        word(bits);
    }
    for (int j = 0; j < rows; ++j)
        for (int i = 0; i < columns; ++i)
            word(uint32_t(100 * (north_first ? rows - 1 - j : j) + i - 500));
    return out;
}

TEST(Noise, quarterTurnIsSineAndCosine) {
    for (int i = 0; i <= 1000; ++i) {
        const double t = i / 1000.0;
        const SinCos turn = quarterTurn(t);
        EXPECT_NEAR(turn.sin, std::sin(t * M_PI / 2), 3e-16);
        EXPECT_NEAR(turn.cos, std::cos(t * M_PI / 2), 3e-16);
    }
    EXPECT_EQ(quarterTurn(0).sin, 0);
    EXPECT_EQ(quarterTurn(0).cos, 1);
    EXPECT_EQ(quarterTurn(1).sin, 1);
    EXPECT_EQ(quarterTurn(1).cos, 0);
}

TEST(Noise, isContinuousAndBounded) {
    double largest = 0;
    for (int i = -4000; i < 4000; ++i) {
        const Vec3d p(i * 0.001, i * 0.0007, 3 - i * 0.0003);
        const double here = valueNoise(p, 5), there = valueNoise(p + Vec3d(1e-7), 5);
        EXPECT_NEAR(here, there, 2e-6);
        largest = std::max(largest, std::abs(here));
    }
    EXPECT_LE(largest, 1);
    EXPECT_GT(largest, 0.4);
}

TEST(Synth, spheresAreClosedForEverySize) {
    for (const uint64_t wanted : {1, 8, 30, 100, 1000, 20000, 200000}) {
        const auto source = sourceOf(makeSphere(wanted));
        const WholeMesh mesh = readWhole(*source);
        EXPECT_EQ(mesh.triangles.size(), source->triangleCountHint());
        expectClosed(mesh);
        EXPECT_NEAR(double(mesh.triangles.size()), double(wanted), 8 + std::sqrt(double(wanted)));
        for (const Vec3d& p : mesh.vertices.position) ASSERT_NEAR(glm::length(p), 1, 1e-15);
        EXPECT_LT(examine(mesh).volume, 4.0 / 3 * M_PI);
        EXPECT_GT(examine(mesh).volume, 4.0 / 3 * M_PI * (1 - 60.0 / double(wanted)));
    }
}

TEST(Synth, spheresHaveAsManyTrianglesAsAskedFor) {
    for (const uint64_t wanted : {62914560, 1000000000, 8 * 111 * 100})
        EXPECT_EQ(makeSphere(wanted)->triangleCount(), wanted);
}

TEST(Synth, statuesAreClosed) {
    for (const uint64_t seed : {1, 2}) expectClosed(readWhole(*sourceOf(makeStatue(100000, seed))));
    EXPECT_NE(readWhole(*sourceOf(makeStatue(100, 1))).vertices.position,
              readWhole(*sourceOf(makeStatue(100, 2))).vertices.position);
}

TEST(Synth, terrainIsASquareFacingUp) {
    const WholeMesh mesh = readWhole(*sourceOf(makeTerrain(180000, 1)));
    EXPECT_EQ(mesh.triangles.size(), 180000u);
    const Topology topology = examine(mesh);
    EXPECT_EQ(topology.border_edges, 4u * 300);
    EXPECT_EQ(topology.bad_edges, 0u);
    EXPECT_EQ(topology.equal_vertices, 0u);
    const auto& p = mesh.vertices.position;
    for (const auto& t : mesh.triangles)
        ASSERT_GT(glm::cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]).z, 0);
    EXPECT_EQ(mesh.vertices.scalar[1234], float(p[1234].z));
}

TEST(Synth, doesNotDependOnThreads) {
    const auto bytesWith = [](int jobs, const std::string& kind) {
        const ThreadLimit limit(jobs);
        const ScratchDirectory dir;
        SynthRequest request;
        request.kind = kind;
        request.triangles = 50000;
        Progress progress;
        synthesize(request, dir.file("a.ply"), false, progress);
        return readWholeFile(dir.file("a.ply"));
    };
    for (const char* kind : {"sphere", "statue", "terrain"}) {
        const std::string one = bytesWith(1, kind);
        EXPECT_EQ(one, bytesWith(2, kind));
        EXPECT_EQ(one, bytesWith(7, kind));
    }
}

TEST(Netcdf, readsHeaderAndValues) {
    const ScratchDirectory dir;
    for (const char version : {char(1), char(2)}) {
        const NetcdfFile file(dir.write("a.nc", heightFile(5, 8, false, version)));
        ASSERT_EQ(file.variables().size(), 3u);
        EXPECT_EQ(file.dimensions()[1].length, 8u);
        std::vector<double> values;
        file.read(*file.find("lat"), 1, 2, values);
        EXPECT_EQ(values, (std::vector<double>{-45, 0}));
        file.read(*file.find("lon"), 0, 3, values);
        EXPECT_EQ(values, (std::vector<double>{0, 45, 90}));
        file.read(*file.find("height"), 8, 2, values);
        EXPECT_EQ(values, (std::vector<double>{-400, -399}));
        EXPECT_EQ(file.find("none"), nullptr);
    }
}

TEST(Netcdf, noticesTruncationAndDamage) {
    const ScratchDirectory dir;
    const std::string good = heightFile(5, 8, false, 1);
    for (size_t size = 0; size < good.size(); ++size) {
        const std::string path = dir.write("a.nc", good.substr(0, size));
        EXPECT_THROW(makeRelief(path, {}), InputError) << size;
    }
    // Whatever byte of the header is wrong, the outcome is a mesh or an error, not a crash.
    for (size_t at = 0; at < 250; ++at)
        for (const char value : {'\0', '\x7f', '\xff'}) {
            std::string bad = good;
            bad[at] = value;
            try {
                makeRelief(dir.write("a.nc", bad), {});
            } catch (const InputError&) {
            }
        }
    EXPECT_THROW(NetcdfFile(dir.file("none")), IoError);
}

TEST(Relief, isAClosedSphere) {
    const ScratchDirectory dir;
    for (const bool north_first : {false, true})
        for (const int columns : {8, 10, 24}) {
            const std::string path = dir.write("a.nc", heightFile(13, columns, north_first, 1));
            const WholeMesh mesh = readWhole(*sourceOf(makeRelief(path, {6371, 1, 0})));
            expectClosed(mesh);
            EXPECT_EQ(mesh.triangles.size(), size_t(2 * columns * 11));
            EXPECT_NEAR(examine(mesh).volume / (4.0 / 3 * M_PI * 6371.0 * 6371 * 6371), 1, 0.2);
            // Row 3 from the south, column 2: latitude -45, height 100 * 3 + 2 - 500.
            const size_t v = 1 + 2 * size_t(columns) + 2;
            EXPECT_EQ(mesh.vertices.scalar[v], -198);
            const double radius = 6371 - 0.198, lon = 2 * M_PI * 2 / columns;
            const Vec3d expected(radius * std::cos(-M_PI / 4) * std::cos(lon),
                                 radius * std::cos(-M_PI / 4) * std::sin(lon),
                                 radius * std::sin(-M_PI / 4));
            EXPECT_LT(glm::distance(mesh.vertices.position[v], expected), 1e-9);
        }
}

TEST(Relief, takesEverySthSample) {
    const ScratchDirectory dir;
    const std::string path = dir.write("a.nc", heightFile(13, 24, false, 1));
    for (const uint64_t wanted : {1, 80, 200, 500, 100000}) {
        const WholeMesh mesh = readWhole(*sourceOf(makeRelief(path, {6371, 1, wanted})));
        expectClosed(mesh);
        const size_t columns = wanted < 20 ? 4 : wanted < 300 ? 12 : 24;
        EXPECT_EQ(mesh.triangles.size(), columns * (columns - 2)) << wanted;
    }
}

TEST(Relief, theEarthHas18653760Triangles) {
    if (!std::filesystem::exists(kEtopo5Path)) GTEST_SKIP() << "no " << kEtopo5Path;
    EXPECT_EQ(makeRelief(kEtopo5Path, {})->triangleCount(), 18653760u);
    const WholeMesh mesh = readWhole(*sourceOf(makeRelief(kEtopo5Path, {6371, 20, 500000})));
    expectClosed(mesh);
    const auto [lowest, highest] =
        std::minmax_element(mesh.vertices.scalar.begin(), mesh.vertices.scalar.end());
    EXPECT_LT(*lowest, -9000);
    EXPECT_GT(*highest, 6000);
}

TEST(Relief, namesWhatIsWrong) {
    const ScratchDirectory dir;
    const auto fault = [&](const std::string& bytes) -> std::string {
        const std::string path = dir.write("a.nc", bytes);
        try {
            makeRelief(path, {});
            return "";
        } catch (const InputError& e) {
            return std::string(e.what()).substr(path.size() + 2);
        }
    };
    EXPECT_EQ(fault("HDF5"), "is no netCDF file of the classic kind");
    std::string renamed = heightFile(5, 8, false, 1);
    renamed.replace(renamed.find("lat"), 3, "row");
    EXPECT_EQ(fault(renamed), "has no coordinates for row");
}

/// A tetrahedron with colours and a scalar; its vertices stand there twice over, its last face is
/// degenerate once they are welded.
std::string tetrahedron() {
    std::string text =
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double y\n"
        "property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        "property float heat\nelement face 5\nproperty list uchar int vertex_indices\nend_header\n";
    for (int copy = 0; copy < 2; ++copy)
        text += "0 0 0 0 0 0 0\n1 0 -0 100 0 0 1\n0 1 0 0 100 0 2\n-0 0 1 0 0 100 3\n";
    return text + "3 0 2 1\n3 4 5 3\n3 1 6 7\n3 2 0 3\n3 0 4 1\n";
}

TEST(Subdivide, staysClosedAndWelds) {
    const ScratchDirectory dir;
    const std::string path = dir.write("a.ply", tetrahedron());
    for (const int levels : {0, 1, 2, 5, 9}) {
        const auto input = openSource({path});
        const auto source = subdivide(*input, {levels, 0.1, 1});
        const WholeMesh mesh = readWhole(*source);
        const uint64_t triangles = uint64_t(4) << (2 * levels);
        EXPECT_EQ(mesh.triangles.size(), triangles);
        EXPECT_EQ(source->triangleCountHint(), triangles);
        EXPECT_EQ(mesh.vertices.position.size(), triangles / 2 + 2);
        EXPECT_EQ(mesh.vertices.colour.size(), triangles / 2 + 2);
        EXPECT_EQ(mesh.vertices.scalar.size(), triangles / 2 + 2);
        expectClosed(mesh);
        expectSameMesh(mesh, readWhole(*source));
    }
}

TEST(Subdivide, withoutDisplacementInterpolates) {
    const ScratchDirectory dir;
    const auto input = openSource({dir.write("a.ply", tetrahedron())});
    const WholeMesh mesh = readWhole(*subdivide(*input, {3, 0, 1}));
    EXPECT_NEAR(examine(mesh).volume, 1.0 / 6, 1e-15);
    for (size_t v = 0; v < mesh.vertices.position.size(); ++v) {
        const Vec3d& p = mesh.vertices.position[v];
        EXPECT_NEAR(mesh.vertices.scalar[v], p.x + 2 * p.y + 3 * p.z, 1e-6);
        EXPECT_NEAR(mesh.vertices.colour[v].g, 100 * p.y, 2);
    }
}

TEST(Subdivide, displacesByTheEdge) {
    const ScratchDirectory dir;
    const auto input = openSource({dir.write("a.ply", tetrahedron())});
    const WholeMesh flat = readWhole(*subdivide(*input, {1, 0, 1}));
    const WholeMesh rough = readWhole(*subdivide(*input, {1, 0.25, 1}));
    const WholeMesh other = readWhole(*subdivide(*input, {1, 0.25, 2}));
    EXPECT_EQ(flat.triangles, rough.triangles);
    double largest = 0;
    for (size_t v = 0; v < flat.vertices.position.size(); ++v)
        largest =
            std::max(largest, glm::distance(flat.vertices.position[v], rough.vertices.position[v]));
    EXPECT_GT(largest, 0.05);
    EXPECT_LT(largest, 0.25 * std::sqrt(2.0));
    EXPECT_NE(rough.vertices.position, other.vertices.position);
}

TEST(Subdivide, closesTheDragon) {
    const std::string path = sharedData("scans/dragon_vrip.ply.gz");
    if (path.empty()) GTEST_SKIP() << "no dragon in the shared data";
    const auto input = openSource({path});
    const WholeMesh mesh = readWhole(*subdivide(*input, {0, 0.2, 1}));
    EXPECT_EQ(mesh.triangles.size(), 871306u);
    const Topology topology = examine(mesh);
    EXPECT_EQ(topology.border_edges, 0u);
}

TEST(Synth, namesWrongUse) {
    const ScratchDirectory dir;
    const auto fault = [&](SynthRequest request) -> std::string {
        Progress progress;
        try {
            synthesize(request, dir.file("a.ply"), false, progress);
            return "";
        } catch (const UsageError& e) {
            return e.what();
        }
    };
    SynthRequest request;
    request.kind = "cube";
    EXPECT_EQ(fault(request),
              "synth knows no \"cube\", but sphere, statue, terrain, earth, subdivide");
    request.kind = "subdivide";
    EXPECT_EQ(fault(request), "synth subdivide needs a mesh to subdivide");
    request.input = dir.write("in.ply", tetrahedron());
    request.levels = 11;
    EXPECT_EQ(fault(request), "--levels is between 0 and 10, not 11");
    request.levels = 2;
    request.displace = -1;
    EXPECT_EQ(fault(request), "--displace is between 0 and 1, not -1");
    request.displace = 0.1;
    EXPECT_EQ(fault(request), "");
    EXPECT_EQ(readWhole(dir.file("a.ply")).triangles.size(), 64u);
    EXPECT_EQ(fault(request), dir.file("a.ply") + ": exists; --force overwrites it");
}

TEST(Synth, needsLittleMemory) {
    const ScratchDirectory dir;
    SynthRequest request;
    request.kind = "sphere";
    request.triangles = 5000000;
    const size_t before = residentBytes();
    struct Sink : ProgressSink {
        void show(const ProgressState&) override { most = std::max(most, residentBytes()); }
        void stageEnded(const ProgressState&) override {}
        size_t most = 0;
    } sink;
    Progress watched(&sink);
    synthesize(request, dir.file("a.ply"), false, watched);
    EXPECT_LT(sink.most, before + (size_t(16) << 20));
    EXPECT_GT(std::filesystem::file_size(dir.file("a.ply")), uint64_t(90) << 20);
}

}  // namespace
}  // namespace pietra
