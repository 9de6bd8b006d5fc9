#pragma once
// The models of a scene that are one mesh each, adapted (live_model.h): their pages, and their
// chunks where they are drawn from. Scene has the frame's order: publish(), adapt() each, then
// load().

#include "runtime/live_pool.h"
#include "runtime/live_uploads.h"
#include "runtime/page_pool.h"
#include "runtime/scene.h"

namespace pietra {

class SceneMeshes {
public:
    /// `first_model`: the number of the first one of them in the sink. Throws what opening throws.
    SceneMeshes(const std::vector<const ModelReader*>& readers, const SceneSettings& settings,
                uint32_t first_model);

    LivePool& pool() { return pool_; }
    const LivePool& pool() const { return pool_; }
    size_t uploadedBytes() const { return uploads_.bytes(); }
    /// Some chunks did not fit the sink, or more of them would be needed than fit.
    bool shortOfSink() const { return pool_.shortOfTriangles() || !uploads_fit_; }

    /// Copies all that is coarsest. Throws MemoryError.
    void uploadRoots(size_t capacity_bytes);
    /// To a view, in the memory that pages leave. Returns the largest error, in pixels.
    double adapt(uint32_t i, const FrameRequest& request, double pixels, PagePool& pages,
                 ModelFrame& out);

private:
    LivePool pool_;
    LiveUploads uploads_;
    const uint32_t first_model_;
    const double adapt_ms_;
    bool uploads_fit_ = true, may_upload_ = true;
};

}  // namespace pietra
