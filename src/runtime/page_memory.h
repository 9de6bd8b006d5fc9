#pragma once
// A budget of pages and the order in which pages leave it.

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "multires/draw_list.h"

namespace pietra {

/// Why a page is wanted: to draw this frame, to know where the eye is, or for a view to come.
enum class Need { kDraw, kEye, kLater };

class PageMemory {
public:
    struct Victim {
        PageKey key;
        uint32_t last_used;  ///< frame
    };
    /// A page used in the last frames leaves only for one that is needed now.
    static constexpr uint32_t kFramesKept = 60;

    explicit PageMemory(size_t bytes) : budget(bytes) {}

    const size_t budget;
    size_t used = 0;
    size_t reserved = 0;   ///< for pages on their way
    size_t elsewhere = 0;  ///< taken by others

    size_t free() const { return budget - std::min(budget, used + reserved + elsewhere); }
    bool fits(size_t bytes) const { return used + reserved + elsewhere + bytes <= budget; }
    /// Forgets what may leave: at the beginning of a frame.
    void beginFrame() { victims_.reset(); }

    /// Evicts until so many bytes fit, or nothing more may leave; true if they fit. `candidates()`
    /// lists what may leave, asked for once a frame.
    template <class Candidates, class Evict>
    bool makeRoom(size_t bytes, Need need, uint32_t frame, const Candidates& candidates,
                  const Evict& evict);

private:
    /// Of two, the one to stay longer: of equals the coarser one.
    static bool staysLonger(const Victim& a, const Victim& b) {
        return a.last_used != b.last_used   ? a.last_used > b.last_used
               : a.key.model != b.key.model ? a.key.model > b.key.model
                                            : a.key.page < b.key.page;
    }
    Victim pop() {
        std::pop_heap(victims_->begin(), victims_->end(), staysLonger);
        const Victim victim = victims_->back();
        victims_->pop_back();
        return victim;
    }

    std::optional<std::vector<Victim>> victims_;  // a heap: those to leave first on top
};

template <class Candidates, class Evict>
bool PageMemory::makeRoom(size_t bytes, Need need, uint32_t frame, const Candidates& candidates,
                          const Evict& evict) {
    if (fits(bytes)) return true;
    if (!victims_) {
        victims_ = candidates();
        std::make_heap(victims_->begin(), victims_->end(), staysLonger);
    }
    while (!fits(bytes) && !victims_->empty()) {
        const bool too_soon =
            need == Need::kLater && victims_->front().last_used + kFramesKept > frame;
        if (too_soon) break;
        evict(pop().key);
    }
    return fits(bytes);
}

}  // namespace pietra
