#include "runtime/eye_side.h"

#include <gtest/gtest.h>

#include <random>

namespace pietra {
namespace {

/// A box's sides as two triangles each, outward: 4 and 5 are the lower and the upper end.
Mesh boxSide(int side, const Vec3i& low, const Vec3i& high) {
    constexpr int kCorner[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                   {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    Mesh mesh;
    for (const int c : kCorner[side])
        mesh.position.push_back(
            {c & 1 ? high.x : low.x, c & 2 ? high.y : low.y, c & 4 ? high.z : low.z});
    mesh.triangle = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

Mesh sides(std::initializer_list<int> list, const Vec3i& low, const Vec3i& high) {
    Mesh mesh;
    for (const int side : list) {
        const auto first = uint32_t(mesh.vertexCount());
        const Mesh one = boxSide(side, low, high);
        mesh.position.insert(mesh.position.end(), one.position.begin(), one.position.end());
        for (const Triangle& t : one.triangle)
            mesh.triangle.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
    return mesh;
}

struct Part {
    bool closed;
    Mesh mesh;
};

EyeSide sideOf(const Vec3d& eye, const std::vector<Part>& parts, float error = 0) {
    EyeSide side(eye);
    for (const Part& part : parts) {
        Node node;
        node.closed = part.closed;
        node.error = error;
        EyeSide one(eye);
        one.add(node, part.mesh);
        side.add(one);
    }
    return side;
}

bool mayBeInside(const Vec3d& eye, const std::vector<Part>& parts, float error = 0) {
    return sideOf(eye, parts, error).mayBeInside();
}

const Vec3i kLow(0, 0, 0), kHigh(100, 100, 1000);  // a long box

TEST(EyeSide, KnowsClosedPartsFromWithinAndWithout) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> at(-500, 1500);
    const std::vector<Part> parts = {{true, sides({0, 1, 4}, kLow, kHigh)},
                                     {true, sides({2, 3, 5}, kLow, kHigh)}};
    for (int round = 0; round < 2000; ++round) {
        const Vec3d eye = round % 2 ? Vec3d(at(random), at(random), at(random))
                                    : Vec3d(0.1, 0.1, 1) * (at(random) * 0.5 + 250);
        const bool inside = glm::all(glm::greaterThan(eye, Vec3d(kLow))) &&
                            glm::all(glm::lessThan(eye, Vec3d(kHigh)));
        EXPECT_EQ(mayBeInside(eye, parts), inside);
    }
    EXPECT_TRUE(mayBeInside({50, 50, -5}, parts, 6));
    EXPECT_FALSE(mayBeInside({50, 50, -500}, parts, 6));
}

/// Most of a closed part lies in nodes that hold something open too: from within, what closed nodes
/// hold of it is seen under next to no angle.
TEST(EyeSide, DoesNotTakeAPartOfAClosedPartForAllOfIt) {
    const Mesh sheet = sides({0}, Vec3i(-10, 0, 0), kHigh);
    const Part end{true, sides({5}, kLow, kHigh)}, rest{false, sides({0, 1, 2, 3, 4}, kLow, kHigh)};
    const Part ball{true, sides({0, 1, 2, 3, 4, 5}, Vec3i(300), Vec3i(400))};
    const Vec3d within(50, 50, 100), without(-400, 50, 3000);
    for (const std::vector<Part>& parts :
         {std::vector{end, rest, Part{false, sheet}},
          {ball, end, rest},
          // All of it in such nodes at this level, whatever finer ones hold.
          {ball, rest, Part{false, end.mesh}}}) {
        EXPECT_TRUE(mayBeInside(within, parts));
        EXPECT_FALSE(mayBeInside(without, parts));
    }
    // Nor does what is open hide that the eye is within a closed part.
    EXPECT_TRUE(mayBeInside({350, 350, 350}, {ball, Part{false, sheet}}));
}

TEST(EyeSide, DecidesForOtherEyesOnThisSideOnly) {
    std::mt19937 random(2);
    std::uniform_real_distribution<double> at(-100, 300);
    const std::vector<Part> parts = {{true, sides({0, 1, 2, 3, 4, 5}, Vec3i(0), Vec3i(200))}};
    const auto distance = [](const Vec3d& p) {  // to the surface
        const Vec3d out = glm::max(glm::max(p - 200.0, -p), 0.0), in = glm::min(p, 200.0 - p);
        return std::max(glm::length(out), std::min({in.x, in.y, in.z}));
    };
    int decided = 0;
    for (int round = 0; round < 20000; ++round) {
        const float error = float(round % 3) * 5;
        const Vec3d eye(at(random), at(random), at(random));
        const Vec3d other = eye + 0.2 * Vec3d(at(random) - 100, at(random) - 100, at(random) - 100);
        const EyeSide side = sideOf(eye, parts, error);
        // What is finer may be so far from these triangles.
        const double within = distance(eye) - 2 * error;
        ASSERT_EQ(side.decides(other), glm::distance(eye, other) < within);
        if (!side.decides(other)) continue;
        ASSERT_EQ(mayBeInside(other, parts), side.mayBeInside());
        ++decided;
    }
    EXPECT_GT(decided, 3000);
}

TEST(EyeSide, AsksNobodyOutsideOfAllClosedParts) {
    ModelInfo info;
    info.bounds = {kLow, kHigh};
    std::vector<Node> nodes(3);
    nodes[1].error = 7;
    EXPECT_FALSE(holds(closedPartsWithin(info, nodes), {50, 50, 50}));
    nodes[2].closed = true;
    const Box3d box = closedPartsWithin(info, nodes);
    EXPECT_TRUE(holds(box, {50, 50, 50}));
    EXPECT_TRUE(holds(box, {50, 50, -7.5}));
    EXPECT_FALSE(holds(box, {50, 50, -8.5}));
}

}  // namespace
}  // namespace pietra
