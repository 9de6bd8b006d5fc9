#include "render/gl/seen_depths.h"

#include <fmt/format.h>

#include "render/gl/frame_block.h"
#include "render/gl/shader_text.h"

namespace pietra {

SeenDepths::SeenDepths()
    : program_(makeProgram({{GL_VERTEX_SHADER, {"picture_finish.vert.glsl"}},
                            {GL_FRAGMENT_SHADER, {"seen_depth.frag.glsl"}}},
                           fmt::format("#define TILE {}\n", SeenDepth::kTilePixels))) {
    GLuint name = 0;
    glCreateVertexArrays(1, &name);
    no_vertices_ = GlVertexArray(name);
}

void SeenDepths::resize(const PictureSize& size) {
    coming_.size = size;
    coming_.farthest.resize(size_t(coming_.columns()) * size_t(coming_.rows()));
    GLuint name = 0;
    glCreateTextures(GL_TEXTURE_2D, 1, &name);
    texture_ = GlTexture(name);
    glTextureStorage2D(texture_, 1, GL_R32F, coming_.columns(), coming_.rows());
    glCreateFramebuffers(1, &name);
    frame_ = GlFramebuffer(name);
    glNamedFramebufferTexture(frame_, GL_COLOR_ATTACHMENT0, texture_, 0);
    glCreateBuffers(1, &name);
    buffer_ = GlBuffer(name);
    glNamedBufferStorage(buffer_, GLsizeiptr(coming_.farthest.size() * sizeof(float)), nullptr,
                         GL_CLIENT_STORAGE_BIT);
}

void SeenDepths::begin(const Camera& camera, const PictureSize& size, GLuint depth) {
    (void)latest();
    if (read_ != nullptr) return;
    if (texture_ == 0 || size.width != coming_.size.width || size.height != coming_.size.height)
        resize(size);
    coming_.camera = camera;
    glBindFramebuffer(GL_FRAMEBUFFER, frame_);
    glViewport(0, 0, coming_.columns(), coming_.rows());
    for (const GLenum off : {GL_DEPTH_TEST, GL_CULL_FACE, GL_BLEND, GL_SCISSOR_TEST})
        glDisable(off);
    glBindTextureUnit(kDepthUnit, depth);
    glBindSampler(kDepthUnit, 0);
    glBindVertexArray(no_vertices_);
    glUseProgram(program_);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glUseProgram(0);
    glBindVertexArray(0);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, buffer_);
    glPixelStorei(GL_PACK_ALIGNMENT, 4);
    glReadPixels(0, 0, coming_.columns(), coming_.rows(), GL_RED, GL_FLOAT, nullptr);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    read_ = GlFence(glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0));
}

const SeenDepth* SeenDepths::latest() {
    if (read_ != nullptr &&
        glClientWaitSync(read_, GL_SYNC_FLUSH_COMMANDS_BIT, 0) != GL_TIMEOUT_EXPIRED) {
        read_ = GlFence();
        glGetNamedBufferSubData(buffer_, 0,
                                GLsizeiptr(coming_.farthest.size() * sizeof(float)),
                                coming_.farthest.data());
        latest_ = coming_;
    }
    return latest_ ? &*latest_ : nullptr;
}

}  // namespace pietra
