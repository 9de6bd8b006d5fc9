#pragma once
// What is drawn into, and the picture made of it: samples in sRGB with reversed depth, and from
// them one colour and one depth a pixel. Row 0 is the top row. Needs a current context.

#include <optional>
#include <vector>

#include "gpu/program.h"
#include "multires/view.h"
#include "render/gl/frame_block.h"
#include "render/gl/upload_ring.h"
#include "render/picture.h"
#include "render/shading.h"

namespace pietra {

class Targets {
public:
    Targets(const PictureSize& size, int samples);

    const PictureSize& size() const { return size_; }
    /// Compiles what a number of samples needs, when it is first asked for.
    void resize(const PictureSize& size, int samples);
    /// Empties the samples; the background is that of `settings`.
    void clear(const ShadeSettings& settings);
    /// Binds what is drawn into.
    void bind() const;
    /// Makes the picture. `reference`: what the depth buffer holds, times the depth in input units.
    void finish(float reference, bool show_depth, UploadRing& ring);
    /// Waits for the GPU. Colour and depth of the finished picture.
    void read(Picture& picture) const;
    /// Waits for the GPU. Of the finished picture, for a pixel within it.
    float depthAt(int x, int y) const;
    /// As Picture::depth.
    GLuint finishedDepth() const { return finished_depth_; }
    /// Copies the finished picture to the window's lower left corner.
    void present() const;

private:
    /// What the number of samples matters for.
    struct FinishPrograms {
        explicit FinishPrograms(int samples);
        GlProgram picture, depth_picture, first_range;
    };
    struct RangeStep {
        PictureSize size;
        GlTexture texture;
        GlFramebuffer frame;
    };
    const FinishPrograms& programs() const { return *programs_[samples_ == 4]; }
    void makeRangeSteps();
    void findDepthRange() const;
    GlTexture makeTexture(GLenum format, bool multisampled) const;
    void paintBackground(const ShadeSettings& settings);

    PictureSize size_;
    int samples_ = 0;
    GlTexture colour_, depth_, finished_colour_, finished_depth_, background_;
    GlFramebuffer drawn_, finished_;
    std::vector<RangeStep> range_steps_;
    GlVertexArray no_vertices_;
    std::optional<FinishPrograms> programs_[2];  // with 1 and 4 samples
    GlProgram range_program_;
    bool background_painted_ = false;
    Rgba8 background_top_, background_bottom_;
};

}  // namespace pietra
