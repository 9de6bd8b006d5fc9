#pragma once
// Threads that read and decode pages for a frame thread that never waits for them.
//
// The frame thread says each frame which pages are wanted, best first, after what no thread has
// begun is forgotten; the system is told of the next ones. Decoded pages wait until they are taken.
// All functions but the destructor return at once and are for one thread; the loader's threads end
// in the destructor.
//
// The frame thread never waits for a lock that a loader's thread may hold: that one runs in the
// background, and may have lost its core for milliseconds. What is asked for then does not happen,
// and is asked for again in the next frame. Likewise it frees no pages, as the allocator has locks
// too: it leaves that to these threads.

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "geometry/mesh.h"
#include "multires/draw_list.h"
#include "multires/live_model.h"
#include "store/model_reader.h"

namespace pietra {

/// A model and, where its pages are not patches, who decodes them.
struct PageSource {
    const ModelReader* reader;
    const LiveModel* live = nullptr;
};

struct LoadedPage {
    PageKey key;
    std::vector<Mesh> patches;
    std::unique_ptr<LivePage> live;  ///< instead of patches
    std::string fault;  ///< if not empty, the page is damaged or cannot be read, and has no patches
};

class PageLoader {
public:
    /// What the sources point to must outlive this.
    PageLoader(std::vector<PageSource> sources, int threads);
    ~PageLoader();
    PageLoader(const PageLoader&) = delete;
    PageLoader& operator=(const PageLoader&) = delete;

    /// Forgets what no thread has begun. Returns the pages that threads have begun and nobody has
    /// taken; there will be no more of them before want(). Nothing: not possible now.
    std::optional<std::vector<PageKey>> forget();
    /// After forget(): pages to load, best first, none of them begun. And some to free, before
    /// anything is loaded; they are still there if that is not possible now.
    void want(std::span<const PageKey> wanted, std::vector<LoadedPage>& dropped);
    /// Appends what is ready, in the order in which it became so.
    void take(std::vector<LoadedPage>& pages);
    /// Bytes read from files so far.
    uint64_t bytesRead() const { return bytes_read_.load(std::memory_order_relaxed); }

private:
    void work();
    void load(LoadedPage& page, std::vector<std::byte>& bytes) const;
    bool next(std::optional<PageKey>& key, std::vector<PageKey>& upcoming);
    void listUpcoming(std::vector<PageKey>& upcoming);

    std::vector<PageSource> sources_;
    std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<PageKey> queue_;
    std::vector<PageKey> begun_;   // until taken
    std::deque<PageKey> advised_;  // that the system was told of last
    std::vector<LoadedPage> ready_;
    std::vector<LoadedPage> dropped_;
    std::atomic<uint64_t> bytes_read_{0};
    bool stop_ = false;
    std::vector<std::thread> threads_;
};

}  // namespace pietra
