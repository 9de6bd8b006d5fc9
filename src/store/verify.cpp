#include "store/verify.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"

namespace pietra {

namespace {

// Spheres are floats: a point may be outside by the rounding of its centre and radius.
constexpr double kRelativeSlack = 1e-6;
constexpr double kCosineSlack = 1e-5;

double slack(const Sphere& sphere) {
    const Vec3d c = glm::abs(Vec3d(sphere.centre));
    return kRelativeSlack * (1 + c.x + c.y + c.z + std::abs(double(sphere.radius)));
}

bool holds(const Sphere& sphere, const Vec3i& point) {
    const Vec3d d = Vec3d(point) - Vec3d(sphere.centre);
    const double reach = sphere.radius + slack(sphere);
    return sphere.radius >= 0 && glm::dot(d, d) <= reach * reach;
}

bool holds(const Sphere& outer, const Sphere& inner) {
    if (inner.radius < 0) return true;
    if (outer.radius < 0) return false;
    const double distance = glm::length(Vec3d(inner.centre) - Vec3d(outer.centre));
    return distance + inner.radius <= outer.radius + slack(outer) + slack(inner);
}

bool holds(const NormalCone& cone, const Mesh& patch) {
    if (cone.cos_angle <= -1) return true;
    for (const Triangle& t : patch.triangle) {
        const Vec3d a(patch.position[t[0]]), b(patch.position[t[1]]), c(patch.position[t[2]]);
        const Vec3d normal = glm::cross(b - a, c - a);
        const double length = glm::length(normal);
        if (length > 0 &&
            glm::dot(normal, Vec3d(cone.axis)) < (cone.cos_angle - kCosineSlack) * length)
            return false;
    }
    return true;
}

/// Every edge is an ordinary one, and no two triangles run along one in the same direction.
bool mayBeClosed(const Mesh& patch) {
    if (std::any_of(patch.edge_class.begin(), patch.edge_class.end(),
                    [](uint8_t classes) { return classes != 0; }))
        return false;
    std::vector<uint64_t> directed;
    directed.reserve(3 * patch.triangleCount());
    for (const Triangle& t : patch.triangle)
        for (size_t k = 0; k < 3; ++k) directed.push_back(uint64_t(t[k]) << 32 | t[(k + 1) % 3]);
    std::sort(directed.begin(), directed.end());
    return std::adjacent_find(directed.begin(), directed.end()) == directed.end();
}

bool sameRefinement(const Node& a, const Node& b) {
    return a.error == b.error && a.face_size == b.face_size &&
           a.saturated.centre == b.saturated.centre && a.saturated.radius == b.saturated.radius;
}

/// What was found wrong with a node, as bits.
enum Finding : uint8_t {
    kBadParents = 1,
    kPatchOutside = 2,
    kBoundsOutside = 4,
    kChildOutside = 8,
    kErrorBelowChild = 16,
    kGroupDiffers = 32,
    kConeTooNarrow = 64,
    kFalselyClosed = 128,
};

constexpr std::array<std::pair<Finding, const char*>, 8> kFindingTexts = {{
    {kBadParents, "is not the child of exactly one node of the level above"},
    {kPatchOutside, "has vertices outside of its bounds"},
    {kBoundsOutside, "has bounds that stick out of its saturated sphere"},
    {kChildOutside, "has a child whose saturated sphere sticks out of its own"},
    {kErrorBelowChild, "has an error or a face size below that of a child"},
    {kGroupDiffers, "differs in error, face size or saturated sphere from others of its group"},
    {kConeTooNarrow, "has triangles whose normals lie outside of its cone"},
    {kFalselyClosed, "says that it is closed, but has a border, a fold or a triangle turned over"},
}};

void checkForest(std::span<const Node> nodes, std::vector<uint8_t>& found) {
    std::vector<uint8_t> parents(nodes.size(), 0);
    for (const Node& node : nodes)
        node.forEachChild([&](NodeIndex child) { parents[child] += parents[child] < 2; });
    for (size_t i = 0; i < nodes.size(); ++i)
        if (parents[i] != (nodes[i].level == 0 ? 0 : 1)) found[i] |= kBadParents;
}

void checkSaturation(std::span<const Node> nodes, std::vector<uint8_t>& found) {
    parallelForSlices(nodes.size(), 4096, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const Node& node = nodes[i];
            if (!holds(node.saturated, node.bounds)) found[i] |= kBoundsOutside;
            node.forEachChild([&](NodeIndex c) {
                const Node& child = nodes[c];
                if (!holds(node.saturated, child.is_joint ? child.bounds : child.saturated))
                    found[i] |= kChildOutside;
                const bool monotone =
                    node.error >= child.error && node.face_size >= child.face_size;
                if (!child.is_joint && !monotone) found[i] |= kErrorBelowChild;
            });
            if (!(node.error >= 0) || !(node.face_size >= 0)) found[i] |= kErrorBelowChild;
        }
    });
}

