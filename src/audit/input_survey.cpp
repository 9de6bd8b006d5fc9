#include "audit/input_survey.h"

#include <algorithm>
#include <mutex>
#include <tuple>

#include "base/hash.h"
#include "base/parallel.h"
#include "extmem/spill_table.h"

namespace pietra {

namespace {

using PointKeys = std::array<uint64_t, 3>;

bool isDegenerate(const PointKeys& p) {
    return p[0] == p[1] || p[1] == p[2] || p[2] == p[0];
}

/// With the least point first, in the same cyclic order.
PointKeys rotated(PointKeys p) {
    std::rotate(p.begin(), std::min_element(p.begin(), p.end()), p.end());
    return p;
}

uint64_t hashOf(const PointKeys& p) {
    return mixBits(mixBits(mixBits(p[0]) + p[1]) + p[2] + 1);
}

void addTriangle(SurfaceFingerprint& sum, const PointKeys& triangle) {
    PointKeys sorted = triangle;
    std::sort(sorted.begin(), sorted.end());
    ++sum.triangles;
    sum.shape += hashOf(sorted);
    sum.oriented += hashOf(rotated(triangle));
}

void addTo(SurfaceFingerprint& sum, const SurfaceFingerprint& part) {
    sum.triangles += part.triangles;
    sum.shape += part.shape;
    sum.oriented += part.oriented;
}

/// A triangle seen from one of its edges: doubles of it agree in all three points.
struct EdgeOfTriangle {
    uint64_t a, b;      // the edge, a < b
    uint64_t opposite;  // its top bit: the triangle runs from b to a
    static constexpr uint64_t kTopBit = uint64_t(1) << 63;
    uint64_t hash() const { return mixBits(mixBits(a) + b); }
    uint64_t third() const { return opposite & ~kTopBit; }
    PointKeys points() const {
        return opposite & kTopBit ? PointKeys{b, a, third()} : PointKeys{a, b, third()};
    }
    bool sameTriangle(const EdgeOfTriangle& o) const {
        return a == o.a && b == o.b && third() == o.third();
    }
    bool operator<(const EdgeOfTriangle& o) const {
        return std::tuple(a, b, third(), opposite) < std::tuple(o.a, o.b, o.third(), o.opposite);
    }
};

void appendEdges(const PointKeys& p, std::vector<EdgeOfTriangle>& out) {
    for (int k = 0; k < 3; ++k) {
        const uint64_t from = p[k], to = p[(k + 1) % 3], third = p[(k + 2) % 3];
        if (from < to)
            out.push_back({from, to, third});
        else
            out.push_back({to, from, third | EdgeOfTriangle::kTopBit});
    }
}

/// Grows `border` within the budget, doubling as a vector does.
void appendBorder(std::span<const EdgeKey> edges, Budget& budget, InputSurvey& survey) {
    const size_t needed = survey.border.size() + edges.size();
    if (needed > survey.border.capacity()) {
        const size_t capacity = std::max(needed, 2 * survey.border.capacity());
        Reservation larger =
            budget.reserve(capacity * sizeof(EdgeKey), "the border edges of the input");
        survey.border.reserve(capacity);
        survey.border_memory = std::move(larger);
    }
    survey.border.insert(survey.border.end(), edges.begin(), edges.end());
}

/// One sorted run of the table: whole edges.
struct RunFindings {
    std::vector<EdgeKey> border;
    SurfaceFingerprint surface;  // of triangles seen from the edge of their two least points
    uint64_t doubles = 0;        // likewise

    void examine(std::span<const EdgeOfTriangle> run) {
        for (size_t i = 0; i < run.size();) {
            const size_t first = i;
            uint32_t uses = 0;
            for (; i < run.size() && run[i].a == run[first].a && run[i].b == run[first].b; ++i) {
                const bool again = i > first && run[i].sameTriangle(run[i - 1]);
                uses += !again;
                if (run[i].third() < run[i].b) continue;  // counted at another of its edges
                if (again)
                    ++doubles;
                else
                    addTriangle(surface, run[i].points());
            }
            if (uses == 1) border.push_back({run[first].a, run[first].b});
        }
    }
};

}  // namespace

InputSurvey surveyInput(InputTriangles& input, const Lattice& lattice, Budget& budget,
                        size_t memory_bytes, const std::string& temp_dir) {
    InputSurvey survey;
    SpillTable<EdgeOfTriangle> edges(budget, memory_bytes, temp_dir, "the edges of the input");
    std::vector<EdgeOfTriangle> some;
    input.forEachBatch([&](uint64_t, std::span<const InputTriangles::Corners> batch) {
        some.clear();
        for (const InputTriangles::Corners& t : batch) {
            PointKeys p;
            for (int k = 0; k < 3; ++k) p[k] = latticeKey(lattice.snap(t[k]));
            if (isDegenerate(p))
                ++survey.degenerate;
            else
                appendEdges(p, some);
        }
        edges.append(some);
    });
    std::mutex mutex;
    edges.forEachRun([&](std::span<const EdgeOfTriangle> run) {
        RunFindings found;
        found.examine(run);
        const std::lock_guard lock(mutex);
        appendBorder(found.border, budget, survey);
        addTo(survey.surface, found.surface);
        survey.duplicate += found.doubles;
    });
    std::sort(survey.border.begin(), survey.border.end());
    return survey;
}

SurfaceFingerprint fingerprintOfCut(const PatchStream& stream, std::span<const NodeIndex> nodes) {
    std::mutex mutex;
    SurfaceFingerprint sum;
    stream(nodes, [&](NodeIndex, const Mesh& mesh) {
        SurfaceFingerprint part;
        for (const Triangle& t : mesh.triangle)
            addTriangle(part, {latticeKey(mesh.position[t[0]]), latticeKey(mesh.position[t[1]]),
                               latticeKey(mesh.position[t[2]])});
        const std::lock_guard lock(mutex);
        addTo(sum, part);
    });
    return sum;
}

bool isSameSurface(const SurfaceFingerprint& finest_cut, const InputSurvey& input) {
    return finest_cut.triangles == input.surface.triangles &&
           finest_cut.shape == input.surface.shape &&
           (input.duplicate > 0 || finest_cut.oriented == input.surface.oriented);
}

}  // namespace pietra
