#include "audit/picture_compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>

#include "audit/distance_transform.h"
#include "base/error.h"
#include "base/parallel.h"

namespace pietra {
namespace {

constexpr float kNothing = std::numeric_limits<float>::infinity();
constexpr size_t kRowGrain = 16;

/// A picture's depths, with what lies outside.
class DepthField {
public:
    explicit DepthField(const Picture& picture) : picture_(picture) {}
    int width() const { return picture_.size.width; }
    int height() const { return picture_.size.height; }
    bool inside(int x, int y) const { return x >= 0 && y >= 0 && x < width() && y < height(); }
    float operator()(int x, int y) const {
        return inside(x, y) ? picture_.depth[picture_.index(x, y)] : kNothing;
    }
    bool covered(int x, int y) const { return (*this)(x, y) != kNothing; }
    float focal() const { return float(picture_.focal_px); }
    /// Through the pixel's centre, of depth 1.
    Vec3f ray(int x, int y) const {
        return {(float(x) + 0.5f - 0.5f * float(width())) / focal(),
                (float(y) + 0.5f - 0.5f * float(height())) / focal(), 1};
    }

    /// Whether pixel (x, y) is nearer than its neighbour in direction (dx, dy) by a step of more
    /// than `step_px`. The neighbour is in the picture.
    bool steps(int x, int y, int dx, int dy, float step_px) const {
        const float z = (*this)(x, y), neighbour = (*this)(x + dx, y + dy);
        return z != kNothing && neighbour - z > step_px * z / focal();
    }

    /// The same, against the straight continuations too: it hides what the neighbour shows.
    bool hides(int x, int y, int dx, int dy, float step_px) const {
        if (!steps(x, y, dx, dy, step_px)) return false;
        const float z = (*this)(x, y), neighbour = (*this)(x + dx, y + dy);
        if (neighbour == kNothing) return true;
        const float limit = step_px * z / focal();
        // On a plane 1 / depth is linear in the picture: continue the near surface to the
        // neighbour and the far one to the pixel.
        const float before = (*this)(x - dx, y - dy), after = (*this)(x + 2 * dx, y + 2 * dy);
        if (before != kNothing) {
            const float continued = 2 / z - 1 / before;
            if (continued <= 0 || neighbour - 1 / continued <= limit) return false;
        }
        if (after != kNothing) {
            const float continued = 2 / neighbour - 1 / after;
            if (1 / continued - z <= limit) return false;
        }
        return true;
    }

private:
    const Picture& picture_;
};

template <class Body>
void forEachRow(const PictureSize& size, const Body& body) {
    parallelForSlices(size_t(size.height), kRowGrain, [&](size_t begin, size_t end) {
        for (size_t y = begin; y < end; ++y) body(int(y));
    });
}

using Mask = std::vector<uint8_t>;

Mask coverage(const Picture& picture) {
    Mask mask(picture.pixelCount());
    for (size_t i = 0; i < mask.size(); ++i) mask[i] = picture.depth[i] != kNothing;
    return mask;
}

using EdgeTest = bool (DepthField::*)(int x, int y, int dx, int dy, float step_px) const;

/// Pixels with such an edge to one of their neighbours.
Mask edges(const Picture& picture, EdgeTest test, float step_px) {
    const DepthField depth(picture);
    Mask mask(picture.pixelCount());
    forEachRow(picture.size, [&](int y) {
        for (int x = 0; x < picture.size.width; ++x) {
            bool edge = false;
            for (const auto [dx, dy] : {std::array{1, 0}, {-1, 0}, {0, 1}, {0, -1}})
                edge =
                    edge || (depth.inside(x + dx, y + dy) && (depth.*test)(x, y, dx, dy, step_px));
            mask[picture.index(x, y)] = edge;
        }
    });
    return mask;
}

/// Adds the distances of the pixels of `from` to the nearest of `to`.
void addDistances(const Mask& from, const Mask& to, const PictureSize& size,
                  std::vector<double>& distances) {
    const std::vector<int32_t> squared = squaredDistances(to, size);
    for (size_t i = 0; i < from.size(); ++i)
        if (from[i] != 0) distances.push_back(std::sqrt(double(squared[i])));
}

template <class T>
Spread spreadOf(std::vector<T>& values) {
    Spread spread;
    spread.count = values.size();
    if (values.empty()) return spread;
    const size_t rank = (values.size() * 99 + 99) / 100 - 1;
    std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(rank), values.end());
    spread.p99 = double(values[rank]);
    spread.max = double(*std::max_element(values.begin() + std::ptrdiff_t(rank), values.end()));
    double sum = 0;
    for (const T value : values) sum += double(value);
    spread.mean = sum / double(values.size());
    return spread;
}

/// Squared distance of the origin to a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
float squaredDistanceToTriangle(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
    const Vec3f ab = b - a, ac = c - a;
    const float d1 = -glm::dot(ab, a), d2 = -glm::dot(ac, a);
    const auto squared = [](const Vec3f& v) { return glm::dot(v, v); };
    if (d1 <= 0 && d2 <= 0) return squared(a);
    const float d3 = -glm::dot(ab, b), d4 = -glm::dot(ac, b);
    if (d3 >= 0 && d4 <= d3) return squared(b);
    const float vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return squared(a + ab * (d1 / (d1 - d3)));
    const float d5 = -glm::dot(ab, c), d6 = -glm::dot(ac, c);
    if (d6 >= 0 && d5 <= d6) return squared(c);
    const float vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return squared(a + ac * (d2 / (d2 - d6)));
    const float va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 >= d3 && d5 >= d6)
        return squared(b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))));
    const Vec3f normal = glm::cross(ab, ac);
    const float along = glm::dot(normal, a);
    return along * along / squared(normal);
}

