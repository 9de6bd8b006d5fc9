#pragma once
// Pictures of a scene by OpenGL, in a context of its own or in a window's.

#include "base/worker_placement.h"
#include "gpu/context.h"
#include "render/gl/renderer.h"
#include "render/live/live_renderer.h"

namespace pietra {

/// All calls, also that of the destructor, in the thread in which the context is current.
class GlLive : public LiveRenderer {
public:
    /// Memory for pages as GlRenderer takes it. Compiles all there is to compile.
    GlLive(GlContext context, const PictureSize& size, size_t vram_bytes);

    PageSink* sink() override { return &renderer_; }
    void draw(std::span<const ModelPatches> models, const LiveSettings& settings) override;
    void wait() override { renderer_.wait(); }
    const Picture& picture() override { return picture_ = renderer_.readPicture(); }
    float depthAt(int x, int y) override { return renderer_.depthAt(x, y); }
    const SeenDepth* seen() override { return renderer_.seen(); }
    double gpuMs() const override { return renderer_.statistics().gpu_ms; }

    /// Copies the picture to the window's lower left corner.
    void present() { renderer_.present(); }

private:
    WorkerPlacement placement_;  // of those that adapt meshes
    GlContext context_;
    GlRenderer renderer_;
    Picture picture_;
};

}  // namespace pietra
