#include "coarsen/components.h"

#include <algorithm>

#include "base/check.h"

namespace pietra {

void LocalComponents::share(uint32_t triangle, uint64_t low, uint64_t high, bool forward) {
    flags_[triangle] |= kShared;
    shared_uses_.push_back({low, high, triangle, forward});
}

BucketComponents LocalComponents::finish() {
    const uint32_t count = uint32_t(flags_.size());
    for (uint32_t t = 0; t < count; ++t) {
        const uint32_t root = sets_.root(t);
        flags_[root] |= flags_[t];
        if (root != t) volume_[root] += volume_[t];
    }
    BucketComponents out;
    std::vector<uint32_t> number(shared_uses_.empty() ? 0 : count);  // of roots that are shared
    for (uint32_t t = 0; t < count; ++t) {
        const uint32_t root = sets_.root(t);
        const bool open = (flags_[root] & kOpen) != 0 || volume_[root] < 0;
        uint32_t component = open ? kOpenComponent : kClosedComponent;
        if (flags_[root] & kShared) {
            if (root == t) {  // the least of its set: seen before all others
                number[root] = uint32_t(out.open.size());
                out.open.push_back(flags_[root] & kOpen);
                out.volume.push_back(volume_[root]);
            }
            component = number[root];
        }
        if (out.runs.empty() || out.runs.back().component != component)
            out.runs.push_back({t, component});
    }
    out.shared_uses = std::move(shared_uses_);
    for (SharedEdgeUse& use : out.shared_uses) use.component = number[sets_.root(use.component)];
    return out;
}

ComponentTable::ComponentTable(TempSpace& space, size_t memory_bytes) : space_(space) {
    uses_.emplace(*space.budget, memory_bytes, space.directory, "the components of the input");
}

void ComponentTable::add(BucketComponents& bucket) {
    if (bucket.open.empty()) return;
    uint32_t base;
    {
        const std::lock_guard lock(mutex_);
        CHECK_LT(open_.size() + bucket.open.size(), size_t(kOpenComponent));
        base = uint32_t(open_.size());
        open_.insert(open_.end(), bucket.open.begin(), bucket.open.end());
        volume_.insert(volume_.end(), bucket.volume.begin(), bucket.volume.end());
    }
    for (ComponentRun& run : bucket.runs)
        if (run.component < kOpenComponent) run.component += base;
    for (SharedEdgeUse& use : bucket.shared_uses) use.component += base;
    uses_->append(bucket.shared_uses);
    bucket.shared_uses = {};
}

void ComponentTable::join(std::span<const SharedEdgeUse> uses) {
    const bool ordinary = uses.size() == 2 && uses[0].forward != uses[1].forward;
    for (const SharedEdgeUse& use : uses) {
        sets_.unite(uses[0].component, use.component);
        open_[use.component] |= !ordinary;
    }
}

void ComponentTable::resolve() {
    sets_.grow(open_.size());
    uses_->forEachRun([&](std::span<const SharedEdgeUse> run) {
        const std::lock_guard lock(mutex_);
        for (auto first = run.begin(); first != run.end();) {
            const auto last = std::find_if(
                first, run.end(), [&](const SharedEdgeUse& use) { return !use.sameEdge(*first); });
            join({first, last});
            first = last;
        }
    });
    for (uint32_t i = 0; i < open_.size(); ++i) {
        const uint32_t root = sets_.root(i);
        open_[root] |= open_[i];
        if (root != i) volume_[root] += volume_[i];
    }
    for (uint32_t i = 0; i < open_.size(); ++i) {
        const uint32_t root = sets_.root(i);
        open_[i] = open_[root] | uint8_t(volume_[root] < 0);
    }
    volume_ = {};
    // What went to a file lay there beside the other temporary data.
    space_.add(uses_->spilledBytes());
    space_.remove(uses_->spilledBytes());
    uses_.reset();
    sets_ = DisjointSets();
}

}  // namespace pietra