/// The other picture's surface around pixel (x, y), in pixels, seen from a point at depth `z`
/// there.
class LocalSurface {
public:
    LocalSurface(const DepthField& depth, int x, int y, float z)
        : depth_(depth), x_(x), y_(y), scale_(depth.focal() / z), ray_(depth.ray(x, y)), z_(z) {}

    float squaredDistance() const {
        const Vec3f along = point(x_, y_);
        float best = glm::dot(along, along);
        // Rings of cells outwards; a cell of the next ring is at least `ring` pixels away.
        for (int ring = 0; ring < kDepthRadius && best > float(ring * ring); ++ring)
            for (int j = -ring - 1; j <= ring; ++j)
                for (int i = -ring - 1; i <= ring; ++i)
                    if (std::max({i, -i - 1, j, -j - 1}) == ring)
                        best = std::min(best, squaredDistanceToCell(x_ + i, y_ + j));
        return best;
    }

private:
    Vec3f point(int x, int y) const {
        // As differences of rays and of depths: positions would lose the digits that matter.
        const float depth = depth_(x, y);
        return ((depth_.ray(x, y) - ray_) * depth + ray_ * (depth - z_)) * scale_;
    }
    bool joined(int x0, int y0, int x1, int y1) const {
        return !depth_.hides(x0, y0, x1 - x0, y1 - y0, kWeakStep) &&
               !depth_.hides(x1, y1, x0 - x1, y0 - y1, kWeakStep);
    }
    /// The cell between pixels (x, y) and (x+1, y+1): four points, and two triangles where joined.
    float squaredDistanceToCell(int x, int y) const {
        float best = std::numeric_limits<float>::max();
        for (int j = 0; j < 2; ++j)
            for (int i = 0; i < 2; ++i)
                if (depth_.covered(x + i, y + j)) {
                    const Vec3f p = point(x + i, y + j);
                    best = std::min(best, glm::dot(p, p));
                }
        const auto triangle = [&](int ax, int ay, int bx, int by) {
            // (x, y), one of the other diagonal's ends between, and (x+1, y+1).
            if (!depth_.covered(x, y) || !depth_.covered(ax, ay) || !depth_.covered(bx, by)) return;
            if (!joined(x, y, ax, ay) || !joined(ax, ay, bx, by)) return;
            best = std::min(best,
                            squaredDistanceToTriangle(point(x, y), point(ax, ay), point(bx, by)));
        };
        triangle(x + 1, y, x + 1, y + 1);
        triangle(x, y + 1, x + 1, y + 1);
        return best;
    }

