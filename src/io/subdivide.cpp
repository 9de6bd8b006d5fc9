#include "io/subdivide.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/check.h"
#include "base/error.h"
#include "base/hash.h"

namespace pietra {

namespace {

using Corners = std::array<uint32_t, 3>;

/// From an edge (two vertices, either way round) to the number of the first vertex inside it. Open
/// addressing, grown by doubling; iteration is never asked for, so order is nobody's business.
class EdgeTable {
public:
    EdgeTable() : slots_(1 << 10) {}

    /// Finds the edge, or enters it with `base`.
    uint64_t findOrInsert(uint32_t a, uint32_t b, uint64_t base) {
        if (2 * count_ >= slots_.size()) grow();
        Slot& slot = slotOf(keyOf(a, b));
        if (slot.key == kEmpty) {
            slot = {keyOf(a, b), base};
            ++count_;
        }
        return slot.base;
    }
    uint64_t find(uint32_t a, uint32_t b) { return slotOf(keyOf(a, b)).base; }

private:
    static constexpr uint64_t kEmpty = std::numeric_limits<uint64_t>::max();
    struct Slot {
        uint64_t key = kEmpty;
        uint64_t base = 0;
    };
    static uint64_t keyOf(uint32_t a, uint32_t b) {
        return uint64_t(std::min(a, b)) << 32 | std::max(a, b);
    }
    Slot& slotOf(uint64_t key) {
        size_t i = mixBits(key) & (slots_.size() - 1);
        while (slots_[i].key != key && slots_[i].key != kEmpty) i = (i + 1) & (slots_.size() - 1);
        return slots_[i];
    }
    void grow() {
        std::vector<Slot> old(slots_.size() * 2);
        old.swap(slots_);
        for (const Slot& slot : old)
            if (slot.key != kEmpty) slotOf(slot.key) = slot;
    }
    std::vector<Slot> slots_;
    size_t count_ = 0;
};

/// The points of one input triangle, cut into m x m: row i of 0 .. m has i + 1 points, from corner
/// 0 to the edge between corners 1 (its first point) and 2 (its last).
struct PointGrid {
    size_t m = 1;
    std::vector<Vec3d> position, normal;
    std::vector<Rgba8> colour;
    std::vector<float> scalar;

    size_t index(size_t i, size_t j) const { return i * (i + 1) / 2 + j; }
    size_t size() const { return index(m, m) + 1; }
};

Vec3d unit(const Vec3d& v) {
    const double length = std::sqrt(glm::dot(v, v));
    return length > 0 ? v / length : Vec3d(0);
}

/// A number in [-1, 1) that depends on the bits of a position.
double hashPosition(const Vec3d& p, uint64_t seed) {
    uint64_t h = seed;
    for (int k = 0; k < 3; ++k) h = mixBits(h ^ std::bit_cast<uint64_t>(p[k]));
    return double(int64_t(h) >> 11) * 0x1p-52;
}

class Subdivision : public TriangleSource {
public:
    Subdivision(TriangleSource& input, const SubdivideSettings& settings)
        : input_(input), settings_(settings) {
        CHECK(settings.levels >= 0 && settings.levels <= kMaxSubdivideLevels);
        m_ = size_t(1) << settings.levels;
        schema_ = input.schema();
        schema_.normals_given = false;
        grid_.m = m_;
        ids_.resize(grid_.size());
        loadVertices();
        weld();
        numberVertices();
    }

    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() override { return vertex_count_; }
    uint64_t triangleCountHint() override { return triangle_count_; }
    uint64_t inputBytes() const override { return input_.inputBytes(); }
    bool cheapToReread() const override { return false; }
    std::vector<std::string> notes() const override { return input_.notes(); }

    void rewindVertices() override {
        rewindInput();
        to_emit_.clear();
        emitted_ = 0;
    }
    bool readVertices(VertexBatch& batch) override;
    void rewindTriangles() override {
        rewindInput();
        row_ = m_;
        triangles_read_ = 0;
    }
    bool readTriangles(TriangleBatch& batch) override;

private:
    void loadVertices();
    void weld();
    void numberVertices();
    void rewindInput();
    bool nextTriangle();
    uint64_t insidePoints() const { return (m_ - 1) * (m_ - 2) / 2; }

    void makePoints();
    void makeMidpoint(size_t p, size_t q, size_t out);
    void chooseNewPoints();
    void emitPoint(size_t point, VertexBatch& batch) const;
    void makeIds();

    TriangleSource& input_;
    SubdivideSettings settings_;
    size_t m_ = 1;
    AttributeSchema schema_;

    // The input's vertices. note: Vec3f sums are in the order of the triangles, so always the same.
    std::vector<Vec3d> position_;
    std::vector<Rgba8> colour_;
    std::vector<float> scalar_;
    std::vector<uint32_t> same_as_;  ///< the first vertex of equal position
    std::vector<Vec3f> normal_;      ///< for those first vertices
    std::vector<uint64_t> id_;       ///< of those in the output
    EdgeTable edges_;
    uint64_t vertex_count_ = 0;
    uint64_t triangle_count_ = 0;

