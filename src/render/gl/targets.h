#pragma once
// What is drawn into, and the picture made of it: samples in sRGB with reversed depth, and from
// them one colour and one depth a pixel. Row 0 is the top row. Needs a current context.

#include <vector>

#include "multires/view.h"
#include "render/gl/frame_block.h"
#include "render/gl/program.h"
#include "render/gl/upload_ring.h"
#include "render/picture.h"
#include "render/shading.h"

namespace pietra {

class Targets {
public:
    Targets(const PictureSize& size, int samples);

    const PictureSize& size() const { return size_; }
    void resize(const PictureSize& size);
    /// Empties the samples; the background is that of `settings`.
    void clear(const ShadeSettings& settings);
    /// Binds what is drawn into.
    void bind() const;
    /// Makes the picture. `reference`: what the depth buffer holds, times the depth in input units.
    void finish(float reference, bool show_depth, UploadRing& ring);
    /// Waits for the GPU. Colour and depth of the finished picture.
    void read(Picture& picture) const;
    /// Copies the finished picture to the window's lower left corner.
    void present() const;

private:
    struct RangeStep {
        PictureSize size;
        GlTexture texture;
        GlFramebuffer frame;
    };
    void makeRangeSteps();
    void findDepthRange() const;
    GlTexture makeTexture(GLenum format, bool multisampled) const;
    void paintBackground(const ShadeSettings& settings);

    PictureSize size_;
    const int samples_;
    GlTexture colour_, depth_, finished_colour_, finished_depth_, background_;
    GlFramebuffer drawn_, finished_;
    std::vector<RangeStep> range_steps_;
    GlVertexArray no_vertices_;
    GlProgram finish_program_, depth_program_, first_range_program_, range_program_;
    bool background_painted_ = false;
    Rgba8 background_top_, background_bottom_;
};

}  // namespace pietra
