#include "runtime/live_pool.h"

#include <fmt/format.h>

#include <algorithm>

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

void LivePool::publish() {
    loader_->take(ready_);
    const size_t count = std::min(ready_.size(), kMostArrivals);
    for (size_t i = 0; i < count; ++i) {
        LoadedPage& page = ready_[i];
        Part& part = parts_[page.key.model];
        if (!page.live)
            faults_.push_back(fmt::format("{}: byte {}: {}", part.reader->path(),
                                          part.reader->page(page.key.page).offset, page.fault));
        for (auto& pages : part.ahead) std::erase(pages, page.key.page);
        // What has no room now is asked for again, if it is still needed.
        (void)part.model->arrive(page.key.page, std::move(page.live));
    }
    ready_.erase(ready_.begin(), ready_.begin() + ptrdiff_t(count));
}

const LiveFrame& LivePool::adapt(size_t i, LiveTask task, size_t free_bytes) {
    Part& part = parts_[i];
    task.most_bytes = part.model->bytes() + free_bytes;
    part.frame = part.model->adapt(task);
    for (const auto faults = part.model->faults(); part.faults_told < faults.size();)
        faults_.push_back(faults[part.faults_told++]);
    return part.frame;
}

bool LivePool::isUnderWay(const PageKey& key) const {
    return std::find(begun_.begin(), begun_.end(), key) != begun_.end() ||
           std::find(wanted_.begin(), wanted_.end(), key) != wanted_.end() ||
           std::any_of(ready_.begin(), ready_.end(),
                       [&](const LoadedPage& page) { return page.key == key; });
}

void LivePool::want(uint32_t i, std::span<const uint32_t> pages) {
    for (const uint32_t page : pages)
        if (wanted_.size() < kMostWanted && !isUnderWay({i, page})) wanted_.push_back({i, page});
}

void LivePool::load() {
    auto begun = loader_->forget();
    if (!begun) return;
    begun_ = std::move(*begun);
    wanted_.clear();
    for (uint32_t i = 0; i < parts_.size(); ++i)
        want(i, parts_[i].model->requests(kMostWanted / parts_.size()));
    for (const int which : {0, 1})
        for (uint32_t i = 0; i < parts_.size(); ++i) want(i, parts_[i].ahead[which]);
    std::vector<std::vector<Mesh>> none;
    loader_->want(wanted_, none);
}

void LivePool::prefetch(size_t i, const View& view, double pixels, bool next_level) {
    parts_[i].ahead[next_level] = parts_[i].model->prefetch(view, pixels, kMostWanted);
}

void LivePool::forgetPrefetch() {
    for (Part& part : parts_)
        for (auto& pages : part.ahead) pages.clear();
}

size_t LivePool::bytes() const {
    size_t bytes = 0;
    for (const Part& part : parts_) bytes += part.model->bytes();
    const auto add = [&](const PageKey& key) { bytes += parts_[key.model].model->pageBytes(); };
    for (const PageKey& key : begun_) add(key);
    for (const LoadedPage& page : ready_) add(page.key);
    return bytes;
}

size_t LivePool::neededBytes() const {
    size_t bytes = 0;
    for (const Part& part : parts_) bytes += part.frame.needed_bytes;
    return bytes;
}

size_t LivePool::missing() const {
    size_t pages = 0;
    for (const Part& part : parts_) pages += part.frame.missing + part.frame.busy;
    return pages;
}

bool LivePool::shortOfMemory() const {
    return std::any_of(parts_.begin(), parts_.end(),
                       [](const Part& part) { return part.frame.short_of_memory; });
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
