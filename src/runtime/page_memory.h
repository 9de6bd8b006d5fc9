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
    /// A page used in the last frames leaves only for one that is to be drawn now.
    static constexpr uint32_t kFramesKept = 60;

    explicit PageMemory(size_t bytes) : budget(bytes) {}

    const size_t budget;
    size_t used = 0;
    size_t reserved = 0;  ///< for pages on their way

    bool fits(size_t bytes) const { return used + reserved + bytes <= budget; }
    /// Forgets what may leave: at the beginning of a frame.
    void beginFrame() { victims_.reset(); }

    /// Evicts until so many bytes fit, or nothing more may leave; true if they fit. `candidates()`
    /// lists what may leave, asked for once a frame; evict(key) is false where it may not yet,
    /// because others must leave before it.
    template <class Candidates, class Evict>
    bool makeRoom(size_t bytes, Need need, uint32_t frame, const Candidates& candidates,
                  const Evict& evict);

private:
    std::optional<std::vector<Victim>> victims_;  // those to leave first come last
};

template <class Candidates, class Evict>
bool PageMemory::makeRoom(size_t bytes, Need need, uint32_t frame, const Candidates& candidates,
                          const Evict& evict) {
    if (fits(bytes)) return true;
    if (!victims_) {
        victims_ = candidates();
        std::sort(victims_->begin(), victims_->end(), [](const Victim& a, const Victim& b) {
            return a.last_used != b.last_used   ? a.last_used > b.last_used
                   : a.key.model != b.key.model ? a.key.model > b.key.model
                                                : a.key.page < b.key.page;
        });
    }
    for (bool again = true; again && !fits(bytes);) {
        again = false;
        for (size_t i = victims_->size(); i-- > 0 && !fits(bytes);) {
            const Victim victim = (*victims_)[i];
            if (need != Need::kDraw && victim.last_used + kFramesKept > frame) break;
            if (!evict(victim.key)) continue;
            victims_->erase(victims_->begin() + ptrdiff_t(i));
            again = true;
        }
    }
    return fits(bytes);
}

}  // namespace pietra
