#include "io/synth_shapes.h"

#include <algorithm>
#include <cmath>

#include "io/colour_scale.h"
#include "io/noise.h"

namespace pietra {

namespace {

/// The last i of [0, count) with start(i) <= value; start ascends and start(0) <= value.
template <class Start>
uint64_t findInterval(uint64_t count, uint64_t value, Start&& start) {
    uint64_t low = 0, high = count;
    while (high - low > 1) {
        const uint64_t middle = low + (high - low) / 2;
        if (start(middle) <= value)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/// An octahedron as a sphere: its edges cut into n, and around the equator a belt of `belt` bands
/// of squares between its halves. Ring k of 0 .. 2n + belt, from the north pole to the south pole,
/// has four times as many vertices as there are rings to the next pole, at most 4n; the poles are
/// one. Vertices are numbered ring by ring, eastward, triangles band by band.
class RingSphere {
public:
    /// Without a belt.
    static RingSphere regular(uint64_t triangles) {
        return {std::max<uint64_t>(1, uint64_t(std::sqrt(double(triangles) / 8) + 0.5)), 0};
    }
    /// The nearest number of triangles that a belt of at most half of n allows.
    static RingSphere nearest(uint64_t triangles) {
        const uint64_t eighths = std::max<uint64_t>(1, triangles / 8 + triangles % 8 / 4);
        const auto most = uint64_t(std::sqrt(double(eighths)));
        RingSphere best(most, 0);
        uint64_t least = kNoDistance;
        for (uint64_t n = most; n > 0 && least > 0 && 3 * n * n >= 2 * eighths; --n) {
            const uint64_t rows = (eighths + n / 2) / n;
            const uint64_t distance = std::max(rows * n, eighths) - std::min(rows * n, eighths);
            if (distance < least) {
                least = distance;
                best = {n, rows - n};
            }
        }
        return best;
    }

    uint64_t n() const { return n_; }
    uint64_t vertexCount() const { return 4 * n_ * (n_ + belt_) + 2; }
    uint64_t triangleCount() const { return 8 * n_ * (n_ + belt_); }

    /// Writes the unit directions of vertices first, first + 1, ... to `out`.
    void makeDirections(uint64_t first, std::span<Vec3d> out) const {
        uint64_t ring = findInterval(bands() + 1, first, [&](uint64_t k) { return ringStart(k); });
        uint64_t i = first - ringStart(ring);
        for (Vec3d& direction : out) {
            direction = directionOf(ring, i);
            if (++i == ringSize(ring)) {
                ++ring;
                i = 0;
            }
        }
    }

    void makeTriangles(uint64_t first, std::span<std::array<uint64_t, 3>> out) const {
        uint64_t band = findInterval(bands(), first, [&](uint64_t b) { return bandStart(b); });
        uint64_t i = first - bandStart(band);
        for (auto& triangle : out) {
            triangle = triangleOf(band, i);
            if (bandStart(band) + ++i == bandStart(band + 1)) {
                ++band;
                i = 0;
            }
        }
    }

private:
    static constexpr uint64_t kNoDistance = ~uint64_t(0);

    RingSphere(uint64_t n, uint64_t belt) : n_(n), belt_(belt) {}

    uint64_t bands() const { return 2 * n_ + belt_; }
    /// Edges in a quarter of ring k.
    uint64_t quarter(uint64_t ring) const { return std::min({ring, n_, bands() - ring}); }
    uint64_t ringSize(uint64_t ring) const { return std::max<uint64_t>(1, 4 * quarter(ring)); }
    uint64_t ringStart(uint64_t ring) const {
        if (ring == 0) return 0;
        if (ring <= n_) return 1 + 2 * ring * (ring - 1);
        if (ring <= n_ + belt_) return ringStart(n_) + 4 * n_ * (ring - n_);
        const uint64_t left = bands() - ring;
        return vertexCount() - (1 + 2 * left * (left + 1));
    }
    /// Number of the first triangle between ring `band` and the next.
    uint64_t bandStart(uint64_t band) const {
        if (band <= n_) return 4 * band * band;
        if (band <= n_ + belt_) return bandStart(n_) + 8 * n_ * (band - n_);
        const uint64_t left = bands() - band;
        return triangleCount() - 4 * left * left;
    }

    Vec3d directionOf(uint64_t ring, uint64_t i) const {
        const uint64_t edges = quarter(ring), to_pole = std::min(ring, bands() - ring);
        const SinCos down = quarterTurn(double(2 * to_pole) / double(bands()));
        const double z = ring == to_pole ? down.cos : -down.cos;
        if (edges == 0) return {0, 0, z};
        const SinCos east = quarterTurn(double(i % edges) / double(edges));
        const double x = down.sin * east.cos, y = down.sin * east.sin;
        switch (i / edges) {
            case 0:
                return {x, y, z};
            case 1:
                return {-y, x, z};
            case 2:
                return {-x, -y, z};
            default:
                return {y, -x, z};
        }
    }

    std::array<uint64_t, 3> triangleOf(uint64_t band, uint64_t i) const {
        const bool north = band < n_ + belt_;
        const uint64_t above = quarter(band), below = quarter(band + 1);
        const uint64_t in_quarter = above + below;
        const uint64_t q = i / in_quarter, j = i % in_quarter / 2;
        const auto upper = [&](uint64_t k) {
            return ringStart(band) + (q * above + k) % ringSize(band);
        };
        const auto lower = [&](uint64_t k) {
            return ringStart(band + 1) + (q * below + k) % ringSize(band + 1);
        };
        const bool even = i % in_quarter % 2 == 0;
        if (north)
            return even ? std::array{upper(j), lower(j), lower(j + 1)}
                        : std::array{upper(j), lower(j + 1), upper(j + 1)};
        return even ? std::array{upper(j), lower(j), upper(j + 1)}
                    : std::array{upper(j + 1), lower(j), lower(j + 1)};
    }

    uint64_t n_, belt_;
};

class UnitSphere : public SyntheticMesh {
public:
    explicit UnitSphere(const RingSphere& rings) : rings_(rings) {}
    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() const override { return rings_.vertexCount(); }
    uint64_t triangleCount() const override { return rings_.triangleCount(); }
    void makeVertices(uint64_t first, size_t at, size_t count, VertexBatch& batch) const override {
        const auto out = std::span(batch.position).subspan(at, count);
        rings_.makeDirections(first, out);
        for (Vec3d& p : out) p = shape(p);
    }
    void makeTriangles(uint64_t first, std::span<std::array<uint64_t, 3>> out) const override {
        rings_.makeTriangles(first, out);
    }

protected:
    /// Where the vertex in this direction lies.
    virtual Vec3d shape(const Vec3d& direction) const { return direction; }
    RingSphere rings_;

private:
    AttributeSchema schema_;
};

double power(double x, int exponent) {
    double result = 1;
    for (; exponent > 0; --exponent) result *= x;
    return result;
}

/// A star-shaped body: its radius is a function of the direction from a point inside.
class Statue : public UnitSphere {
public:
    Statue(uint64_t triangles, uint64_t seed)
        : UnitSphere(RingSphere::regular(triangles)), seed_(mixBits(seed + 1)) {
        // Octaves of detail until a wave is about two triangles long: edges span pi / 2n.
        for (double f = 16; f < double(rings_.n()) / 3.2; f *= 2) ++octaves_;
    }

protected:
    Vec3d shape(const Vec3d& d) const override {
        double r = body(d) * (1 + folds(d) + marks(d));
        // A flat foot: directions that point well down end on one plane.
        if (d.z < -0.1) r = std::min(r, 0.95 / -d.z);
        return {0.62 * r * d.x, 0.52 * r * d.y, r * d.z};
    }

private:
    /// A bump of the given height around a direction; the larger the exponent, the narrower.
    static double lobe(const Vec3d& d, const Vec3d& centre, double height, int exponent) {
        return height * power(0.5 + 0.5 * glm::dot(d, centre) / std::sqrt(glm::dot(centre, centre)),
                              exponent);
    }
    double chosen(int64_t k) const { return latticeNoise(k, 0, 0, seed_); }

    double body(const Vec3d& d) const {
        double r = 0.5;
        r += lobe(d, {0.25 * chosen(1), 0.1 + 0.2 * chosen(2), 1}, 0.55, 9);   // head
        r += lobe(d, {0.1 * chosen(3), 1, 0.75 + 0.2 * chosen(4)}, 0.16, 90);  // nose
        r += lobe(d, {1, 0.15 * chosen(5), 0.05 + 0.2 * chosen(6)}, 0.5, 14);  // shoulders
        r += lobe(d, {-1, 0.15 * chosen(7), 0.05 + 0.2 * chosen(8)}, 0.5, 14);
        r += lobe(d, {0.2 * chosen(9), 0.6, -0.3 + 0.2 * chosen(10)}, 0.3, 12);  // chest
        r += lobe(d, {0, 0, -1}, 0.6, 10);                                       // plinth
        return r;
    }

    /// Drapery and hair: creases where smooth noise changes sign.
    double folds(const Vec3d& d) const {
        const Vec3d warp{valueNoise(3.0 * d, seed_ + 11), valueNoise(3.0 * d, seed_ + 12),
                         valueNoise(3.0 * d, seed_ + 13)};
        const Vec3d p = d + 0.2 * warp;
        const double wide = std::abs(valueNoise(Vec3d(9 * p.x, 9 * p.y, 3 * p.z), seed_ + 21));
        const double fine = std::abs(valueNoise(Vec3d(24 * p.x, 24 * p.y, 7 * p.z), seed_ + 22));
        return 0.035 * (0.3 - wide) + 0.012 * (0.3 - fine);
    }

    double marks(const Vec3d& d) const {
        double sum = 0, height = 0.006, frequency = 16;
        for (int k = 0; k < octaves_; ++k, frequency *= 2, height *= 0.52)
            sum += height * valueNoise(frequency * d, seed_ + 31 + uint64_t(k));
        return sum;
    }

    uint64_t seed_;
    int octaves_ = 0;
};

constexpr double kTerrainSize = 1000;
constexpr ColourStep kTerrainColours[] = {
    {-40, 62, 84, 92},    {-8, 84, 110, 96},    {0, 196, 184, 140},  {6, 112, 138, 74},
    {45, 78, 112, 58},    {85, 122, 116, 84},   {120, 116, 100, 86}, {150, 138, 130, 124},
    {165, 232, 234, 238}, {220, 250, 250, 252},
};

class Terrain : public SyntheticMesh {
public:
    Terrain(uint64_t triangles, uint64_t seed)
        : n_(std::max<uint64_t>(1, uint64_t(std::sqrt(double(triangles) / 2) + 0.5))),
          seed_(mixBits(seed + 2)) {
        schema_.colours = true;
        schema_.scalars = {"height"};
        for (double waves = 3; waves < double(n_) / 2 && octaves_ < 20; waves *= 2) ++octaves_;
    }
    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() const override { return (n_ + 1) * (n_ + 1); }
    uint64_t triangleCount() const override { return 2 * n_ * n_; }

    void makeVertices(uint64_t first, size_t at, size_t count, VertexBatch& batch) const override {
        for (size_t i = 0; i < count; ++i) {
            const uint64_t v = first + i;
            const double x = double(v % (n_ + 1)) / double(n_),
                         y = double(v / (n_ + 1)) / double(n_);
            const double z = height(x, y);
            batch.position[at + i] = {kTerrainSize * x, kTerrainSize * y, z};
            batch.colour[at + i] = colourAt(kTerrainColours, z);
            batch.scalar[at + i] = float(z);
        }
    }

    void makeTriangles(uint64_t first, std::span<std::array<uint64_t, 3>> out) const override {
        for (auto& triangle : out) {
            const uint64_t cell = first / 2;
            const uint64_t a = cell / n_ * (n_ + 1) + cell % n_, b = a + 1, c = a + n_ + 1,
                           d = c + 1;
            // The diagonal alternates, so that no direction is favoured.
            const bool falling = (cell / n_ + cell % n_) % 2 == 0;
            if (falling)
                triangle = first % 2 == 0 ? std::array{a, b, c} : std::array{b, d, c};
            else
                triangle = first % 2 == 0 ? std::array{a, b, d} : std::array{a, d, c};
            ++first;
        }
    }

private:
    /// Ridged noise whose finer octaves grow on the ridges of the coarser ones: mountains are
    /// rough, plains are smooth (after Musgrave's multifractal).
    double height(double x, double y) const {
        const double wx = x + 0.06 * valueNoise(4 * x, 4 * y, seed_ + 1);
        const double wy = y + 0.06 * valueNoise(4 * x, 4 * y, seed_ + 2);
        double sum = 20 + 45 * valueNoise(2 * wx, 2 * wy, seed_ + 3);
        double weight = std::clamp(0.4 + sum / 60, 0.1, 1.0), amplitude = 80, frequency = 4;
        for (int k = 0; k < octaves_; ++k, frequency *= 2, amplitude *= 0.5) {
            // Turned by some angle each time, or the lattice of the noise shows.
            const double u = 0.8 * wx - 0.6 * wy, v = 0.6 * wx + 0.8 * wy;
            const bool turned = k % 2 == 1;
            const double noise =
                valueNoise(frequency * (turned ? u : wx), frequency * (turned ? v : wy),
                           seed_ + 10 + uint64_t(k));
            const double ridge = (1 - std::abs(noise)) * (1 - std::abs(noise));
            sum += amplitude * weight * (ridge - 0.45);
            weight = std::clamp(weight * (0.35 + 1.1 * ridge), 0.0, 1.0);
        }
        return sum;
    }

    uint64_t n_;
    uint64_t seed_;
    int octaves_ = 0;
    AttributeSchema schema_;
};

}  // namespace

std::unique_ptr<const SyntheticMesh> makeSphere(uint64_t triangles) {
    return std::make_unique<UnitSphere>(RingSphere::nearest(triangles));
}

std::unique_ptr<const SyntheticMesh> makeStatue(uint64_t triangles, uint64_t seed) {
    return std::make_unique<Statue>(triangles, seed);
}

std::unique_ptr<const SyntheticMesh> makeTerrain(uint64_t triangles, uint64_t seed) {
    return std::make_unique<Terrain>(triangles, seed);
}

}  // namespace pietra
