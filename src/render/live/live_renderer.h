#pragma once
// Pictures of a scene, one after the other, for a window or a measurement: by the processor or by
// OpenGL, whoever asks need not know which.

#include <memory>
#include <span>

#include "multires/page_sink.h"
#include "multires/seen_depth.h"
#include "render/picture.h"
#include "render/raster/rasteriser.h"
#include "render/shading.h"

namespace pietra {

struct LiveSettings {
    ShadeSettings shade;
    int samples = 1;  ///< or 4
    /// Patches that others hide may be left out: this changes no pixel.
    bool leave_out_hidden = true;
    /// Takes the ids of those left out, and has draw() wait for them; null: nobody asks.
    std::vector<uint32_t>* hidden = nullptr;
    /// The picture's camera: seen() shall tell what this picture hides, if it has one sample a
    /// pixel. Null: nobody asks.
    const Camera* camera = nullptr;
};

class LiveRenderer {
public:
    virtual ~LiveRenderer() = default;
    /// What pages must be in to be drawn; null: meshes are drawn where they are.
    virtual PageSink* sink() = 0;
    /// Draws a picture of at least one model, the first of which sets the size. May return before
    /// all of it is drawn.
    virtual void draw(std::span<const ModelPatches> models, const LiveSettings& settings) = 0;
    /// Until the picture is drawn, as the two that follow.
    virtual void wait() = 0;
    /// Valid until the next draw().
    virtual const Picture& picture() = 0;
    /// Of a pixel of the picture: its depth as in Picture.
    virtual float depthAt(int x, int y) = 0;
    /// What the last picture of those drawn with a camera hides of which that is known without
    /// waiting; null before there is one. Valid until the next call of draw() or this.
    virtual const SeenDepth* seen() = 0;
    /// What the GPU was busy for with a picture lately, by its own clock; 0: not known.
    virtual double gpuMs() const = 0;
};

std::unique_ptr<LiveRenderer> makeRasterLive();

}  // namespace pietra
