#include "audit/certificate.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "audit/audit_testing.h"
#include "audit/sample_index.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/parallel.h"
#include "multires/toy_terrain.h"

namespace pietra {
namespace {

std::vector<CertificateReport> auditToFinest(const ToyTerrain& model, std::span<const Cut> cuts,
                                             const CertificateOptions& options = {.samples = 60000},
                                             uint64_t order = 0) {
    Budget budget(256 << 20);
    const PatchStream stream = streamOf(model.patches, order);
    return auditCertificate(model.nodes, cuts, stream, truthOfFinestCut(model.nodes, stream),
                            options, budget);
}

TEST(SampleIndex, findsTheBestOfAllTriangles) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(0, 1);
    const auto point = [&](double size) {
        return Vec3d(uniform(random), uniform(random), uniform(random)) * size;
    };
    for (const size_t count : {0, 1, 7, 8, 9, 65, 700}) {
        std::vector<Sample> samples;
        for (uint64_t i = 0; i < count; ++i)
            samples.push_back({point(2000), std::exp2(6 * uniform(random)), i});
        if (count > 8) samples[3] = samples[4] = samples[5];
        struct Run {
            std::vector<TriangleCorners> triangles;
            double reach;
        };
        std::vector<Run> runs(60);
        for (Run& run : runs) {
            run.reach = std::exp2(3 * uniform(random) - 2);
            for (int k = 0; k < 20; ++k) {
                const Vec3d a = point(2000);
                run.triangles.push_back({a, a + point(200), a + point(200)});
            }
            if (&run != &runs[0]) run.triangles.push_back(runs[0].triangles[0]);  // equal ratios
        }
        runs[1].reach = runs[2].reach = runs[3].reach;
        Budget budget(1 << 20);
        SampleIndex index(samples, budget);
        std::vector<uint32_t> order(runs.size());
        std::iota(order.begin(), order.end(), 0u);
        for (int again = 0; again < 4; ++again) {
            index.restart();
            std::shuffle(order.begin(), order.end(), random);
            parallelFor(runs.size(), [&](size_t k) {
                index.visit(runs[order[k]].triangles, runs[order[k]].reach, order[k]);
            });
            for (size_t i = 0; i < index.size(); ++i) {
                const Sample& sample = index.sample(i);
                std::pair<float, uint32_t> best(SampleIndex::kMaxRatio, SampleIndex::kNoTag);
                for (uint32_t r = 0; r < runs.size(); ++r)
                    for (const TriangleCorners& t : runs[r].triangles) {
                        const double d = TriangleDistance(t).distance(sample.position);
                        best = std::min(best, {float(d / (sample.reach * runs[r].reach)), r});
                    }
                EXPECT_EQ(index.ratio(i), best.first);
                EXPECT_EQ(index.tag(i), best.second);
            }
        }
    }
}

TEST(SampleIndex, keepsToItsBudget) {
    Budget budget(SampleIndex::bytesFor(1000));
    EXPECT_THROW(SampleIndex(std::vector<Sample>(1001), budget), MemoryError);
    EXPECT_EQ(SampleIndex(std::vector<Sample>(1000), budget).size(), 1000u);
}

TEST(Certificate, provenErrorsAreNeverViolated) {
    for (uint64_t seed = 1; seed <= 3; ++seed) {
        ToyTerrainSettings settings;
        settings.seed = seed;
        const ToyTerrain model = makeToyTerrain(settings);
        std::vector<Cut> cuts;
        for (uint64_t k = 0; k < 8; ++k) cuts.push_back(randomCut(model.nodes, k));
        for (const CertificateReport& report : auditToFinest(model, cuts)) {
            EXPECT_GT(report.truth_to_cut.samples, 1000u);
            EXPECT_GT(report.cut_to_truth.samples, 100u);
            EXPECT_EQ(report.violations(), 0u);
            EXPECT_LE(report.worstRatio(), 1);
            EXPECT_FALSE(report.first_violation.has_value());
            for (const GroupTightness& group : report.groups)
                EXPECT_LE(group.measured, group.stated * (1 + 1e-6) + 1e-8);
        }
    }
}

/// A cut's group by group distances as the report should have them, by brute force on its samples'
/// definition: the largest distance of many points, either way.
TEST(Certificate, measuresWhatBruteForceMeasures) {
    ToyTerrainSettings settings;
    settings.depth = 4;
    settings.keep_refining = 1;
    const ToyTerrain model = makeToyTerrain(settings);
    const Cut cut = rootCut(model.nodes);
    const Cut finest = finestCut(model.nodes);
    const auto corners = [&](const Cut& of) {
        std::vector<TriangleCorners> all;
        for (const NodeIndex i : of.nodes)
            for (const Triangle& t : model.patches[i].triangle)
                all.push_back({Vec3d(model.patches[i].position[t[0]]),
                               Vec3d(model.patches[i].position[t[1]]),
                               Vec3d(model.patches[i].position[t[2]])});
        return all;
    };
    const auto farthest = [](const std::vector<TriangleCorners>& from,
                             const std::vector<TriangleCorners>& to) {
        double worst = 0;
        constexpr int n = 12;
        for (const TriangleCorners& t : from)
            for (int i = 0; i <= n; ++i)
                for (int j = 0; i + j <= n; ++j) {
                    const Vec3d p =
                        t[0] + (t[1] - t[0]) * (double(i) / n) + (t[2] - t[0]) * (double(j) / n);
                    double d = 1e30;
                    for (const TriangleCorners& other : to)
                        d = std::min(d, TriangleDistance(other).distance(p));
                    worst = std::max(worst, d);
                }
        return worst;
    };
    const double truth =
        std::max(farthest(corners(finest), corners(cut)), farthest(corners(cut), corners(finest)));
    const CertificateReport report =
        auditToFinest(model, std::span(&cut, 1), {.samples = 200000, .per_triangle = 5000})[0];
    ASSERT_EQ(report.groups.size(), 1u);
    EXPECT_NEAR(report.groups[0].measured, truth, 0.02 * truth);
    EXPECT_EQ(report.groups[0].height, 4);
    EXPECT_EQ(report.groups[0].samples, report.samples());
    EXPECT_NEAR(report.worstRatio(), report.groups[0].measured / report.groups[0].stated, 1e-5);
}

TEST(Certificate, errorsBelowTheMeasuredOnesAreViolated) {
    ToyTerrain model = makeToyTerrain();
    const Cut cut = cutByHeight(model.nodes, 3);
    const CertificateReport before = auditToFinest(model, std::span(&cut, 1))[0];
    std::map<uint32_t, double> measured;
    for (const GroupTightness& group : before.groups) measured[group.group] = group.measured;
    size_t shrunk = 0;
    for (Node& node : model.nodes)
        if (measured.count(node.group)) node.error = float(measured[node.group] * 1.00001);
    EXPECT_EQ(auditToFinest(model, std::span(&cut, 1))[0].violations(), 0u);
    // Ten percent less than the least that holds: every such group shows it.
    for (Node& node : model.nodes) node.error *= 0.9f;
    const CertificateReport after = auditToFinest(model, std::span(&cut, 1))[0];
    EXPECT_GE(after.violations(), 10u);
    EXPECT_NEAR(after.worstRatio(), 1 / 0.9, 0.03);
    EXPECT_TRUE(after.first_violation.has_value());
    for (const GroupTightness& group : after.groups) shrunk += group.measured > group.stated * 1.05;
    EXPECT_GE(shrunk, 5u);
}

/// A square whose middle is lifted by 100 in the fine mesh only, or in the coarse one only.
ToyTerrain pyramid(bool fine_is_lifted, float stated) {
    const auto square = [](int32_t height) {
        Mesh mesh;
        mesh.position = {{0, 0, 500},
                         {4000, 0, 500},
                         {4000, 4000, 500},
                         {0, 4000, 500},
                         {2000, 2000, 500 + height}};
        mesh.triangle = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
        mesh.edge_class.assign(4, uint8_t(EdgeClass::kBorder));
        return mesh;
    };
    ToyTerrain model;
    model.nodes.resize(2);
    model.nodes[0].child[0] = 1;
    model.nodes[0].error = stated;
    model.nodes[1].group = 1;
    for (int k = 0; k < 2; ++k) {
        model.patches.push_back(square((k == 1) == fine_is_lifted ? 100 : 0));
        model.nodes[k].triangles = 4;
    }
    return model;
}

TEST(Certificate, aMillionthTooLittleIsAViolation) {
    for (const bool fine_is_lifted : {true, false}) {
        const auto audit = [&](double stated) {
            const ToyTerrain model = pyramid(fine_is_lifted, float(stated));
            const Cut cut = rootCut(model.nodes);
            return auditToFinest(model, std::span(&cut, 1))[0];
        };
        // The other way round the distance is along the normal of the lifted side: a little less.
        EXPECT_EQ(audit(100).violations(), 0u);
        EXPECT_GT(audit(100 * (1 - 1e-6)).violations(), 0u);
        EXPECT_NEAR(audit(100).worstRatio(), 1, 1e-6);
        EXPECT_EQ(audit(0).worstRatio(), 1.25);
        EXPECT_GT(audit(0).violations(), 0u);
    }
}

TEST(Certificate, dependsNeitherOnThreadsNorOnOrder) {
    const ToyTerrain model = makeToyTerrain();
    const std::vector<Cut> cuts = {randomCut(model.nodes, 5), cutByHeight(model.nodes, 2)};
    std::vector<CertificateReport> first;
    for (const int jobs : {1, 2, 7}) {
        const ThreadLimit limit(jobs);
        for (const uint64_t order : {0, 1, 2}) {
            const std::vector<CertificateReport> reports =
                auditToFinest(model, cuts, {.samples = 20000}, order);
            if (first.empty()) first = reports;
            for (size_t c = 0; c < cuts.size(); ++c) {
                EXPECT_EQ(reports[c].samples(), first[c].samples());
                EXPECT_EQ(reports[c].worstRatio(), first[c].worstRatio());
                ASSERT_EQ(reports[c].groups.size(), first[c].groups.size());
                for (size_t g = 0; g < reports[c].groups.size(); ++g) {
                    EXPECT_EQ(reports[c].groups[g].measured, first[c].groups[g].measured);
                    EXPECT_EQ(reports[c].groups[g].samples, first[c].groups[g].samples);
                }
            }
        }
    }
}

TEST(Certificate, tableOfTightnessByHeight) {
    const ToyTerrain model = makeToyTerrain();
    std::vector<Cut> cuts;
    for (int height = 1; height <= 4; ++height) cuts.push_back(cutByHeight(model.nodes, height));
    const std::vector<TightnessRow> rows =
        tightnessTable(auditToFinest(model, cuts, {.samples = 200000}), 8);
    ASSERT_EQ(rows.size(), 4u);
    for (size_t k = 0; k < rows.size(); ++k) {
        EXPECT_EQ(rows[k].height, k + 1);
        EXPECT_GE(rows[k].groups, 2u);
        EXPECT_GE(rows[k].least, 0.999999);
        EXPECT_LE(rows[k].least, rows[k].median);
        EXPECT_LE(rows[k].median, rows[k].p95);
        EXPECT_LE(rows[k].p95, rows[k].worst);
        EXPECT_LT(rows[k].median, 3);  // vertical against shortest distance
    }
}

TEST(Certificate, againstTheInputTheQuantisationCounts) {
    const Lattice lattice{{4e6, -5e5, 100}, 0.001, 0};  // georeferenced
    ToyTerrainSettings settings;
    const auto violations = [&](float quantisation, double jitter) {
        settings.quantisation_error = quantisation;
        const ToyTerrain model = makeToyTerrain(settings);
        MemorySource source = sourceOf(model, lattice, jitter);
        Budget budget(256 << 20);
        InputTriangles input(source, budget, 1 << 20, tempDir());
        const Truth truth = truthOfInput(input, lattice, source.triangleCountHint());
        const std::vector<Cut> cuts = {finestCut(model.nodes), randomCut(model.nodes, 8)};
        uint64_t sum = 0;
        for (const CertificateReport& report : auditCertificate(
                 model.nodes, cuts, streamOf(model.patches), truth, {.samples = 40000}, budget)) {
            EXPECT_GT(report.samples(), 10000u);
            sum += report.violations();
        }
        return sum;
    };
    EXPECT_EQ(violations(0.8661f, 0.999), 0u);
    EXPECT_GT(violations(0.3f, 0.999), 0u);
    EXPECT_EQ(violations(0.0f, 0.0), 0u);
}

TEST(InputTriangles, areTheSameFromMemoryAndFromTheFile) {
    ToyTerrainSettings settings;
    settings.depth = 13;
    settings.keep_refining = 0.97;
    const ToyTerrain model = makeToyTerrain(settings);
    const Lattice lattice{{10, 20, 30}, 0.5, 0};
    MemorySource source = sourceOf(model, lattice, 0.9);
    ASSERT_GT(source.vertexCount() * sizeof(Vec3d), size_t(1) << 20);  // does not fit
    for (const bool shuffled : {false, true}) {
        if (shuffled) source.shuffleTriangles();
        Budget budget(1 << 20);
        InputTriangles input(source, budget, 1 << 20, tempDir());
        size_t next = 0;
        for (int again = 0; again < 2; ++again, next = 0) {
            input.forEachBatch([&](uint64_t first, std::span<const InputTriangles::Corners> batch) {
                ASSERT_EQ(first, next);
                for (const InputTriangles::Corners& corners : batch) {
                    for (int k = 0; k < 3; ++k)
                        ASSERT_EQ(corners[k], source.vertices.position[source.triangles[next][k]]);
                    ++next;
                }
            });
            EXPECT_EQ(next, source.triangles.size());
        }
    }
}

}  // namespace
}  // namespace pietra