void checkGroups(std::span<const Node> nodes, std::vector<uint8_t>& found) {
    std::vector<NodeIndex> order(nodes.size());
    for (NodeIndex i = 0; i < nodes.size(); ++i) order[i] = i;
    std::sort(order.begin(), order.end(), [&](NodeIndex a, NodeIndex b) {
        return nodes[a].group != nodes[b].group ? nodes[a].group < nodes[b].group : a < b;
    });
    for (size_t i = 1; i < order.size(); ++i) {
        const Node &before = nodes[order[i - 1]], &node = nodes[order[i]];
        if (node.group == before.group && !sameRefinement(before, node))
            found[order[i]] |= kGroupDiffers;
    }
}

/// Decodes a page and compares each patch with its node; returns what is wrong with the page
/// itself.
std::string checkPage(const ModelReader& model, uint32_t page, std::vector<std::byte>& bytes,
                      std::vector<Mesh>& patches, std::vector<uint8_t>& found) {
    std::string fault;
    if (!model.tryReadPage(page, bytes, fault) || !model.tryDecode(page, bytes, patches, fault))
        return fault;
    for (size_t i = 0; i < patches.size(); ++i) {
        const NodeIndex index = model.page(page).first_node + NodeIndex(i);
        const Node& node = model.nodes()[index];
        for (const Vec3i& p : patches[i].position)
            if (!holds(node.bounds, p)) found[index] |= kPatchOutside;
        if (!holds(node.cone, patches[i])) found[index] |= kConeTooNarrow;
        if (node.closed && !mayBeClosed(patches[i])) found[index] |= kFalselyClosed;
    }
    return {};
}

void countFindings(const ModelReader& model, const std::vector<std::string>& page_faults,
                   const std::vector<uint8_t>& found, VerifyReport& report) {
    const auto tell = [&](const std::string& text) {
        if (report.faults.size() < kMaxFaultTexts)
            report.faults.push_back(fmt::format("{}: {}", model.path(), text));
    };
    for (uint32_t page = 0; page < page_faults.size(); ++page) {
        if (page_faults[page].empty()) continue;
        ++report.pages.bad;
        tell(fmt::format("byte {}: {}", model.page(page).offset, page_faults[page]));
    }
    for (size_t i = 0; i < found.size(); ++i) {
        for (const auto& [finding, text] : kFindingTexts)
            if ((found[i] & finding) != 0) tell(fmt::format("node {} {}", i, text));
        report.nodes.bad += (found[i] & kBadParents) != 0;
        report.bounds.not_nested +=
            (found[i] & (kPatchOutside | kBoundsOutside | kChildOutside)) != 0;
        report.errors.not_monotone += (found[i] & (kErrorBelowChild | kGroupDiffers)) != 0;
        report.cones.bad += (found[i] & (kConeTooNarrow | kFalselyClosed)) != 0;
    }
}

}  // namespace

VerifyReport verifyModel(const ModelReader& model, Progress& progress,
                         const PageCheck& check_page) {
    const std::span<const Node> nodes = model.nodes();
    std::vector<uint8_t> found(nodes.size(), 0);
    checkForest(nodes, found);
    checkSaturation(nodes, found);
    checkGroups(nodes, found);

    struct Scratch {
        std::vector<std::byte> bytes;
        std::vector<Mesh> patches;
    };
    PerThread<Scratch> scratch;
    std::vector<std::string> page_faults(model.pageCount());
    parallelFor(model.pageCount(), [&](size_t page) {
        Scratch& local = scratch.local();
        std::string& fault = page_faults[page];
        if (!check_page)
            fault = checkPage(model, uint32_t(page), local.bytes, local.patches, found);
        else if (model.tryReadPage(uint32_t(page), local.bytes, fault))
            fault = check_page(uint32_t(page));
        progress.tick();
    });

    VerifyReport report;
    report.pages.checked = model.pageCount();
    report.nodes.checked = report.bounds.checked = report.errors.checked = report.cones.checked =
        nodes.size();
    countFindings(model, page_faults, found, report);
    return report;
}

}  // namespace pietra
