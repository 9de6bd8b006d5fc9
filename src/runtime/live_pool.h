#pragma once
// The adapted meshes of a scene (multires/live_model.h): has their pages loaded and lets them
// arrive.
//
// A frame: publish(), adapt() each, then load(). None of them waits. At most kMostArrivals pages
// arrive in a frame, those asked for longest first.

#include <memory>
#include <string>
#include <vector>

#include "multires/live_model.h"
#include "runtime/page_loader.h"

namespace pietra {

class LivePool {
public:
    /// Readers must outlive this. Throws what `open` throws.
    LivePool(const std::vector<const ModelReader*>& readers, OpenLive open, int loader_threads);

    size_t size() const { return parts_.size(); }
    const LiveModel& model(size_t i) const { return *parts_[i].model; }

    void publish();
    /// task.most_bytes is set: by `free_bytes` more than the model has.
    const LiveFrame& adapt(size_t i, LiveTask task, size_t free_bytes);
    /// Sends for pages that are needed, as far as they fit what is free, and for such that views to
    /// come will need.
    void load(size_t free_bytes);
    /// These, from now on: of model i, instead of those before.
    void prefetch(size_t i, const View& view, double pixels, bool next_level);
    void forgetPrefetch();

    /// What they hold, pages on their way included.
    size_t bytes() const;
    size_t neededBytes() const;
    /// Of pages that load() will send for, about, beyond those that are on their way.
    size_t lackingBytes() const;
    /// Pages needed and under way, and models that had no time to do all they could.
    size_t missing() const;
    bool shortOfMemory() const;
    bool shortOfTriangles() const;
    uint32_t operations() const;
    /// Lets go of about so many bytes that the last frame did not need. Of how many?
    size_t release(size_t bytes);
    uint64_t bytesRead() const { return loader_->bytesRead(); }
    /// A sentence for each fault so far.
    const std::vector<std::string>& faults() const { return faults_; }

private:
    static constexpr size_t kMostArrivals = 32, kMostWanted = 64, kMostAhead = 512;

    struct Part {
        const ModelReader* reader;
        std::unique_ptr<LiveModel> model;
        LiveFrame frame;
        size_t faults_told = 0;
        std::vector<uint32_t> ahead[2];  ///< pages to be prefetched
    };
    bool arrive(LoadedPage& page);
    bool isUnderWay(const PageKey& key) const;
    size_t pageBytes(std::span<const PageKey> pages) const;
    void want(uint32_t i, std::span<const uint32_t> pages, bool now);
    /// body(key) for all that is on its way.
    template <class Body>
    void forAllUnderWay(const Body& body) const;

    std::vector<Part> parts_;
    std::vector<LoadedPage> ready_, dropped_;  // these to be freed by the loader
    std::vector<PageKey> begun_, wanted_;
    size_t free_bytes_ = 0;  // while wanting
    bool no_room_ = false;   // for something needed
    std::vector<std::string> faults_;
    std::unique_ptr<PageLoader> loader_;  // last: its threads end first
};

}  // namespace pietra
