#include "runtime/page_loader.h"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <iterator>

namespace pietra {
namespace {

/// Where all cores are busy, drawing goes before loading, but does not starve it; and what is woken
/// to load does not take the core from what wakes it.
void stayInTheBackground() {
    constexpr int kNiceness = 10;
    [[maybe_unused]] const int level = ::nice(kNiceness);  // on Linux, of this thread alone
    const sched_param none{};
    ::sched_setscheduler(0, SCHED_BATCH, &none);
}

/// So many reads may be under way: as many as keep a disk busy.
constexpr size_t kAdvised = 16;

}  // namespace

PageLoader::PageLoader(std::vector<PageSource> sources, int threads)
    : sources_(std::move(sources)) {
    for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
}

PageLoader::~PageLoader() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    wake_.notify_all();
    for (std::thread& thread : threads_) thread.join();
}

std::optional<std::vector<PageKey>> PageLoader::forget() {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock) return {};
    queue_.clear();
    return begun_;
}

void PageLoader::want(std::span<const PageKey> wanted, std::vector<LoadedPage>& dropped) {
    if (wanted.empty() && dropped.empty()) return;
    {
        const std::unique_lock lock(mutex_, std::try_to_lock);
        if (!lock) return;
        queue_.assign(wanted.begin(), wanted.end());
        std::move(dropped.begin(), dropped.end(), std::back_inserter(dropped_));
        dropped.clear();
    }
    wake_.notify_all();
}

void PageLoader::take(std::vector<LoadedPage>& pages) {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock) return;
    for (const LoadedPage& page : ready_)
        begun_.erase(std::find(begun_.begin(), begun_.end(), page.key));
    std::move(ready_.begin(), ready_.end(), std::back_inserter(pages));
    ready_.clear();
}

/// The next page to load; or none, after having freed some. False if there is nothing more to do,
/// ever.
bool PageLoader::next(std::optional<PageKey>& key, std::vector<PageKey>& upcoming) {
    std::vector<LoadedPage> dropped;
    std::unique_lock lock(mutex_);
    wake_.wait(lock, [&] { return stop_ || !queue_.empty() || !dropped_.empty(); });
    if (stop_) return false;
    key.reset();
    dropped.swap(dropped_);
    if (!dropped.empty()) {
        lock.unlock();
        return true;
    }
    key = queue_.front();
    queue_.pop_front();
    begun_.push_back(*key);
    listUpcoming(upcoming);
    return true;
}

/// Those that are next, and the system has not been told of lately.
void PageLoader::listUpcoming(std::vector<PageKey>& upcoming) {
    upcoming.clear();
    for (size_t i = 0; i < std::min(queue_.size(), kAdvised); ++i) {
        if (std::find(advised_.begin(), advised_.end(), queue_[i]) != advised_.end()) continue;
        upcoming.push_back(queue_[i]);
        advised_.push_back(queue_[i]);
        if (advised_.size() > 4 * kAdvised) advised_.pop_front();
    }
}

void PageLoader::load(LoadedPage& page, std::vector<std::byte>& bytes) const {
    const PageSource& source = sources_[page.key.model];
    bytes.clear();
    if (!source.reader->tryReadPage(page.key.page, bytes, page.fault)) return;
    if (source.live != nullptr)
        page.live = source.live->decode(page.key.page, bytes, page.fault);
    else if (!source.reader->tryDecode(page.key.page, bytes, page.patches, page.fault))
        page.patches.clear();
}

void PageLoader::work() {
    std::vector<std::byte> bytes;
    stayInTheBackground();
    std::vector<PageKey> upcoming;
    for (std::optional<PageKey> key; next(key, upcoming);) {
        if (!key) continue;
        for (const PageKey& page : upcoming) sources_[page.model].reader->willRead(page.page);
        LoadedPage loaded{*key, {}, {}, {}};
        load(loaded, bytes);
        bytes_read_ += bytes.size();
        const std::lock_guard lock(mutex_);
        ready_.push_back(std::move(loaded));
    }
}

}  // namespace pietra
