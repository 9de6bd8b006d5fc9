#include "audit/input_triangles.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pietra {

namespace {
constexpr uint64_t kEmptySlot = std::numeric_limits<uint64_t>::max();
}

InputTriangles::InputTriangles(TriangleSource& source, Budget& budget, size_t memory_bytes,
                               const std::string& temp_dir, Progress* progress)
    : source_(source), progress_(progress), vertex_count_(source.vertexCount()) {
    memory_bytes = std::max(memory_bytes, size_t(1) << 20);
    const bool fits = vertex_count_ <= memory_bytes / sizeof(Vec3d);
    const size_t bytes = fits ? size_t(vertex_count_) * sizeof(Vec3d) : memory_bytes;
    reservation_ = budget.reserve(bytes, "the input's vertices");
    if (fits)
        positions_.reserve(size_t(vertex_count_));
    else
        file_ = File(temp_dir, File::Mode::kTemporary);
    readVertices();
    if (fits) return;
    cache_.resize(memory_bytes / (sizeof(Page) + sizeof(uint64_t)));
    cached_.assign(cache_.size(), kEmptySlot);
}

void InputTriangles::readVertices() {
    VertexBatch batch;
    source_.rewindVertices();
    while (source_.readVertices(batch)) {
        if (progress_) progress_->tick(batch.position.size());
        if (file_.isOpen())
            file_.write(batch.position.data(), batch.position.size() * sizeof(Vec3d));
        else
            positions_.insert(positions_.end(), batch.position.begin(), batch.position.end());
    }
}

const InputTriangles::Page& InputTriangles::cachedPage(uint64_t page) {
    const size_t slot = size_t(page % cache_.size());
    if (cached_[slot] != page) {
        cached_[slot] = kEmptySlot;  // should reading throw
        file_.readSomeAt(page * sizeof(Page), cache_[slot].data(), sizeof(Page));
        cached_[slot] = page;
    }
    return cache_[slot];
}

const Vec3d& InputTriangles::position(uint64_t index) {
    if (!file_.isOpen()) return positions_[size_t(index)];
    return cachedPage(index / kPageVertices)[index % kPageVertices];
}

void InputTriangles::forEachBatch(const Visitor& visit) {
    TriangleBatch batch;
    std::vector<Corners> corners;
    source_.rewindTriangles();
    while (source_.readTriangles(batch)) {
        corners.clear();
        for (const auto& [a, b, c] : batch.triangle) {
            const Vec3d pa = position(a), pb = position(b);
            corners.push_back({pa, pb, position(c)});
        }
        visit(batch.first, corners);
        if (progress_) progress_->tick(corners.size());
    }
}

}  // namespace pietra
