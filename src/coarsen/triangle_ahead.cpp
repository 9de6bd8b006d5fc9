#include "coarsen/triangle_ahead.h"

#include <algorithm>

namespace pietra {
namespace {

constexpr uint64_t kBatches = 16;
constexpr uint64_t kSmallestBatch = 1 << 16;

}  // namespace

TriangleAhead::TriangleAhead(TriangleSource& source, size_t most)
    : source_(source),
      count_(size_t(std::min<uint64_t>(
          most, std::max(source.triangleCountHint() / kBatches, kSmallestBatch)))) {
    source_.rewindTriangles();
    begin();
}

TriangleAhead::~TriangleAhead() {
    try {
        wait();
    } catch (...) {
        // Somebody else's fault is being told already.
    }
}

bool TriangleAhead::next(std::vector<std::array<uint64_t, 3>>& index) {
    wait();
    index.swap(ahead_);
    if (index.empty()) return false;
    begin();
    return true;
}

void TriangleAhead::begin() {
    order_.begin();
    task_.run([this] {
        const TaskOrder::Task task(order_);
        readMore();
    });
}

void TriangleAhead::wait() {
    task_.wait();
    order_.end();
}

void TriangleAhead::readMore() {
    ahead_.clear();
    while (ahead_.size() < count_) {
        if (begin_ == batch_.triangle.size()) {
            begin_ = 0;
            if (!source_.readTriangles(batch_)) return;
        }
        const size_t take = std::min(count_ - ahead_.size(), batch_.triangle.size() - begin_);
        const auto from = batch_.triangle.begin() + ptrdiff_t(begin_);
        ahead_.insert(ahead_.end(), from, from + ptrdiff_t(take));
        begin_ += take;
    }
}

}  // namespace pietra
