#include "store/page_codec.h"

#include <gtest/gtest.h>

#include <thread>

#include "base/check.h"
#include "store/test_meshes.h"

namespace pietra {
namespace {

using namespace pietra::testing;

std::vector<const Mesh*> pointers(const std::vector<Mesh>& meshes) {
    std::vector<const Mesh*> out;
    for (const Mesh& mesh : meshes) out.push_back(&mesh);
    return out;
}

/// Encodes and decodes, expects the same content, and returns the page.
std::vector<std::byte> expectRoundTrip(const std::vector<Mesh>& meshes,
                                       const PageSettings& settings,
                                       PageCodec codec = PageCodec::kBest) {
    const std::vector<std::byte> page = encodePage(pointers(meshes), settings, codec);
    std::vector<Mesh> decoded;
    std::string fault;
    EXPECT_TRUE(decodePage(page, settings, decoded, fault)) << fault;
    EXPECT_EQ(decoded.size(), meshes.size());
    for (size_t i = 0; i < std::min(decoded.size(), meshes.size()); ++i)
        EXPECT_TRUE(content(decoded[i], settings.normal_bits) ==
                    content(meshes[i], settings.normal_bits))
            << "patch " << i;
    // Threads keep scratch from page to page, of which nothing may be seen.
    std::thread([&] {
        EXPECT_EQ(page, encodePage(pointers(meshes), settings, codec));
    }).join();
    std::thread([&] {
        std::vector<Mesh> fresh;
        EXPECT_TRUE(decodePage(page, settings, fresh, fault)) << fault;
    }).join();
    // What was decoded is a mesh like any other: its normals are already rounded.
    const std::vector<std::byte> again = encodePage(pointers(decoded), settings, codec);
    std::vector<Mesh> twice;
    EXPECT_TRUE(decodePage(again, settings, twice, fault)) << fault;
    for (size_t i = 0; i < std::min(twice.size(), decoded.size()); ++i)
        EXPECT_TRUE(content(twice[i], kMaxNormalBits) == content(decoded[i], kMaxNormalBits));
    return page;
}

const PageSettings kSettings[] = {{0, false, 0, 10}, {3, false, 0, 8},  {10, true, 0, 4},
                                  {0, true, 2, 16},  {1, false, 1, 12}, {5, true, 5, 9}};
const PageCodec kCodecs[] = {PageCodec::kPlain, PageCodec::kFront};

TEST(PageCodec, keepsSmoothMeshes) {
    Random random(1);
    for (const PageCodec codec : kCodecs)
        for (const PageSettings& s : kSettings)
            expectRoundTrip({makeSheet(20, 30, s, random), makeSphere(3, s, random),
                             makeSheet(1, 1, s, random), makeSheet(7, 1, s, random)},
                            s, codec);
}

TEST(PageCodec, keepsSoups) {
    Random random(2);
    for (const PageCodec codec : kCodecs)
        for (const PageSettings& s : kSettings)
            for (int i = 0; i < 30; ++i) {
                std::vector<Mesh> meshes;
                for (uint32_t k = below(random, 4); k > 0; --k)
                    meshes.push_back(
                        makeSoup(3 + below(random, 60), below(random, 100), s, random));
                expectRoundTrip(meshes, s, codec);
            }
}

TEST(PageCodec, keepsEmptyPatchesAndSingleTriangles) {
    Random random(3);
    for (const PageCodec codec : kCodecs)
        for (const PageSettings& s : kSettings) {
            expectRoundTrip({}, s, codec);
            expectRoundTrip({Mesh{}}, s, codec);
            expectRoundTrip({Mesh{}, makeSoup(3, 1, s, random), Mesh{}}, s, codec);
            expectRoundTrip({makeSoup(5, 0, s, random)}, s, codec);
        }
}

TEST(PageCodec, keepsTrianglesThatUseAVertexTwice) {
    Random random(4);
    const PageSettings s;
    Mesh mesh = makeSheet(3, 3, s, random);
    mesh.triangle.push_back({4, 4, 5});
    mesh.triangle.push_back({6, 6, 6});
    mesh.edge_class.resize(mesh.triangle.size(), 0);
    for (const PageCodec codec : kCodecs) expectRoundTrip({mesh}, s, codec);
}

TEST(PageCodec, keepsMoreThan65536Vertices) {
    Random random(5);
    const PageSettings s{2, false, 0, 10};
    Mesh mesh = makeSheet(300, 250, s, random);
    ASSERT_GT(mesh.vertexCount(), 65536u);
    for (const PageCodec codec : kCodecs)
        expectRoundTrip({mesh, makeSphere(2, s, random)}, s, codec);
}

/// Which body a page has.
PageCodec codecOf(std::span<const std::byte> page) {
    return PageCodec(page[0]);
}

TEST(PageCodec, takesTheFrontForEveryMeshThatHasOne) {
    Random random(20);
    for (const PageSettings& s : kSettings) {
        const auto front = [&](const Mesh& mesh) {
            return codecOf(encodePage(pointers({mesh}), s)) == PageCodec::kFront;
        };
        EXPECT_TRUE(front(Mesh{}));
        EXPECT_TRUE(front(makeSheet(9, 7, s, random)));
        EXPECT_TRUE(front(makeSphere(2, s, random)));
        Mesh soup = makeSoup(20, 200, s, random);  // every vertex is used
        EXPECT_TRUE(front(soup));
        EXPECT_FALSE(front(makeSoup(20, 1, s, random)));  // most are not
        soup.triangle[7][1] = soup.triangle[7][0];
        EXPECT_FALSE(front(soup));
    }
}

/// Surfaces with borders inside borders, handles, several components, and pinched vertices, which
/// take every path of the traversal: splits within a front and between two.
Mesh makeHoley(int columns, int rows, const PageSettings& s, Random& random, bool torus) {
    Mesh mesh = makeSheet(columns, rows, s, random);
    const auto at = [&](int x, int y) {
        return torus ? uint32_t((y % rows) * (columns + 1) + x % columns)
                     : uint32_t(y * (columns + 1) + x);
    };
    mesh.triangle.clear();
    for (int y = 0; y < rows; ++y)
        for (int x = 0; x < columns; ++x) {
            if (below(random, 12) == 0) continue;
            if (below(random, 5) > 0)
                mesh.triangle.push_back({at(x, y), at(x + 1, y), at(x, y + 1)});
            mesh.triangle.push_back({at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)});
        }
    std::vector<uint32_t> number(mesh.vertexCount(), ~0u);
    std::vector<Vec3i> position;
    for (Triangle& t : mesh.triangle)
        for (uint32_t& v : t) {
            if (number[v] == ~0u) {
                number[v] = uint32_t(position.size());
                position.push_back(mesh.position[v]);
            }
            v = number[v];
        }
    mesh.position = position;
    addAttributes(mesh, s, random, false);
    return mesh;
}

TEST(PageCodec, keepsHolesHandlesAndPinchedVertices) {
    Random random(21);
    for (const PageSettings& s : kSettings)
        for (int i = 0; i < 40; ++i) {
            const int columns = 3 + int(below(random, 20)), rows = 3 + int(below(random, 20));
            const Mesh mesh = makeHoley(columns, rows, s, random, i % 2 == 0);
            const std::vector<std::byte> page = expectRoundTrip({mesh}, s, PageCodec::kFront);
            EXPECT_EQ(codecOf(page), PageCodec::kFront);
        }
}

TEST(PageCodec, keepsClosedComponentsByTheHundred) {
    Random random(22);
    const PageSettings s{2, true, 0, 8};
    Mesh mesh;
    for (int i = 0; i < 300; ++i) {
        const auto base = uint32_t(mesh.vertexCount());
        for (int corner = 0; corner < 4; ++corner)
            mesh.position.push_back({4 * below(random, 1000), 4 * below(random, 1000), 4 * i});
        for (const Triangle& t : {Triangle{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}})
            mesh.triangle.push_back({base + t[0], base + t[1], base + t[2]});
    }
    addAttributes(mesh, s, random, true);
    EXPECT_EQ(codecOf(expectRoundTrip({mesh, mesh}, s)), PageCodec::kFront);
}

TEST(PageCodec, saysSharedBordersOnce) {
    Random random(23);
    for (const PageSettings& s : kSettings) {
        // Two halves of a sheet, in one page and in two.
        const Mesh whole = makeSheet(60, 60, s, random);
        std::vector<Mesh> halves(2);
        for (int half = 0; half < 2; ++half) {
            std::vector<uint32_t> number(whole.vertexCount(), ~0u);
            for (size_t i = 0; i < whole.triangleCount(); ++i) {
                if ((i < whole.triangleCount() / 2) != (half == 0)) continue;
                Triangle t = whole.triangle[i];
                for (uint32_t& v : t) {
                    if (number[v] == ~0u) {
                        number[v] = uint32_t(halves[half].vertexCount());
                        halves[half].position.push_back(whole.position[v]);
                        halves[half].normal.push_back(whole.normal[v]);
                        if (s.colours) halves[half].colour.push_back(whole.colour[v]);
                        for (int k = 0; k < s.scalar_count; ++k)
                            halves[half].scalar.push_back(
                                whole.scalar[v * size_t(s.scalar_count) + size_t(k)]);
                    }
                    v = number[v];
                }
                halves[half].triangle.push_back(t);
                halves[half].edge_class.push_back(whole.edge_class[i]);
            }
        }
        const size_t together = expectRoundTrip(halves, s).size();
        const size_t apart = encodePage(pointers({halves[0]}), s).size() +
                             encodePage(pointers({halves[1]}), s).size();
        EXPECT_LT(together + 100, apart);
        // A vertex there that carries something else is said again.
        halves[1].normal[0].x = int16_t(halves[1].normal[0].x ^ 0x4000);
        expectRoundTrip(halves, s);
    }
}

TEST(PageCodec, coarseInteriorsTakeFewerBits) {
    Random random(24);
    const PageSettings s;
    Mesh mesh = makeSheet(40, 40, s, random, 400);
    const size_t fine = expectRoundTrip({mesh}, s).size();
    for (int y = 1; y < 40; ++y)
        for (int x = 1; x < 40; ++x) {
            Vec3i& p = mesh.position[y * 41 + x];
            p = snapToShift(p, 3);
        }
    const size_t coarse = expectRoundTrip({mesh}, s).size();
    EXPECT_LT(double(coarse), double(fine) - 0.8 * 39 * 39 * 3 * 3 / 8);
}

TEST(PageCodec, sharesNoStateBetweenPages) {
    Random random(6);
    const PageSettings s;
    const std::vector<Mesh> small = {makeSphere(2, s, random)};
    const std::vector<std::byte> before = encodePage(pointers(small), s);
    encodePage(pointers({makeSoup(500, 3000, s, random)}), s);
    EXPECT_EQ(before, encodePage(pointers(small), s));
}

TEST(PageCodec, roundsNormalsToTheNearestCode) {
    for (const int bits : {4, 8, 10, 16}) {
        const int top = (1 << (bits - 1)) - 1;
        for (int x = -32767; x <= 32767; x += bits == 16 ? 1 : 7) {
            const int code = quantiseNormal(x, bits);
            EXPECT_LE(std::abs(code), top);
            EXPECT_LE(2 * std::abs(restoreNormal(code, bits) - x), 32767 / top + 1);
            EXPECT_EQ(quantiseNormal(restoreNormal(code, bits), bits), code);
            EXPECT_EQ(quantiseNormal(-x, bits), -code);
        }
    }
}

TEST(PageCodec, countsCanBePeekedAt) {
    Random random(7);
    const PageSettings s;
    const std::vector<Mesh> meshes = {makeSheet(3, 4, s, random), makeSoup(9, 2, s, random)};
    PageCounts counts;
    std::string fault;
    ASSERT_TRUE(peekPage(encodePage(pointers(meshes), s), counts, fault));
    EXPECT_EQ(counts.patches, 2u);
    EXPECT_EQ(counts.vertices, 20u + 9u);
    EXPECT_EQ(counts.triangles, 24u + 2u);
}

TEST(PageCodec, refusesMeshesThatAreNone) {
    Random random(8);
    const PageSettings s{3, false, 0, 10};
    Mesh off = makeSheet(2, 2, s, random);
    off.position[3].y += 1;
    EXPECT_THROW(encodePage(pointers({off}), s), BugError);
    Mesh wild = makeSheet(2, 2, s, random);
    wild.triangle[1][2] = 9;
    EXPECT_THROW(encodePage(pointers({wild}), s), BugError);
    Mesh bare = makeSheet(2, 2, s, random);
    bare.normal.pop_back();
    EXPECT_THROW(encodePage(pointers({bare}), s), BugError);
}

/// Decodes damaged bytes; whatever comes out must be a sane mesh.
void decodeDamaged(std::span<const std::byte> page, const PageSettings& s, size_t& rejected) {
    std::vector<Mesh> patches;
    std::string fault;
    // A copy of exact size on the heap, so that the address sanitizer sees any overread.
    const std::vector<std::byte> exact(page.begin(), page.end());
    if (!decodePage(exact, s, patches, fault)) {
        EXPECT_FALSE(fault.empty());
        ++rejected;
        return;
    }
    for (const Mesh& mesh : patches) {
        EXPECT_EQ(mesh.normal.size(), mesh.vertexCount());
        EXPECT_EQ(mesh.edge_class.size(), mesh.triangleCount());
        EXPECT_EQ(mesh.colour.size(), s.colours ? mesh.vertexCount() : 0);
        EXPECT_EQ(mesh.scalar.size(), mesh.vertexCount() * size_t(s.scalar_count));
        for (const Triangle& t : mesh.triangle)
            for (const uint32_t v : t) EXPECT_LT(v, mesh.vertexCount());
        for (const Vec3i& p : mesh.position)
            EXPECT_TRUE(p.x >= 0 && p.y >= 0 && p.z >= 0 && p.x <= kLatticeMax &&
                        p.y <= kLatticeMax && p.z <= kLatticeMax);
    }
}

TEST(PageCodec, survivesEveryTruncationAndFlippedBits) {
    Random random(9);
    for (const PageCodec codec : kCodecs)
        for (const PageSettings& s : kSettings) {
            const std::vector<Mesh> meshes = {makeSheet(8, 9, s, random), Mesh{},
                                              makeSoup(30, 40, s, random),
                                              makeSphere(2, s, random)};
            const std::vector<std::byte> page = encodePage(pointers(meshes), s, codec);
            size_t rejected = 0;
            for (size_t length = 0; length < page.size(); ++length)
                decodeDamaged(std::span(page).first(length), s, rejected);
            EXPECT_EQ(rejected, page.size());
            for (int i = 0; i < 2000; ++i) {
                std::vector<std::byte> flipped = page;
                // Half of them near the start, where the counts are.
                const auto range =
                    uint32_t(i % 2 ? page.size() : std::min<size_t>(page.size(), 80));
                for (uint32_t k = 1 + below(random, 3); k > 0; --k)
                    flipped[below(random, range)] ^= std::byte(1u << below(random, 8));
                decodeDamaged(flipped, s, rejected);
            }
        }
}

TEST(PageCodec, namesTheFault) {
    Random random(10);
    const PageSettings s;
    std::vector<std::byte> page = encodePage(pointers({makeSheet(3, 3, s, random)}), s);
    std::vector<Mesh> patches;
    std::string fault;
    const auto faultOf = [&](std::span<const std::byte> bytes, const PageSettings& settings) {
        EXPECT_FALSE(decodePage(bytes, settings, patches, fault));
        return fault;
    };
    EXPECT_EQ(faultOf(std::span(page).first(3), s), "its header is cut short");
    EXPECT_EQ(faultOf(std::span(page).first(page.size() - 1), s),
              "its compressed part does not end with the page");
    PageSettings coloured = s;
    coloured.colours = true;
    EXPECT_EQ(faultOf(page, coloured), "its attributes are not the model's");
    PageSettings coarse = s;
    coarse.shift = 2;
    EXPECT_EQ(faultOf(page, coarse), "its lattice is finer than the model's");
    page[0] = std::byte(77);
    EXPECT_EQ(faultOf(page, s), "its codec 77 is unknown to this version");
    page[1] = std::byte(128);
    EXPECT_EQ(faultOf(page, s), "its header is not one this version knows");
}

}  // namespace
}  // namespace pietra
