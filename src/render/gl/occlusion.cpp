#include "render/gl/occlusion.h"

#include <vector>

#include "render/gl/shader_text.h"

namespace pietra {
namespace {

constexpr size_t kGroup = 64;                           // of cull_commands.comp.glsl
constexpr GLint kTurnLocation = 0, kTurnsLocation = 1;  // of cull_block.glsl

GlBuffer makeBuffer(size_t bytes) {
    GLuint name = 0;
    glCreateBuffers(1, &name);
    glNamedBufferStorage(name, GLsizeiptr(bytes), nullptr, 0);
    const GLuint zero = 0;
    glClearNamedBufferData(name, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
    return GlBuffer(name);
}

GlProgram makeStep(std::string_view defines) {
    return makeProgram({{GL_COMPUTE_SHADER, {"cull_block.glsl", "cull_commands.comp.glsl"}}},
                       defines);
}

}  // namespace

OcclusionCuller::OcclusionCuller(size_t draws, size_t arena_bytes, bool wait)
    : wait_(wait),
      seen_(makeBuffer(draws * sizeof(DrawCommand))),
      found_(makeBuffer(draws * sizeof(DrawCommand))),
      last_(makeBuffer((arena_bytes / kSlotBytes + 1) * 4)),
      now_(makeBuffer((arena_bytes / kSlotBytes + 1) * 4)),
      begin_(makeStep("#define BEGIN\n")),
      boxes_(makeProgram(
          {{GL_VERTEX_SHADER, {"frame_block.glsl", "cull_block.glsl", "cull_box.vert.glsl"}},
           {GL_FRAGMENT_SHADER, {"cull_block.glsl", "cull_box.frag.glsl"}}},
          "#define BASE 0\n")),
      end_(makeStep("")) {
    GLuint name = 0;
    glCreateVertexArrays(1, &name);
    no_vertices_ = GlVertexArray(name);
}

void OcclusionCuller::compute(const GlProgram& program, size_t count) const {
    glUseProgram(program);
    glDispatchCompute(GLuint((count + kGroup - 1) / kGroup), 1, 1);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_COMMAND_BARRIER_BIT);
}

void OcclusionCuller::begin(size_t count) {
    const GLuint zero = 0;
    glClearNamedBufferData(now_, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kSeenBinding, seen_);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kFoundBinding, found_);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kLastBinding, last_);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kNowBinding, now_);
    compute(begin_, count);
}

void OcclusionCuller::end(size_t count, bool all) {
    for (const GlProgram* program : {&boxes_, &end_}) {
        glProgramUniform1ui(*program, kTurnLocation, turn_);
        glProgramUniform1ui(*program, kTurnsLocation, all ? 1 : kTurns);
    }
    glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    glDepthMask(GL_FALSE);
    glDepthFunc(GL_GEQUAL);
    glDisable(GL_CULL_FACE);
    glUseProgram(boxes_);
    glBindVertexArray(no_vertices_);
    glDrawArraysInstanced(GL_TRIANGLES, 0, 36, GLsizei(count));
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glDepthMask(GL_TRUE);
    glDepthFunc(GL_GREATER);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    if (wait_) glFinish();
    compute(end_, count);
}

std::vector<uint8_t> OcclusionCuller::drawn(size_t count) const {
    if (wait_) glFinish();
    std::vector<DrawCommand> commands(count);
    std::vector<uint8_t> drawn(count, 0);
    for (const GLuint buffer : {seen(), found()}) {
        glGetNamedBufferSubData(buffer, 0, GLsizeiptr(count * sizeof(DrawCommand)),
                                commands.data());
        for (size_t i = 0; i < count; ++i) drawn[i] |= commands[i].instances != 0;
    }
    return drawn;
}

}  // namespace pietra
