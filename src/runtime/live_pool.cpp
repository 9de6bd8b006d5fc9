#include "runtime/live_pool.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "runtime/live_settle.h"

namespace pietra {

LivePool::LivePool(const std::vector<const ModelReader*>& readers, OpenLive open,
                   int loader_threads) {
    std::vector<PageSource> sources;
    for (const ModelReader* reader : readers) {
        parts_.push_back({reader, openLive(*reader, open), {}, 0, {}});
        sources.push_back({reader, parts_.back().model.get()});
    }
    loader_ =
        std::make_unique<PageLoader>(std::move(sources), readers.empty() ? 0 : loader_threads);
}

size_t LivePool::pageBytes(std::span<const PageKey> pages) const {
    size_t bytes = 0;
    for (const PageKey& key : pages) bytes += parts_[key.model].model->pageBytes();
    return bytes;
}

void LivePool::publish() {
    loader_->take(ready_);
    for (const LoadedPage& page : ready_)
        for (auto* under_way : {&begun_, &wanted_}) std::erase(*under_way, page.key);
    const size_t count = std::min(ready_.size(), kMostArrivals);
    const std::span<LoadedPage> arriving(ready_.data(), count);
    // Twice: of two, the one that must be there first may have come after the other.
    std::vector<uint8_t> is_there(count, 0);
    for (int round = 0; round < 2; ++round)
        for (size_t i = 0; i < count; ++i)
            if (!is_there[i]) is_there[i] = arrive(arriving[i]);
    // What has no room now is asked for again, if it is still needed.
    const auto rest = ready_.begin() + ptrdiff_t(count);
    std::move(ready_.begin(), rest, std::back_inserter(dropped_));
    ready_.erase(ready_.begin(), rest);
}

bool LivePool::arrive(LoadedPage& page) {
    Part& part = parts_[page.key.model];
    for (auto& pages : part.ahead) std::erase(pages, page.key.page);
    if (part.model->arrive(page.key.page, page.live.get())) {
        if (!page.live)
            faults_.push_back(fmt::format("{}: byte {}: {}", part.reader->path(),
                                          part.reader->page(page.key.page).offset, page.fault));
        return true;
    }
    return false;
}

const LiveFrame& LivePool::adapt(size_t i, LiveTask task, size_t free_bytes) {
    Part& part = parts_[i];
    task.most_bytes = part.model->bytes() + free_bytes;
    forAllUnderWay([&](const PageKey& key) {
        if (key.model == i) task.arriving_bytes += part.model->pageBytes();
    });
    part.frame = part.model->adapt(task);
    for (const auto faults = part.model->faults(); part.faults_told < faults.size();)
        faults_.push_back(part.reader->path() + ": " + faults[part.faults_told++]);
    return part.frame;
}

template <class Body>
void LivePool::forAllUnderWay(const Body& body) const {
    for (const PageKey& key : begun_) body(key);
    for (const PageKey& key : wanted_) body(key);
    for (const LoadedPage& page : ready_) body(page.key);
}

bool LivePool::isUnderWay(const PageKey& key) const {
    bool found = false;
    forAllUnderWay([&](const PageKey& other) { found |= other == key; });
    return found;
}

/// For what is needed now, others leave.
void LivePool::want(uint32_t i, std::span<const uint32_t> pages, bool now) {
    LiveModel& model = *parts_[i].model;
    for (const uint32_t page : pages) {
        if (wanted_.size() == kMostWanted || isUnderWay({i, page})) continue;
        if (now && free_bytes_ < model.pageBytes()) free_bytes_ += model.release(model.pageBytes());
        if (free_bytes_ < model.pageBytes()) {
            no_room_ |= now;
            return;
        }
        free_bytes_ -= model.pageBytes();
        wanted_.push_back({i, page});
    }
}

void LivePool::load(size_t free_bytes) {
    no_room_ = false;
    auto begun = loader_->forget();
    if (!begun) return;
    // What was wanted and not begun gives its room back.
    free_bytes_ = free_bytes + pageBytes(begun_) + pageBytes(wanted_);
    wanted_.clear();
    begun_ = std::move(*begun);
    free_bytes_ -= std::min(free_bytes_, pageBytes(begun_));
    for (uint32_t i = 0; i < parts_.size(); ++i)
        want(i, parts_[i].model->requests(std::max<size_t>(kMostWanted / parts_.size(), 1)), true);
    for (const int which : {0, 1})
        for (uint32_t i = 0; i < parts_.size(); ++i) want(i, parts_[i].ahead[which], false);
    loader_->want(wanted_, dropped_);
}

void LivePool::prefetch(size_t i, const View& view, double pixels, bool next_level) {
    parts_[i].ahead[next_level] = parts_[i].model->prefetch(view, pixels, kMostAhead);
}

void LivePool::forgetPrefetch() {
    for (Part& part : parts_)
        for (auto& pages : part.ahead) pages.clear();
}

size_t LivePool::bytes() const {
    size_t bytes = 0;
    for (const Part& part : parts_) bytes += part.model->bytes();
    forAllUnderWay([&](const PageKey& key) { bytes += parts_[key.model].model->pageBytes(); });
    return bytes;
}

size_t LivePool::neededBytes() const {
    size_t bytes = 0;
    for (const Part& part : parts_) bytes += part.frame.needed_bytes;
    return bytes;
}

size_t LivePool::lackingBytes() const {
    size_t bytes = 0;
    for (const Part& part : parts_)
        bytes += std::min(part.frame.missing, kMostWanted) * part.model->pageBytes();
    return bytes - std::min(bytes, pageBytes(begun_) + pageBytes(wanted_));
}

size_t LivePool::missing() const {
    size_t pages = 0;
    for (const Part& part : parts_) pages += part.frame.missing + part.frame.busy;
    return pages;
}

bool LivePool::shortOfMemory() const {
    const auto any = [&](const auto& says) {
        return std::any_of(parts_.begin(), parts_.end(), says);
    };
    return (no_room_ && !any([](const Part& part) { return part.frame.busy; })) ||
           any([](const Part& part) { return part.frame.short_of_memory; });
}

bool LivePool::shortOfTriangles() const {
    return std::any_of(parts_.begin(), parts_.end(),
                       [](const Part& part) { return part.frame.short_of_triangles; });
}

uint32_t LivePool::operations() const {
    uint32_t count = 0;
    for (const Part& part : parts_) count += part.frame.operations;
    return count;
}

size_t LivePool::release(size_t bytes) {
    size_t released = 0;
    for (Part& part : parts_)
        if (released < bytes) released += part.model->release(bytes - released);
    return released;
}

}  // namespace pietra
