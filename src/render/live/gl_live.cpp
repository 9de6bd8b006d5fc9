#include "render/live/gl_live.h"

namespace pietra {

GlLive::GlLive(GlContext context, const PictureSize& size, size_t vram_bytes)
    : context_(std::move(context)), renderer_(size, 4, vram_bytes) {
    renderer_.resize(size, 1);
}

void GlLive::draw(std::span<const ModelPatches> models, const LiveSettings& settings) {
    placement_.update();
    const ModelPatches& first = models.front();
    renderer_.resize(first.view.size(), settings.samples);
    renderer_.begin(first.view, *first.lattice, settings.shade);
    for (const ModelPatches& model : models) {
        renderer_.setModel(model.view, *model.lattice);
        if (settings.leave_out_hidden)
            renderer_.drawUnhidden(model.patches, settings.hidden);
        else
            renderer_.draw(model.patches);
    }
    renderer_.finish();
    if (settings.camera != nullptr && settings.samples == 1) renderer_.lookBack(*settings.camera);
}

}  // namespace pietra
