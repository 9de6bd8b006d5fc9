#include "methods/pmesh/front/split_chunks.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "geometry/bounds.h"
#include "geometry/lattice.h"

namespace pietra::pmesh {
namespace {

/// What rounding may take from the cosine of a cone.
constexpr float kConeSlack = 1e-5f;
constexpr uint32_t kNone = ~0u;

/// Damage may take a vertex anywhere; renderers rely on 21 bits.
Vec3i drawnPosition(const SplitVertex& v, int shift) {
    constexpr int32_t kOff = 1 << (kMaxLatticeShift - 1);
    const Vec3i within = glm::clamp(v.position, -kLatticeMax, kLatticeMax);
    return glm::clamp(within * (1 << shift), -kOff, kLatticeMax + kOff - 1);
}

/// Numbers for vertices of other blocks, in the order in which they are met.
class Numbers {
public:
    void begin(size_t most) {
        ++stamp_;
        size_t size = 1024;
        while (size < 2 * most) size *= 2;
        if (slot_.size() < size) slot_.assign(size, {});
    }
    /// kNone if it is new; then it must be set.
    uint32_t& operator[](uint32_t key) {
        const size_t mask = slot_.size() - 1;
        size_t at = (key * 0x9e3779b1u >> 8) & mask;
        while (slot_[at].stamp == stamp_ && slot_[at].key != key) at = (at + 1) & mask;
        if (slot_[at].stamp != stamp_) slot_[at] = {stamp_, key, kNone};
        return slot_[at].number;
    }

private:
    struct Slot {
        uint32_t stamp = 0, key = 0, number = 0;
    };
    std::vector<Slot> slot_;
    uint32_t stamp_ = 0;
};

/// Around the mean direction; wide open where that is no direction of all.
NormalCone coneOf(const Mesh& mesh) {
    thread_local std::vector<Vec3f> normal;
    normal.clear();
    Vec3f sum(0);
    for (const Triangle& t : mesh.triangle) {
        const Vec3f a(mesh.position[t[0]]);
        const Vec3f n = glm::cross(Vec3f(mesh.position[t[1]]) - a, Vec3f(mesh.position[t[2]]) - a);
        const float squared = glm::dot(n, n);
        if (!(squared > 0)) continue;  // no area, not drawn
        normal.push_back(n / std::sqrt(squared));
        sum += normal.back();
    }
    NormalCone cone;
    if (!(glm::dot(sum, sum) > 0)) return cone;
    cone.axis = glm::normalize(sum);
    float least = 1;
    for (const Vec3f& n : normal) least = std::min(least, glm::dot(n, cone.axis));
    cone.cos_angle = std::max(least - kConeSlack, -1.0f);
    return cone;
}

/// Without room for much more, and without what it had once.
template <class T>
void resizeTight(std::vector<T>& elements, size_t count) {
    if (elements.capacity() < count || elements.capacity() > count + count / 4) {
        std::vector<T>().swap(elements);
        elements.reserve(count);
    }
    elements.resize(count);
}

template <class T>
size_t bytesOf(const std::vector<T>& elements) {
    return elements.capacity() * sizeof(T);
}

}  // namespace

SplitChunks::SplitChunks(const ResidentSplits& nodes, const SplitBlocks& blocks)
    : nodes_(nodes), blocks_(blocks) {
    const SplitBase& base = nodes.forest().base;
    Leaf first = 0;
    for (const SplitBase::Root& root : base.root) {
        root_first_.push_back(first);
        first += root.leaves;
    }
    const auto rootOf = [&](size_t t) {
        return size_t(
                   std::upper_bound(root_first_.begin(), root_first_.end(), base.triangle[t][0]) -
                   root_first_.begin()) -
               1;
    };
    base_begin_.assign(root_first_.size() + 1, 0);
    for (size_t t = 0; t < base.triangle.size(); ++t) ++base_begin_[rootOf(t) + 1];
    for (size_t r = 0; r < root_first_.size(); ++r) base_begin_[r + 1] += base_begin_[r];
    base_order_.resize(base.triangle.size());
    std::vector<uint32_t> next(base_begin_.begin(), base_begin_.end());
    for (size_t t = 0; t < base.triangle.size(); ++t) base_order_[next[rootOf(t)]++] = uint32_t(t);
    update();
}

void SplitChunks::addBaseTriangles(Leaf root, std::vector<Leaf>& corners, bool& closed) const {
    const SplitBase& base = nodes_.forest().base;
    const size_t r = size_t(std::lower_bound(root_first_.begin(), root_first_.end(), root) -
                            root_first_.begin());
    for (uint32_t i = base_begin_[r]; i < base_begin_[r + 1]; ++i) {
        const std::array<Leaf, 3>& leaf = base.triangle[base_order_[i]];
        corners.insert(corners.end(), leaf.begin(), leaf.end());
        closed &= base.closed[base_order_[i]] != 0;
    }
}

bool SplitChunks::isStale(uint32_t block) const {
    const Made& made = made_[block];
    if (blocks_.all()[block].version > made.version) return true;
    return std::any_of(made.on_others.begin(), made.on_others.end(),
                       [&](uint32_t other) { return blocks_.all()[other].version > made.version; });
}

void SplitChunks::update() {
    chunk_.resize(blocks_.all().size());
    made_.resize(chunk_.size());
    std::vector<uint32_t> stale;
    for (uint32_t b = 0; b < chunk_.size(); ++b)
        if (isStale(b)) stale.push_back(b);
    if (stale.empty()) return;
    ++version_;
    parallelFor(stale.size(), [&](size_t i) { make(stale[i]); });
}

void SplitChunks::make(uint32_t block) {
    thread_local std::vector<SplitBlocks::Place> vertex;
    Made& made = made_[block];
    made.version = blocks_.latestVersion();
    made.on_others.clear();
    vertex.clear();
    blocks_.prefetch(block, &SplitPage::leaf);
    for (uint32_t r = 0; r < blocks_.countOf(block); ++r) vertex.push_back({block, r});
    makeTriangles(block, vertex);
    blocks_.prefetch(block, &SplitPage::vertex);
    blocks_.prefetch(block, &SplitPage::next);
    makeVertices(chunk_[block], vertex);
}

/// Adds vertices of other blocks.
void SplitChunks::makeTriangles(uint32_t block, std::vector<SplitBlocks::Place>& vertex) {
    thread_local Numbers number, other_block;
    thread_local std::vector<Leaf> corners;
    thread_local std::vector<uint32_t> owner;
    LiveChunk& chunk = chunk_[block];
    corners.clear();
    bool closed = true;
    for (const SplitBlocks::Place p : vertex) {
        const auto [page, i] = blocks_.at(p);
        const std::array<Leaf, 6>& leaf = page.leaf[i];
        const size_t before = corners.size();
        if (leaf[0] != leaf[1]) corners.insert(corners.end(), leaf.begin(), leaf.begin() + 3);
        if (leaf[3] != leaf[4]) corners.insert(corners.end(), leaf.begin() + 3, leaf.end());
        if (corners.size() > before) closed &= (page.closed >> i & 1) != 0;
        if (page.made[i] == kNoSplit) addBaseTriangles(page.first[i], corners, closed);
    }
    owner.resize(corners.size());
    blocks_.ownersOf(corners, owner);
    number.begin(corners.size());
    other_block.begin(corners.size());
    resizeTight(chunk.mesh.triangle, corners.size() / 3);
    for (size_t c = 0; c < corners.size(); ++c) {
        const SplitBlocks::Place p = SplitBlocks::placeOf(owner[c]);
        uint32_t& corner = chunk.mesh.triangle[c / 3][c % 3];
        if (p.block == block) {
            corner = p.rank;
            continue;
        }
        uint32_t& n = number[owner[c]];
        if (n == kNone) {
            n = uint32_t(vertex.size());
            vertex.push_back(p);
            const auto [page, i] = blocks_.at(p);
            prefetchLines(&page.vertex[i], sizeof(SplitVertex));
            // A leaf gets another owner only where this one is split or merged.
            if (uint32_t& seen = other_block[p.block]; seen == kNone)
                seen = 0, made_[block].on_others.push_back(p.block);
        }
        corner = n;
    }

    chunk.version = corners.empty() ? 0 : version_;
    chunk.closed = closed;
}

void SplitChunks::makeVertices(LiveChunk& chunk, std::span<const SplitBlocks::Place> vertex) const {
    const Lattice& lattice = nodes_.forest().lattice;
    const SplitGrid& grid = nodes_.forest().grid;
    const WordLayout layout = nodes_.forest().layout;
    resizeTight(chunk.mesh.position, vertex.size());
    resizeTight(chunk.mesh.normal, vertex.size());
    resizeTight(chunk.mesh.colour, vertex.size() * layout.colours);
    resizeTight(chunk.mesh.scalar, vertex.size() * layout.scalars);
    Box3i box;
    std::array<uint16_t, 3> min{0xffff, 0xffff, 0xffff}, max{};
    uint16_t error = 0;
    for (size_t i = 0; i < vertex.size(); ++i) {
        const auto [page, s] = blocks_.at(vertex[i]);
        const uint32_t* const words = blocks_.wordsOf(vertex[i]);
        chunk.mesh.position[i] = drawnPosition(page.vertex[s], lattice.shift);
        chunk.mesh.normal[i] = unpackNormal(page.vertex[s].normal);
        if (words) setVertex({words, layout.words()}, layout, chunk.mesh, i);
        box.add(chunk.mesh.position[i]);
        if (page.next.error[s] == 0) continue;
        error = std::max(error, page.next.error[s]);
        for (size_t k = 0; k < 3; ++k) {
            min[k] = std::min(min[k], page.next.min[k][s]);
            max[k] = std::max(max[k], page.next.max[k][s]);
        }
    }
    chunk.box = box;
    const Vec3f centre = 0.5f * (Vec3f(box.min) + Vec3f(box.max));
    chunk.bounds = chunk.saturated = {centre, 0};
    float squared = 0;
    for (const Vec3i& p : chunk.mesh.position) {
        const Vec3f d = centre - Vec3f(p);
        squared = std::max(squared, glm::dot(d, d));
    }
    chunk.bounds.radius = std::sqrt(squared);
    if (error > 0) {
        Vec3d farthest(0);
        for (int k = 0; k < 3; ++k) {
            const auto at = [&](uint16_t unit) {
                return (double(grid.origin[k]) * double(1 << lattice.shift) +
                        double(unit) * grid.unit(lattice)) -
                       double(centre[k]);
            };
            farthest[k] = std::max(std::abs(at(min[size_t(k)])), std::abs(at(max[size_t(k)])));
        }
        chunk.saturated.radius = float(glm::length(farthest));
    }
    chunk.cone = chunk.closed ? coneOf(chunk.mesh) : NormalCone{};
    chunk.error = float(double(NestedCriterion::errorOf(error)) * grid.unit(lattice));
    constexpr int kAnOctave = 7;
    const uint16_t coarsest = nodes_.forest().row[0].criterion.error;
    chunk.level = uint16_t((std::max(coarsest, error) - error) >> kAnOctave);
}

size_t SplitChunks::triangleCount() const {
    size_t count = 0;
    for (const LiveChunk& chunk : chunk_) count += chunk.mesh.triangleCount();
    return count;
}

size_t SplitChunks::bytes() const {
    size_t bytes = bytesOf(chunk_) + bytesOf(made_);
    for (const Made& made : made_) bytes += bytesOf(made.on_others);
    for (const LiveChunk& chunk : chunk_)
        bytes += bytesOf(chunk.mesh.position) + bytesOf(chunk.mesh.normal) +
                 bytesOf(chunk.mesh.triangle) + bytesOf(chunk.mesh.colour) +
                 bytesOf(chunk.mesh.scalar);
    return bytes;
}

}  // namespace pietra::pmesh
