#include "audit/input_survey.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "audit/audit_testing.h"
#include "audit/border_chains.h"
#include "base/error.h"

namespace pietra {
namespace {

ToyTerrain terrain(int depth = 8) {
    ToyTerrainSettings settings;
    settings.depth = depth;
    settings.keep_refining = 0.95;
    return makeToyTerrain(settings);
}

InputSurvey survey(MemorySource& source, const Lattice& lattice, size_t memory_bytes = 4 << 20) {
    static Budget budget(1 << 30);  // outlives the survey's reservation
    InputTriangles input(source, budget, 4 << 20, tempDir());
    return surveyInput(input, lattice, budget, memory_bytes, tempDir());
}

TEST(InputSurvey, theFinestCutIsTheInput) {
    const ToyTerrain model = terrain();
    const Lattice lattice{{-70, 1e6, 3}, 0.01, 0};
    const PatchStream stream = streamOf(model.patches);
    const Cut finest = finestCut(model.nodes);
    MemorySource source = sourceOf(model, lattice, 0.9);
    const InputSurvey input = survey(source, lattice);
    EXPECT_EQ(input.surface.triangles, finest.triangles);
    EXPECT_EQ(input.degenerate + input.duplicate, 0u);
    EXPECT_TRUE(isSameSurface(fingerprintOfCut(stream, finest.nodes), input));
    // Whatever else is drawn is something else.
    EXPECT_FALSE(isSameSurface(fingerprintOfCut(stream, cutByHeight(model.nodes, 1).nodes), input));
    std::vector<NodeIndex> nodes = finest.nodes;
    nodes.pop_back();
    EXPECT_FALSE(isSameSurface(fingerprintOfCut(stream, nodes), input));
}

TEST(InputSurvey, doublesAndDegenerateTrianglesAreCountedOnce) {
    const ToyTerrain model = terrain();
    const PatchStream stream = streamOf(model.patches);
    const SurfaceFingerprint finest = fingerprintOfCut(stream, finestCut(model.nodes).nodes);
    MemorySource source = sourceOf(model, {}, 0);
    const std::vector<EdgeKey> border = survey(source, {}).border;
    std::swap(source.triangles[5][1], source.triangles[5][2]);  // faces the other way
    EXPECT_FALSE(isSameSurface(finest, survey(source, {})));
    std::swap(source.triangles[5][1], source.triangles[5][2]);
    const size_t doubles = source.triangles.size() / 3;
    for (size_t t = 0; t < doubles; ++t) source.triangles.push_back(source.triangles[3 * t]);
    auto [a, b, c] = source.triangles[7];
    source.triangles.push_back({c, b, a});
    source.triangles.push_back({a, b, b});
    source.vertices.position.push_back(source.vertices.position[a] + 0.3);
    source.triangles.push_back({a, b, source.vertices.position.size() - 1});
    for (const size_t memory : {size_t(1) << 20, size_t(64) << 20}) {
        const InputSurvey input = survey(source, {}, memory);
        EXPECT_EQ(input.duplicate, doubles + 1);
        EXPECT_EQ(input.degenerate, 2u);
        EXPECT_TRUE(isSameSurface(finest, input));
        EXPECT_EQ(input.border, border);
    }
}

TEST(InputSurvey, bordersAreTheEdgesUsedOnce) {
    const ToyTerrain model = terrain(11);
    MemorySource source = sourceOf(model, {}, 0);
    source.triangles.erase(source.triangles.begin() + 100, source.triangles.begin() + 103);
    std::map<EdgeKey, int> uses;
    for (const auto& t : source.triangles)
        for (int k = 0; k < 3; ++k) {
            const uint64_t p = latticeKey(Vec3i(source.vertices.position[t[k]]));
            const uint64_t q = latticeKey(Vec3i(source.vertices.position[t[(k + 1) % 3]]));
            ++uses[{std::min(p, q), std::max(p, q)}];
        }
    std::vector<EdgeKey> border;
    for (const auto& [edge, count] : uses)
        if (count == 1) border.push_back(edge);
    EXPECT_EQ(survey(source, {}, 1 << 20).border, border);
    EXPECT_GT(border.size(), 40u);
}

TEST(InputSurvey, moreBorderThanMemoryIsRefused) {
    const ToyTerrain model = terrain();
    MemorySource source = sourceOf(model, {}, 0);
    // A soup: no vertex is shared.
    for (size_t t = 0; t < source.triangles.size(); ++t)
        for (uint64_t& corner : source.triangles[t]) {
            source.vertices.position.push_back(source.vertices.position[corner] +
                                               Vec3d(0, 0, 1000 + 100 * double(t)));
            corner = source.vertices.position.size() - 1;
        }
    Budget budget((1 << 20) + source.vertices.position.size() * sizeof(Vec3d) + 50000);
    InputTriangles input(source, budget, 1 << 20, tempDir());
    try {
        surveyInput(input, {}, budget, 1 << 20, tempDir());
        FAIL();
    } catch (const MemoryError& error) {
        EXPECT_TRUE(std::string(error.what()).starts_with("the border edges of the input needs"));
    }
}

EdgeKey edge(uint64_t a, uint64_t b) {
    return {std::min(a, b), std::max(a, b)};
}

/// Consecutive numbers joined, and the last with the first if it is a loop.
std::vector<EdgeKey> chain(const std::vector<uint64_t>& numbers, bool loop) {
    std::vector<EdgeKey> edges;
    for (size_t k = 0; k + 1 < numbers.size(); ++k)
        edges.push_back(edge(numbers[k], numbers[k + 1]));
    if (loop && numbers.size() > 2) edges.push_back(edge(numbers.back(), numbers.front()));
    return edges;
}

uint64_t stray(std::vector<EdgeKey> border, const std::vector<EdgeKey>& cut) {
    Budget budget(1 << 20);
    std::sort(border.begin(), border.end());
    return BorderChains(border, budget).countStray(cut);
}

TEST(BorderChains, piecesJoinConsecutiveKeptVertices) {
    const std::vector<EdgeKey> loop = chain({10, 11, 12, 13, 14, 15}, true);
    EXPECT_EQ(stray(loop, loop), 0u);
    EXPECT_EQ(stray(loop, chain({10, 12, 15}, true)), 0u);
    EXPECT_EQ(stray(loop, {edge(11, 14)}), 0u);
    EXPECT_EQ(stray(loop, chain({10, 12, 14, 11}, false)), 2u);  // 12-14 only: 11 lies between
    EXPECT_EQ(stray(loop, {edge(10, 99)}), 1u);                  // no border vertex at all
    // An open chain has ends: nothing closes it.
    EXPECT_EQ(stray(chain({1, 2, 3, 4}, false), chain({1, 3, 4}, true)), 1u);
    EXPECT_EQ(stray({}, {edge(1, 2)}), 1u);
    EXPECT_EQ(stray(loop, {}), 0u);
}

TEST(BorderChains, piecesPassWhereBordersMeetIfThatIsNotKept) {
    // Two loops that touch in 5.
    std::vector<EdgeKey> eight = chain({5, 1, 2, 3}, true);
    for (const EdgeKey& e : chain({5, 6, 7, 8}, true)) eight.push_back(e);
    EXPECT_EQ(stray(eight, chain({5, 2, 3}, true)), 0u);
    EXPECT_EQ(stray(eight, {edge(1, 3)}), 0u);
    EXPECT_EQ(stray(eight, {edge(1, 6)}), 0u);
    EXPECT_EQ(stray(eight, {edge(1, 6), edge(5, 3)}), 1u);
    EXPECT_EQ(stray(eight, {edge(2, 7), edge(3, 1)}), 1u);
    EXPECT_EQ(stray(eight, {edge(1, 3), edge(5, 8)}), 0u);
}

TEST(BorderChains, anySubsetOfVerticesKeptIsFineAndAnySkipIsNot) {
    for (uint64_t seed = 0; seed < 200; ++seed) {
        std::vector<EdgeKey> border, cut;
        uint64_t skips = 0;
        for (uint64_t c = 0; c < 5; ++c) {
            std::vector<uint64_t> numbers, kept;
            const uint64_t length = 6 + mixBits(seed * 31 + c) % 20;
            // Numbers out of order, so that nothing depends on the keys' order along a chain.
            for (uint64_t k = 0; k < length; ++k) numbers.push_back(mixBits(1000 * c + k) >> 1);
            const bool loop = mixBits(seed + c) & 1;
            for (const EdgeKey& e : chain(numbers, loop)) border.push_back(e);
            for (uint64_t k = 0; k < length; ++k)
                if (mixBits(seed * 77 + c * 1000 + k) % 3) kept.push_back(numbers[k]);
            if (kept.size() < 5) continue;
            const std::vector<EdgeKey> pieces = chain(kept, loop);
            cut.insert(cut.end(), pieces.begin(), pieces.end());
            if (seed % 2 == 0) continue;
            cut.push_back(edge(kept[1], kept[3]));
            ++skips;
        }
        EXPECT_EQ(stray(border, cut), skips);
    }
}

TEST(BorderChains, cutsOfTheTerrainStayOnItsBorder) {
    const ToyTerrain model = terrain();
    MemorySource source = sourceOf(model, {}, 0);
    InputSurvey input = survey(source, {});
    Budget budget(64 << 20);
    const BorderChains chains(input.border, budget);
    for (uint64_t seed = 0; seed < 10; ++seed) {
        const Cut cut = randomCut(model.nodes, seed);
        EXPECT_TRUE(countCracksWithin(chains, streamOf(model.patches), cut.nodes, budget, 8 << 20,
                                      tempDir())
                        .ok());
    }
    // A crack that calls itself a border.
    std::vector<Mesh> patches = model.patches;
    const Cut finest = finestCut(model.nodes);
    size_t hidden = 0;
    Mesh& mesh = patches[finest.nodes[finest.nodes.size() / 2]];
    for (size_t t = 0; t < mesh.triangleCount(); ++t)
        for (int k = 0; k < 3; ++k) hidden += mesh.edgeClass(t, k) == EdgeClass::kManifold;
    mesh.clear();
    std::set<EdgeKey> rim;
    Budget other(64 << 20);
    const CrackReport open =
        countCracks(streamOf(patches), finest.nodes, other, 8 << 20, tempDir());
    ASSERT_GT(open.cracked_edges, 0u);
    ASSERT_LE(open.cracked_edges, hidden);
    for (Mesh& patch : patches)
        for (uint8_t& bits : patch.edge_class)
            for (int k = 0; k < 3; ++k)
                bits = uint8_t(bits | unsigned(EdgeClass::kBorder) << (2 * k));
    const CrackReport claimed =
        countCracksWithin(chains, streamOf(patches), finest.nodes, budget, 8 << 20, tempDir());
    EXPECT_EQ(claimed.cracked_edges, open.cracked_edges);
    EXPECT_FALSE(claimed.ok());
}

}  // namespace
}  // namespace pietra