    const DepthField& depth_;
    int x_, y_;
    float scale_;
    Vec3f ray_;
    float z_;
};

/// Pixels where the surface around is not known: at an edge of either picture, on either side of
/// it, and along the border.
Mask surfaceUnknown(const Mask& edges_a, const Mask& edges_b, const PictureSize& size) {
    const int width = size.width, height = size.height;
    Mask mask(edges_a.size(), 1);
    forEachRow(size, [&](int y) {
        if (y < kDepthRadius || y >= height - kDepthRadius) return;
        for (int x = kDepthRadius; x < width - kDepthRadius; ++x) {
            const size_t at = size_t(y) * size_t(width) + size_t(x);
            mask[at] = 0;
            for (const size_t i : {at, at - 1, at + 1, at - size_t(width), at + size_t(width)})
                mask[at] |= uint8_t(edges_a[i] | edges_b[i]);
        }
    });
    return mask;
}

/// For each pixel covered in both and not to `skip`, the distance of a's point to b's surface.
void addDepthErrors(const Picture& a, const Picture& b, const Mask& skip,
                    std::vector<float>& errors) {
    const DepthField other(b);
    const size_t first = errors.size();
    errors.resize(first + a.pixelCount(), -1);
    forEachRow(a.size, [&](int y) {
        for (int x = 0; x < a.size.width; ++x) {
            const size_t i = a.index(x, y);
            if (skip[i] != 0 || a.depth[i] == kNothing || b.depth[i] == kNothing) continue;
            errors[first + i] =
                a.depth[i] == b.depth[i]
                    ? 0
                    : std::sqrt(LocalSurface(other, x, y, a.depth[i]).squaredDistance());
        }
    });
    errors.erase(std::remove(errors.begin() + std::ptrdiff_t(first), errors.end(), -1.0f),
                 errors.end());
}

void compareCoverage(const Picture& a, const Picture& b, PictureDifference& result) {
    const Mask mask_a = coverage(a), mask_b = coverage(b);
    Mask only_a(mask_a.size()), only_b(mask_a.size());
    for (size_t i = 0; i < mask_a.size(); ++i) {
        only_a[i] = mask_a[i] & ~mask_b[i] & 1;
        only_b[i] = mask_b[i] & ~mask_a[i] & 1;
    }
    const auto count = [](const Mask& mask) {
        return uint64_t(std::count(mask.begin(), mask.end(), 1));
    };
    result.covered_a = count(mask_a);
    result.covered_b = count(mask_b);
    result.only_a = count(only_a);
    result.only_b = count(only_b);
    std::vector<double> distances;
    if (result.only_a != 0) addDistances(only_a, mask_b, a.size, distances);
    if (result.only_b != 0) addDistances(only_b, mask_a, a.size, distances);
    result.coverage_px = spreadOf(distances);
}

/// The farther side of a slit of at most `width` pixels, across or upright, that holds pixel
/// (x, y): the nearest such; +inf without any.
float sideOfSlit(const DepthField& depth, int x, int y, int width) {
    float best = kNothing;
    for (int before = 1; before <= width; ++before)
        for (int after = 1; before + after - 1 <= width; ++after)
            best = std::min({best, std::max(depth(x - before, y), depth(x + after, y)),
                             std::max(depth(x, y - before), depth(x, y + after))});
    return best;
}

