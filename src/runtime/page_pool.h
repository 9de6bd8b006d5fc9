#pragma once
// The pages of a scene's models: loads what is wanted, lets it arrive where it is drawn from, and
// evicts what has not been used for longest, within hard budgets.
//
// Without a sink pages are drawn from RAM, and there is one budget. With one, a page is resident
// (residency.h) when the sink holds it, within the sink's budget; decoded copies in RAM are a cache
// before the disk, within a budget of its own, and what is arriving passes through it.
//
// A frame: publish(), then want() for all that is missing, then load(). None of them waits, but for
// a page so large that the sink has to.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "multires/page_sink.h"
#include "runtime/page_loader.h"
#include "runtime/page_memory.h"
#include "runtime/scene_model.h"

namespace pietra {

using SceneModels = std::vector<std::unique_ptr<SceneModel>>;

class PagePool {
public:
    /// `models` and `sink`, if any, must outlive this. Of `ram_bytes`, `table_bytes` are taken.
    /// Loads the roots, waiting for them. Throws MemoryError, which says how much is needed, if
    /// they do not fit, and what reading throws.
    PagePool(SceneModels& models, size_t ram_bytes, size_t table_bytes, int loader_threads,
             PageSink* sink);
    ~PagePool();
    PagePool(const PagePool&) = delete;
    PagePool& operator=(const PagePool&) = delete;

    /// Begins a frame: what is ready becomes resident.
    void publish(uint32_t frame);
    /// In the order of need; what is to be drawn first.
    void want(PageKey key, Need need);
    /// Has the loader load what fits, after making room.
    void load();

    /// What others hold of the memory, in RAM, and will need before pages that are wanted for later
    /// get any. These say so in each frame, before load().
    void setElsewhere(size_t bytes, size_t needed = 0) {
        ram_.elsewhere = bytes;
        needed_elsewhere_ = needed;
    }
    /// For them: lets go of so many bytes that this frame does not need, or fewer. Of how many?
    size_t release(size_t bytes);
    /// The same, in the sink.
    size_t releaseDevice(size_t bytes);

    /// Something that is to be drawn does not fit.
    bool blocked() const { return blocked_; }
    /// ... into RAM; else into the sink.
    bool blockedInRam() const { return blocked_ && short_of_ram_; }
    /// Of what is wanted in this frame, not for later, how much is on its way or does not fit.
    size_t missing() const { return missing_; }
    /// Whether so many bytes may stay in RAM, beside what passes through.
    bool mayStay(size_t bytes) const { return sink_ == nullptr || bytes <= ram_.budget / 2; }
    size_t freeRam() const { return ram_.free(); }
    size_t ramBudget() const { return ram_.budget; }
    size_t deviceBudget() const { return device_.budget; }  ///< 0: there is no sink
    /// In RAM, what is on its way included.
    size_t ramBytes() const { return ram_.used + ram_.reserved; }
    size_t deviceBytes() const { return sink_ != nullptr ? sink_->usedBytes() : 0; }
    uint64_t bytesRead() const { return loader_->bytesRead(); }
    const std::vector<std::string>& faults() const { return faults_; }

private:
    struct Wanted {
        PageKey key;
        Need need;
    };

    SceneModel& modelOf(const PageKey& key) const { return *models_[key.model]; }
    void loadRoots(size_t table_bytes);
    void keep(LoadedPage& page);
    bool tryArrive(const PageKey& key, size_t& upload_left);
    bool enter(const PageKey& key);
    void forgetUnwanted();
    void reserve(std::span<const PageKey> begun);
    bool provide(const Wanted& wanted, std::vector<PageKey>& to_load);
    bool makeRoomInRam(size_t bytes, Need need);
    bool makeRoomToDraw(size_t bytes, Need need);
    std::vector<PageMemory::Victim> copiesToDrop() const;
    std::vector<PageMemory::Victim> pagesToLeave() const;
    void leave(const PageKey& key);
    void dropCopy(const PageKey& key);

    SceneModels& models_;
    PageSink* const sink_;
    PageMemory ram_, device_;
    uint32_t frame_ = 0;
    std::vector<Wanted> wanted_;
    std::vector<LoadedPage> loaded_;
    std::vector<PageKey> arriving_;
    std::vector<LoadedPage> dropped_;  // evicted, to be freed by the loader
    size_t scattered_bytes_ = 0;       ///< that the sink has free, about, but not in one piece
    bool blocked_ = false, short_of_ram_ = false;
    size_t needed_elsewhere_ = 0;
    size_t missing_ = 0;
    std::vector<std::string> faults_;
    std::unique_ptr<PageLoader> loader_;  // last: its threads end first
};

}  // namespace pietra
