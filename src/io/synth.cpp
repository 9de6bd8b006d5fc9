#include "io/synth.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "io/mesh_writer.h"
#include "io/relief.h"
#include "io/subdivide.h"
#include "io/synth_shapes.h"

namespace pietra {

namespace {

constexpr uint64_t kDefaultTriangles = 2000000;

uint64_t trianglesOf(const SynthRequest& request) {
    return request.triangles > 0 ? request.triangles : kDefaultTriangles;
}

/// How large a mesh is and how fine, roughly: what chooses the width of its numbers.
struct Extent {
    Box3d bounds;
    double edge = 0;  ///< length of a typical edge
};

/// A source and what it reads from.
struct Opened {
    std::unique_ptr<TriangleSource> input;
    std::unique_ptr<TriangleSource> source;
    Extent extent;
};

/// A mesh of about a size of `half` in every direction.
Opened openSynthetic(std::unique_ptr<const SyntheticMesh> mesh, double half) {
    const double edge = 4 * half / std::sqrt(double(mesh->triangleCount()));
    return {nullptr, sourceOf(std::move(mesh)), {{Vec3d(-half), Vec3d(half)}, edge}};
}

Opened openSphere(const SynthRequest& r) {
    return openSynthetic(makeSphere(trianglesOf(r)), 1);
}
Opened openStatue(const SynthRequest& r) {
    return openSynthetic(makeStatue(trianglesOf(r), r.seed), 1);
}
Opened openTerrain(const SynthRequest& r) {
    Opened opened = openSynthetic(makeTerrain(trianglesOf(r), r.seed), 500);
    opened.extent.bounds = {Vec3d(0, 0, -100), Vec3d(1000, 1000, 300)};
    return opened;
}
Opened openEarth(const SynthRequest& r) {
    ReliefSettings settings;
    settings.triangles = r.triangles;
    return openSynthetic(makeRelief(r.input.empty() ? kEtopo5Path : r.input, settings), 6500);
}

/// The box of the vertices, and the mean length of some edges.
Extent measure(TriangleSource& source) {
    Extent extent;
    VertexBatch vertices;
    std::vector<Vec3d> first;
    source.rewindVertices();
    while (source.readVertices(vertices)) {
        for (const Vec3d& p : vertices.position) extent.bounds.add(p);
        if (first.empty()) first = vertices.position;
    }
    TriangleBatch triangles;
    source.rewindTriangles();
    source.readTriangles(triangles);
    uint64_t edges = 0;
    for (const auto& t : triangles.triangle)
        if (t[0] < first.size() && t[1] < first.size()) {
            extent.edge += glm::distance(first[t[0]], first[t[1]]);
            ++edges;
        }
    extent.edge /= double(std::max<uint64_t>(edges, 1));
    return extent;
}

Opened openSubdivision(const SynthRequest& r) {
    if (r.input.empty()) throw UsageError("synth subdivide needs a mesh to subdivide");
    if (r.levels < 0 || r.levels > kMaxSubdivideLevels)
        throw UsageError(
            fmt::format("--levels is between 0 and {}, not {}", kMaxSubdivideLevels, r.levels));
    if (!(r.displace >= 0 && r.displace <= 1))
        throw UsageError(fmt::format("--displace is between 0 and 1, not {}", r.displace));
    Opened opened;
    opened.input = openSource({r.input});
    opened.extent = measure(*opened.input);
    opened.extent.edge /= double(1 << r.levels);
    opened.source = subdivide(*opened.input, {r.levels, r.displace, r.seed});
    return opened;
}

struct KindRow {
    SynthKind kind;
    Opened (*open)(const SynthRequest&);
};
constexpr KindRow kKinds[] = {
    {{"sphere", "the unit sphere"}, openSphere},
    {{"statue", "a bust with folds and chisel marks, closed"}, openStatue},
    {{"terrain", "fractal terrain with colours and heights, open"}, openTerrain},
    {{"earth", "the Earth's relief, closed, from ETOPO5 (Debian package ferret-datasets)"},
     openEarth},
    {{"subdivide", "a mesh, each triangle cut into four --levels times and displaced"},
     openSubdivision},
};

}  // namespace

std::span<const SynthKind> synthKinds() {
    static const auto kinds = [] {
        std::array<SynthKind, std::size(kKinds)> out{};
        for (size_t i = 0; i < out.size(); ++i) out[i] = kKinds[i].kind;
        return out;
    }();
    return kinds;
}

SynthResult synthesize(const SynthRequest& request, const std::string& output, bool force,
                       Progress& progress) {
    const KindRow* row = nullptr;
    std::string names;
    for (const KindRow& k : kKinds) {
        if (request.kind == k.kind.name) row = &k;
        names += fmt::format("{}{}", names.empty() ? "" : ", ", k.kind.name);
    }
    if (!row) throw UsageError(fmt::format("synth knows no \"{}\", but {}", request.kind, names));
    const Opened opened = row->open(request);
    TriangleSource& source = *opened.source;
    MeshOutput settings;
    settings.schema = source.schema();
    settings.comment = fmt::format("pietra synth {}", request.kind);
    settings.expected_vertices = source.vertexCount();
    settings.expected_triangles = source.triangleCountHint();
    const Box3d& bounds = opened.extent.bounds;
    settings.centre = (bounds.min + bounds.max) * 0.5;
    // Floats may move a point by a 64th of an edge, where edges are as short as a quarter of the
    // mean.
    settings.double_positions = needsDoubles(bounds, opened.extent.edge / 64);
    const auto writer = createMesh(output, force, settings);
    progress.beginStage("write", settings.expected_vertices + settings.expected_triangles);
    copyMesh(source, *writer, progress);
    writer->finish();
    progress.endStage();
    SynthResult result{writer->vertexCount(), writer->triangleCount(), source.notes()};
    for (std::string& note : writer->notes()) result.notes.push_back(std::move(note));
    return result;
}

}  // namespace pietra
