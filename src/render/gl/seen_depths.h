#pragma once
// What pictures hide (multires/seen_depth.h), found on the GPU and read back without waiting: a
// picture or two late. Needs a current context.

#include <optional>

#include "gpu/program.h"
#include "multires/seen_depth.h"

namespace pietra {

class SeenDepths {
public:
    SeenDepths();

    /// Has the depths of a picture read: `depth` is a texture of its size, as Picture::depth.
    /// Nothing happens while an earlier picture's are on their way.
    void begin(const Camera& camera, const PictureSize& size, GLuint depth);
    /// Of the last picture that has been read, or null. Valid until the next call.
    const SeenDepth* latest();

private:
    void resize(const PictureSize& size);

    GlProgram program_;
    GlVertexArray no_vertices_;
    GlTexture texture_;
    GlFramebuffer frame_;
    GlBuffer buffer_;
    GlFence read_;                    // 0: nothing is on its way
    SeenDepth coming_;
    std::optional<SeenDepth> latest_;
};

}  // namespace pietra