/// The depths of `picture` without its hairlines, which `other` shows closed; counts their pixels.
Picture closeHairlines(const Picture& picture, const Picture& other, int width, float step_px,
                       uint64_t& hairlines) {
    Picture closed{picture.size, {}, picture.depth, picture.focal_px};
    const DepthField depth(picture);
    std::atomic<uint64_t> count{0};
    forEachRow(picture.size, [&](int y) {
        for (int x = 0; x < picture.size.width; ++x) {
            const size_t i = picture.index(x, y);
            const float limit = 1 + step_px / depth.focal();
            if (!(picture.depth[i] > other.depth[i] * limit)) continue;
            const float side = sideOfSlit(depth, x, y, width);
            if (!(picture.depth[i] > side * limit && other.depth[i] <= side * limit)) continue;
            closed.depth[i] = side;
            ++count;
        }
    });
    hairlines = count;
    return closed;
}

void compareEdgesAndDepth(const Picture& open_a, const Picture& open_b, int supersampled,
                          PictureDifference& result) {
    const float weak = kWeakStep * float(supersampled), strong = kStrongStep * float(supersampled);
    const int width = kHairline * supersampled;
    const Picture a = closeHairlines(open_a, open_b, width, weak, result.hairline_a);
    const Picture b = closeHairlines(open_b, open_a, width, weak, result.hairline_b);
    const auto hides = &DepthField::hides, steps = &DepthField::steps;
    std::vector<double> distances;
    addDistances(edges(a, hides, strong), edges(b, steps, weak), a.size, distances);
    addDistances(edges(b, hides, strong), edges(a, steps, weak), a.size, distances);
    result.edge_px = spreadOf(distances);

    const Mask skip = surfaceUnknown(edges(a, hides, weak), edges(b, hides, weak), a.size);
    std::vector<float> errors;
    addDepthErrors(a, b, skip, errors);
    addDepthErrors(b, a, skip, errors);
    result.depth_px = spreadOf(errors);
}

void divide(Spread& spread, double by) {
    spread.mean /= by;
    spread.p99 /= by;
    spread.max /= by;
}

Spread compareShade(const Picture& a, const Picture& b, bool has_depth) {
    std::vector<uint8_t> difference;
    difference.reserve(a.pixelCount());
    for (size_t i = 0; i < a.pixelCount(); ++i) {
        if (has_depth && (a.depth[i] == kNothing || b.depth[i] == kNothing)) continue;
        const Rgba8 p = a.colour[i], q = b.colour[i];
        difference.push_back(
            uint8_t(std::max({std::abs(p.r - q.r), std::abs(p.g - q.g), std::abs(p.b - q.b)})));
    }
    return spreadOf(difference);
}

void checkComparable(const Picture& a, const Picture& b) {
    if (a.size.width != b.size.width || a.size.height != b.size.height)
        throw UsageError(fmt::format("the pictures differ in size: {}x{} and {}x{}", a.size.width,
                                     a.size.height, b.size.width, b.size.height));
    if (a.hasDepth() && b.hasDepth() && std::abs(a.focal_px / b.focal_px - 1) > 1e-6)
        throw UsageError(fmt::format("the pictures differ in focal length: {} and {} pixels",
                                     a.focal_px, b.focal_px));
}

}  // namespace

double PictureDifference::largestPx() const {
    return std::max({coverage_px.max, edge_px.max, depth_px.max});
}

PictureDifference compare(const Picture& a, const Picture& b, int supersampled) {
    checkComparable(a, b);
    PictureDifference result;
    result.has_depth = a.hasDepth() && b.hasDepth();
    result.pixels = a.pixelCount();
    result.shade = compareShade(a, b, result.has_depth);
    if (!result.has_depth) return result;
    compareCoverage(a, b, result);
    compareEdgesAndDepth(a, b, supersampled, result);
    for (Spread* spread : {&result.coverage_px, &result.edge_px, &result.depth_px})
        divide(*spread, supersampled);
    return result;
}

}  // namespace pietra
