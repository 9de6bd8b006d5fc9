#include "render/gl/targets.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>

#include "base/check.h"
#include "render/gl/shader_text.h"

namespace pietra {
namespace {

constexpr int kRangeFactor = 16;  // of a step of depth_range.frag.glsl

GlFramebuffer makeFramebuffer(GLuint depth, std::initializer_list<GLuint> colours) {
    GLuint name = 0;
    glCreateFramebuffers(1, &name);
    GlFramebuffer frame(name);
    GLenum buffers[2] = {}, attachment = GL_COLOR_ATTACHMENT0;
    GLsizei count = 0;
    for (const GLuint colour : colours) {
        glNamedFramebufferTexture(frame, attachment, colour, 0);
        buffers[count++] = attachment++;
    }
    if (depth != 0) glNamedFramebufferTexture(frame, GL_DEPTH_ATTACHMENT, depth, 0);
    glNamedFramebufferDrawBuffers(frame, count, buffers);
    CHECK_EQ(glCheckNamedFramebufferStatus(frame, GL_DRAW_FRAMEBUFFER),
             GLenum(GL_FRAMEBUFFER_COMPLETE));
    return frame;
}

}  // namespace

Targets::FinishPrograms::FinishPrograms(int samples) {
    const std::string defines = fmt::format("#define SAMPLES {}\n", samples);
    const auto finishProgram = [&](const char* more) {
        return makeProgram({{GL_VERTEX_SHADER, {"picture_finish.vert.glsl"}},
                            {GL_FRAGMENT_SHADER,
                             {"srgb.glsl", "picture_finish.glsl", "picture_finish.frag.glsl"}}},
                           defines + more);
    };
    picture = finishProgram("");
    depth_picture = finishProgram("#define SHOW_DEPTH\n");
    first_range =
        makeProgram({{GL_VERTEX_SHADER, {"picture_finish.vert.glsl"}},
                     {GL_FRAGMENT_SHADER, {"picture_finish.glsl", "depth_range.frag.glsl"}}},
                    defines + "#define FIRST\n");
}

Targets::Targets(const PictureSize& size, int samples) {
    range_program_ = makeProgram({{GL_VERTEX_SHADER, {"picture_finish.vert.glsl"}},
                                  {GL_FRAGMENT_SHADER, {"depth_range.frag.glsl"}}});
    GLuint name = 0;
    glCreateVertexArrays(1, &name);
    no_vertices_ = GlVertexArray(name);
    resize(size, samples);
}

GlTexture Targets::makeTexture(GLenum format, bool multisampled) const {
    GLuint name = 0;
    glCreateTextures(multisampled ? GL_TEXTURE_2D_MULTISAMPLE : GL_TEXTURE_2D, 1, &name);
    if (multisampled)
        glTextureStorage2DMultisample(name, samples_, format, size_.width, size_.height, GL_TRUE);
    else
        glTextureStorage2D(name, 1, format, size_.width, size_.height);
    return GlTexture(name);
}

void Targets::resize(const PictureSize& size, int samples) {
    CHECK(samples == 1 || samples == 4);
    size_ = size;
    samples_ = samples;
    std::optional<FinishPrograms>& programs = programs_[samples == 4];
    if (!programs) programs.emplace(samples);
    const bool many = samples_ > 1;
    colour_ = makeTexture(GL_SRGB8_ALPHA8, many);
    depth_ = makeTexture(GL_DEPTH_COMPONENT32F, many);
    finished_colour_ = makeTexture(GL_SRGB8_ALPHA8, false);
    finished_depth_ = makeTexture(GL_R32F, false);
    drawn_ = makeFramebuffer(depth_, {colour_});
    finished_ = makeFramebuffer(0, {finished_colour_, finished_depth_});
    makeRangeSteps();
    GLuint name = 0;
    glCreateTextures(GL_TEXTURE_2D, 1, &name);
    background_ = GlTexture(name);
    glTextureStorage2D(background_, 1, GL_SRGB8_ALPHA8, 4, size.height);
    background_painted_ = false;
}

void Targets::paintBackground(const ShadeSettings& settings) {
    if (background_painted_ && settings.background_top == background_top_ &&
        settings.background_bottom == background_bottom_)
        return;
    std::vector<Rgba8> rows;
    for (int y = 0; y < size_.height; ++y)
        for (const Rgba8& colour : backgroundRow(settings, y, size_.height)) rows.push_back(colour);
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
    glTextureSubImage2D(background_, 0, 0, 0, 4, size_.height, GL_RGBA, GL_UNSIGNED_BYTE,
                        rows.data());
    background_painted_ = true;
    background_top_ = settings.background_top;
    background_bottom_ = settings.background_bottom;
}

void Targets::clear(const ShadeSettings& settings) {
    paintBackground(settings);
    bind();
    glDisable(GL_SCISSOR_TEST);
    glDepthMask(GL_TRUE);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    constexpr float kBlack[4] = {0, 0, 0, 0}, kNothing = 0;
    glClearNamedFramebufferfv(drawn_, GL_COLOR, 0, kBlack);
    glClearNamedFramebufferfv(drawn_, GL_DEPTH, 0, &kNothing);
}

void Targets::bind() const {
    glBindFramebuffer(GL_FRAMEBUFFER, drawn_);
    glViewport(0, 0, size_.width, size_.height);
    glEnable(GL_FRAMEBUFFER_SRGB);
}

void Targets::makeRangeSteps() {
    range_steps_.clear();
    PictureSize size = size_;
    do {
        size.width = (size.width + kRangeFactor - 1) / kRangeFactor;
        size.height = (size.height + kRangeFactor - 1) / kRangeFactor;
        GLuint name = 0;
        glCreateTextures(GL_TEXTURE_2D, 1, &name);
        GlTexture texture(name);
        glTextureStorage2D(texture, 1, GL_RG32F, size.width, size.height);
        GlFramebuffer frame = makeFramebuffer(0, {texture});
        range_steps_.push_back({size, std::move(texture), std::move(frame)});
    } while (size.width > 1 || size.height > 1);
}

/// Leaves the texture with the result bound.
void Targets::findDepthRange() const {
    glUseProgram(programs().first_range);
    for (const RangeStep& step : range_steps_) {
        glBindFramebuffer(GL_FRAMEBUFFER, step.frame);
        glViewport(0, 0, step.size.width, step.size.height);
        glDrawArrays(GL_TRIANGLES, 0, 3);
        glBindTextureUnit(kRangeUnit, step.texture);
        glUseProgram(range_program_);
    }
}

void Targets::finish(float reference, bool show_depth, UploadRing& ring) {
    const FinishBlock block{reference, 0, size_.width, size_.height};
    const RingSpace space = ring.take(sizeof(block), 256);
    std::memcpy(space.memory, &block, sizeof(block));
    glBindBufferRange(GL_UNIFORM_BUFFER, kFinishBinding, ring.buffer(), space.offset,
                      sizeof(block));
    glBindTextureUnit(kColourUnit, colour_);
    glBindTextureUnit(kDepthUnit, depth_);
    glBindTextureUnit(kBackgroundUnit, background_);
    for (const GLuint unit : {kColourUnit, kDepthUnit, kBackgroundUnit, kRangeUnit})
        glBindSampler(unit, 0);

    glEnable(GL_FRAMEBUFFER_SRGB);
    for (const GLenum off : {GL_DEPTH_TEST, GL_CULL_FACE, GL_BLEND, GL_SCISSOR_TEST})
        glDisable(off);
    glBindVertexArray(no_vertices_);
    glBindTextureUnit(kRangeUnit, 0);
    if (show_depth) findDepthRange();
    glBindFramebuffer(GL_FRAMEBUFFER, finished_);
    glViewport(0, 0, size_.width, size_.height);
    glUseProgram(show_depth ? programs().depth_picture : programs().picture);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    ring.used();
}

void Targets::read(Picture& picture) const {
    picture.size = size_;
    picture.colour.resize(picture.pixelCount());
    picture.depth.resize(picture.pixelCount());
    glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    glPixelStorei(GL_PACK_ALIGNMENT, 4);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, finished_);
    glNamedFramebufferReadBuffer(finished_, GL_COLOR_ATTACHMENT0);
    glReadPixels(0, 0, size_.width, size_.height, GL_RGBA, GL_UNSIGNED_BYTE, picture.colour.data());
    glNamedFramebufferReadBuffer(finished_, GL_COLOR_ATTACHMENT1);
    glReadPixels(0, 0, size_.width, size_.height, GL_RED, GL_FLOAT, picture.depth.data());
}

float Targets::depthAt(int x, int y) const {
    float depth = 0;
    glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, finished_);
    glNamedFramebufferReadBuffer(finished_, GL_COLOR_ATTACHMENT1);
    glReadPixels(x, y, 1, 1, GL_RED, GL_FLOAT, &depth);
    return depth;
}

void Targets::present() const {
    glDisable(GL_FRAMEBUFFER_SRGB);
    glNamedFramebufferReadBuffer(finished_, GL_COLOR_ATTACHMENT0);
    glBlitNamedFramebuffer(finished_, 0, 0, 0, size_.width, size_.height, 0, size_.height,
                           size_.width, 0, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
}

}  // namespace pietra
