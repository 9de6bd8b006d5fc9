#include <optional>

#include "base/worker_placement.h"
#include "render/live/live_renderer.h"

namespace pietra {
namespace {

class RasterLive : public LiveRenderer {
public:
    PageSink* sink() override { return nullptr; }

    void draw(std::span<const ModelPatches> models, const LiveSettings& settings) override {
        placement_.update();
        const ModelPatches& first = models.front();
        if (!rasteriser_ || samples_ != settings.samples)
            rasteriser_.emplace(first.view, *first.lattice, settings.samples, settings.shade);
        else
            rasteriser_->restart(first.view, *first.lattice, settings.shade);
        samples_ = settings.samples;
        picture_ = &rasteriser_->drawAll(models, settings.leave_out_hidden, settings.hidden);
        if (settings.camera != nullptr && samples_ == 1)
            seen_ = seenDepth(*settings.camera, picture_->size, picture_->depth);
    }
    void wait() override {}
    const Picture& picture() override { return *picture_; }
    float depthAt(int x, int y) override { return picture_->depth[picture_->index(x, y)]; }
    const SeenDepth* seen() override { return seen_ ? &*seen_ : nullptr; }
    double gpuMs() const override { return 0; }

private:
    WorkerPlacement placement_;
    std::optional<Rasteriser> rasteriser_;
    int samples_ = 0;
    const Picture* picture_ = nullptr;
    std::optional<SeenDepth> seen_;
};

}  // namespace

std::unique_ptr<LiveRenderer> makeRasterLive() {
    return std::make_unique<RasterLive>();
}

}  // namespace pietra
