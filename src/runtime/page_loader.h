#pragma once
// Threads that read and decode pages for a frame thread that never waits for them.
//
// The frame thread says each frame which pages are wanted, best first, after what no thread has
// begun is forgotten. Decoded pages wait until they are taken. All functions but the destructor
// return at once and are for one thread; the loader's threads end in the destructor.

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
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
    /// taken; there will be no more of them before want().
    std::vector<PageKey> forget();
    /// After forget(): pages to load, best first, none of them begun.
    void want(std::span<const PageKey> wanted);
    /// Appends what is ready, in the order in which it became so.
    void take(std::vector<LoadedPage>& pages);
    /// Bytes read from files so far.
    uint64_t bytesRead() const;

private:
    void work();
    void load(LoadedPage& page, std::vector<std::byte>& bytes) const;
    bool next(PageKey& key);

    std::vector<PageSource> sources_;
    mutable std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<PageKey> queue_;
    std::vector<PageKey> begun_;  // until taken
    std::vector<LoadedPage> ready_;
    uint64_t bytes_read_ = 0;
    bool stop_ = false;
    std::vector<std::thread> threads_;
};

}  // namespace pietra