    // Where reading stands.
    TriangleBatch batch_;
    size_t in_batch_ = 0;
    Corners corners_{};
    uint64_t next_id_ = 0;  ///< vertices numbered by the triangles before

    PointGrid grid_;
    std::vector<uint32_t> to_emit_;  ///< points of the grid that this triangle is the first to use
    size_t emitted_ = 0;
    std::vector<uint64_t> ids_;    ///< of the grid's points
    size_t row_ = 0, in_row_ = 0;  ///< the next triangle of the grid
    uint64_t triangles_read_ = 0;
};

constexpr uint64_t kNoId = std::numeric_limits<uint64_t>::max();

void Subdivision::loadVertices() {
    const uint64_t count = input_.vertexCount();
    if (count >= uint64_t(1) << 32)
        throw MemoryError(fmt::format("{} vertices are too many to subdivide", count));
    VertexBatch batch;
    input_.rewindVertices();
    while (input_.readVertices(batch)) {
        // Adding zero turns -0 into 0, which compares equal but hashes otherwise.
        for (const Vec3d& p : batch.position) position_.push_back(p + Vec3d(0.0));
        colour_.insert(colour_.end(), batch.colour.begin(), batch.colour.end());
        scalar_.insert(scalar_.end(), batch.scalar.begin(), batch.scalar.end());
    }
}

void Subdivision::weld() {
    std::vector<uint32_t> order(position_.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto key = [&](uint32_t v) {
        const Vec3d& p = position_[v];
        return std::array{p.x, p.y, p.z};
    };
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        const auto ka = key(a), kb = key(b);
        return ka != kb ? ka < kb : a < b;
    });
    same_as_.resize(position_.size());
    for (size_t i = 0; i < order.size(); ++i) {
        const bool same = i > 0 && position_[order[i]] == position_[order[i - 1]];
        same_as_[order[i]] = same ? same_as_[order[i - 1]] : order[i];
    }
}

void Subdivision::numberVertices() {
    normal_.assign(position_.size(), Vec3f(0));
    id_.assign(position_.size(), kNoId);
    rewindInput();
    while (nextTriangle()) {
        const auto& p = position_;
        const Vec3f normal(
            glm::cross(p[corners_[1]] - p[corners_[0]], p[corners_[2]] - p[corners_[0]]));
        for (const uint32_t corner : corners_) {
            normal_[corner] += normal;
            if (id_[corner] == kNoId) id_[corner] = vertex_count_++;
        }
        for (int k = 0; k < 3; ++k)
            if (edges_.findOrInsert(corners_[k], corners_[(k + 1) % 3], vertex_count_) ==
                vertex_count_)
                vertex_count_ += m_ - 1;
        vertex_count_ += insidePoints();
        triangle_count_ += m_ * m_;
    }
    for (Vec3f& n : normal_) n = Vec3f(unit(Vec3d(n)));
}

void Subdivision::rewindInput() {
    input_.rewindTriangles();
    batch_.triangle.clear();
    in_batch_ = 0;
    next_id_ = 0;
}

/// Puts the next triangle of three different vertices into corners_.
bool Subdivision::nextTriangle() {
    while (true) {
        if (in_batch_ == batch_.triangle.size()) {
            in_batch_ = 0;
            if (!input_.readTriangles(batch_)) return false;
        }
        const auto& t = batch_.triangle[in_batch_++];
        for (int k = 0; k < 3; ++k) corners_[k] = same_as_[t[k]];
        if (corners_[0] != corners_[1] && corners_[1] != corners_[2] && corners_[2] != corners_[0])
            return true;
    }
}

/// note: every operation here is symmetric in p and q, so that both triangles of an edge get the
/// same bits.
void Subdivision::makeMidpoint(size_t p, size_t q, size_t out) {
    PointGrid& g = grid_;
    const Vec3d middle = (g.position[p] + g.position[q]) * 0.5;
    const Vec3d edge = g.position[p] - g.position[q];
    const double length = std::sqrt(glm::dot(edge, edge));
    g.normal[out] = unit(g.normal[p] + g.normal[q]);
    g.position[out] = middle + g.normal[out] * (settings_.displacement * length *
                                                hashPosition(middle, mixBits(settings_.seed)));
    if (schema_.colours) {
        const auto mean = [](uint8_t a, uint8_t b) { return uint8_t((a + b + 1) / 2); };
        const Rgba8 a = g.colour[p], b = g.colour[q];
        g.colour[out] = {mean(a.r, b.r), mean(a.g, b.g), mean(a.b, b.b), mean(a.a, b.a)};
    }
    const size_t columns = schema_.scalars.size();
    for (size_t k = 0; k < columns; ++k)
        g.scalar[out * columns + k] =
            0.5f * (g.scalar[p * columns + k] + g.scalar[q * columns + k]);
}

void Subdivision::makePoints() {
    PointGrid& g = grid_;
    const size_t columns = schema_.scalars.size();
    g.position.resize(g.size());
    g.normal.resize(g.size());
    g.colour.resize(schema_.colours ? g.size() : 0);
    g.scalar.resize(g.size() * columns);
    const size_t at[3] = {g.index(0, 0), g.index(m_, 0), g.index(m_, m_)};
    for (int k = 0; k < 3; ++k) {
        const uint32_t v = corners_[k];
        g.position[at[k]] = position_[v];
        g.normal[at[k]] = Vec3d(normal_[v]);
        if (schema_.colours) g.colour[at[k]] = colour_[v];
        std::copy_n(scalar_.data() + v * columns, columns, g.scalar.data() + at[k] * columns);
    }
    for (size_t s = m_; s > 1; s /= 2) {
        const size_t h = s / 2;
        for (size_t i = 0; i < m_; i += s)
            for (size_t j = 0; j <= i; j += s) {
                const size_t a = g.index(i, j), b = g.index(i + s, j), c = g.index(i + s, j + s);
                makeMidpoint(a, b, g.index(i + h, j));
                makeMidpoint(a, c, g.index(i + h, j + h));
                makeMidpoint(b, c, g.index(i + s, j + h));
            }
    }
}

/// The output's numbers of the grid's points.
void Subdivision::makeIds() {
    const PointGrid& g = grid_;
    const size_t at[3] = {g.index(0, 0), g.index(m_, 0), g.index(m_, m_)};
    for (int k = 0; k < 3; ++k) {
        ids_[at[k]] = id_[corners_[k]];
        if (id_[corners_[k]] == next_id_) ++next_id_;
    }
    for (int k = 0; k < 3; ++k) {
        const uint32_t from = corners_[k], to = corners_[(k + 1) % 3];
        const uint64_t base = edges_.find(from, to);
        if (m_ > 1 && base == next_id_) next_id_ += m_ - 1;
        for (size_t step = 1; step < m_; ++step) {
            const size_t point = k == 0   ? g.index(step, 0)
                                 : k == 1 ? g.index(m_, step)
                                          : g.index(m_ - step, m_ - step);
            ids_[point] = base + (from < to ? step : m_ - step) - 1;
        }
    }
    for (size_t i = 2; i < m_; ++i)
        for (size_t j = 1; j < i; ++j) ids_[g.index(i, j)] = next_id_++;
}

/// Lists the points that no triangle before has had, in the order of their numbers.
void Subdivision::chooseNewPoints() {
    const uint64_t first = next_id_;
    makeIds();
    to_emit_.resize(next_id_ - first);
    for (size_t point = 0; point < ids_.size(); ++point)
        if (ids_[point] >= first) to_emit_[ids_[point] - first] = uint32_t(point);
}

void Subdivision::emitPoint(size_t point, VertexBatch& batch) const {
    batch.position.push_back(grid_.position[point]);
    if (schema_.colours) batch.colour.push_back(grid_.colour[point]);
    const size_t columns = schema_.scalars.size();
    for (size_t k = 0; k < columns; ++k) batch.scalar.push_back(grid_.scalar[point * columns + k]);
}

bool Subdivision::readVertices(VertexBatch& batch) {
    batch.first = next_id_ - (to_emit_.size() - emitted_);
    batch.position.clear();
    batch.normal.clear();
    batch.colour.clear();
    batch.scalar.clear();
    while (batch.position.size() < kMaxBatch) {
        if (emitted_ == to_emit_.size()) {
            if (!nextTriangle()) break;
            emitted_ = 0;
            chooseNewPoints();
            if (!to_emit_.empty()) makePoints();
            continue;
        }
        emitPoint(to_emit_[emitted_++], batch);
    }
    return !batch.position.empty();
}

bool Subdivision::readTriangles(TriangleBatch& batch) {
    batch.first = triangles_read_;
    batch.triangle.clear();
    while (batch.triangle.size() < kMaxBatch) {
        if (row_ == m_) {
            if (!nextTriangle()) break;
            makeIds();
            row_ = in_row_ = 0;
        }
        const size_t j = in_row_ / 2;
        const uint64_t* upper = &ids_[grid_.index(row_, 0)];
        const uint64_t* lower = &ids_[grid_.index(row_ + 1, 0)];
        if (in_row_ % 2 == 0)
            batch.triangle.push_back({upper[j], lower[j], lower[j + 1]});
        else
            batch.triangle.push_back({upper[j], lower[j + 1], upper[j + 1]});
        if (++in_row_ == 2 * row_ + 1) {
            ++row_;
            in_row_ = 0;
        }
    }
    triangles_read_ += batch.triangle.size();
    return !batch.triangle.empty();
}

}  // namespace

std::unique_ptr<TriangleSource> subdivide(TriangleSource& input,
                                          const SubdivideSettings& settings) {
    return std::make_unique<Subdivision>(input, settings);
}

}  // namespace pietra
