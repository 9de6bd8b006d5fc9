#pragma once
// The models of a scene whose pages are patches: what of them is drawn, and which pages are missing
// for that, or will be. Scene has the frame's order: beginFrame(), select() each, wantMissing(),
// prefetch(), pages().load().

#include <vector>

#include "runtime/page_pool.h"
#include "runtime/scene.h"

namespace pietra {

class ScenePatches {
public:
    /// As PagePool.
    ScenePatches(const std::vector<const ModelReader*>& readers, size_t table_bytes,
                 const SceneSettings& settings);

    size_t size() const { return models_.size(); }
    PagePool& pages() { return pages_; }
    const PagePool& pages() const { return pages_; }
    /// Of the pages that this frame needs and has.
    size_t usedBytes() const { return used_bytes_; }

    void beginFrame();
    /// Fills in all of `out` but its view.
    void select(uint32_t m, const FrameRequest& request, double pixels, ModelFrame& out);
    /// Of all models, largest error first.
    void wantMissing();
    /// From now on, what a frame from there would lack, and this one does not.
    void prefetch(const Camera& camera, const FrameRequest& request, double pixels,
                  bool next_level);
    void wantPrefetched();

private:
    struct Missing {
        PageKey key;
        float pixels;
    };

    bool mayBeInside(uint32_t m, const View& view);
    bool hasPagesForEye(uint32_t m, const View& view);
    EyeSide sideOf(const SceneModel& model, const View& view) const;
    void describe(const SceneModel& model, uint32_t m, bool show_error, ModelFrame& out) const;

    SceneModels models_;
    PagePool pages_;
    uint32_t frame_number_ = PageMemory::kFramesKept;
    std::vector<Missing> missing_;
    std::vector<PageKey> missing_for_eye_;
    std::vector<NodeIndex> cut_for_eye_;    // what tells where the eye is
    std::vector<PageIndex> pages_for_eye_;  // that hold it
    size_t used_bytes_ = 0;
    std::vector<PageKey> ahead_[2];      // to be prefetched
    std::vector<PageRequest> requests_;  // scratch
};

}  // namespace pietra
