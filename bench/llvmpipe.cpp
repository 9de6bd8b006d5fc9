#include "llvmpipe.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>

#include <stdexcept>
#include <vector>

#include "render/raster/projection.h"

namespace pietra {
namespace {

constexpr const char* kVertexShader = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
uniform mat4 clip_from_lattice;
uniform mat3 view_from_lattice;
out vec3 view_normal;
void main() {
    view_normal = view_from_lattice * normal;
    gl_Position = clip_from_lattice * vec4(position, 1);
})";

constexpr const char* kFragmentShader = R"(#version 330 core
in vec3 view_normal;
out vec4 colour;
void main() {
    vec3 n = normalize(view_normal);
    vec3 light = normalize(vec3(-0.45, 0.65, 0.6));
    float diffuse = max(dot(n, light), 0.0);
    float shine = pow(max(dot(n, normalize(light + vec3(0, 0, 1))), 0.0), 32.0);
    vec3 linear = vec3(0.62, 0.57, 0.50) * (0.15 + 0.85 * diffuse) + 0.1 * shine;
    colour = vec4(sqrt(linear), 1);
})";

void require(bool ok, const char* what) {
    if (!ok) throw std::runtime_error(what);
}

GLuint compile(GLenum kind, const char* source) {
    const GLuint shader = glCreateShader(kind);
    glShaderSource(shader, 1, &source, nullptr);
    glCompileShader(shader);
    GLint ok = 0;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
    require(ok != 0, "a shader of the benchmark does not compile");
    return shader;
}

struct Vertex {
    Vec3f position, normal;
};

}  // namespace

struct Llvmpipe::State {
    EGLDisplay display = EGL_NO_DISPLAY;
    EGLContext context = EGL_NO_CONTEXT;
    PictureSize size;
    int samples;
    GLuint target = 0, resolved = 0;
    GLsizei index_count = 0;

    void makeContext();
    void makeTargets();
    void upload(std::span<const DrawPatch> patches);
    void useProgram(const View& view);
    GLuint makeTarget(int sample_count) const;
};

void Llvmpipe::State::makeContext() {
    display = eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    require(eglInitialize(display, nullptr, nullptr) == EGL_TRUE, "no surfaceless EGL display");
    require(eglBindAPI(EGL_OPENGL_API) == EGL_TRUE, "no OpenGL");
    const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                 3,
                                 EGL_CONTEXT_MINOR_VERSION,
                                 3,
                                 EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                 EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                 EGL_NONE};
    context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes);
    require(context != EGL_NO_CONTEXT, "no OpenGL 3.3 context");
    require(eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) == EGL_TRUE,
            "the OpenGL context cannot be used");
}

GLuint Llvmpipe::State::makeTarget(int sample_count) const {
    GLuint buffers[2], frame = 0;
    glGenRenderbuffers(2, buffers);
    glBindRenderbuffer(GL_RENDERBUFFER, buffers[0]);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, sample_count, GL_RGBA8, size.width,
                                     size.height);
    glBindRenderbuffer(GL_RENDERBUFFER, buffers[1]);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, sample_count, GL_DEPTH_COMPONENT32F,
                                     size.width, size.height);
    glGenFramebuffers(1, &frame);
    glBindFramebuffer(GL_FRAMEBUFFER, frame);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, buffers[0]);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, buffers[1]);
    require(glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE, "no framebuffer");
    return frame;
}

void Llvmpipe::State::makeTargets() {
    target = makeTarget(samples == 1 ? 0 : samples);
    resolved = samples == 1 ? target : makeTarget(0);
}

void Llvmpipe::State::upload(std::span<const DrawPatch> patches) {
    std::vector<Vertex> vertices;
    std::vector<uint32_t> indices;
    for (const DrawPatch& patch : patches) {
        const auto first = uint32_t(vertices.size());
        for (size_t i = 0; i < patch.mesh->vertexCount(); ++i)
            vertices.push_back(
                {Vec3f(patch.mesh->position[i]), decodeNormal(patch.mesh->normal[i])});
        for (const Triangle& t : patch.mesh->triangle)
            for (const uint32_t v : t) indices.push_back(first + v);
    }
    index_count = GLsizei(indices.size());
    GLuint array = 0, buffers[2];
    glGenVertexArrays(1, &array);
    glBindVertexArray(array);
    glGenBuffers(2, buffers);
    glBindBuffer(GL_ARRAY_BUFFER, buffers[0]);
    glBufferData(GL_ARRAY_BUFFER, GLsizeiptr(vertices.size() * sizeof(Vertex)), vertices.data(),
                 GL_STATIC_DRAW);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, buffers[1]);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER, GLsizeiptr(indices.size() * 4), indices.data(),
                 GL_STATIC_DRAW);
    for (const GLuint attribute : {0u, 1u}) {
        glEnableVertexAttribArray(attribute);
        glVertexAttribPointer(attribute, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex),
                              reinterpret_cast<const void*>(sizeof(Vec3f) * attribute));
    }
}

void Llvmpipe::State::useProgram(const View& view) {
    const GLuint program = glCreateProgram();
    glAttachShader(program, compile(GL_VERTEX_SHADER, kVertexShader));
    glAttachShader(program, compile(GL_FRAGMENT_SHADER, kFragmentShader));
    glLinkProgram(program);
    glUseProgram(program);
    // Reversed depth with the far plane at infinity: z_clip = near, w = depth, in [-1, 1] mapped
    // to [0.5, 1]; GREATER passes.
    const Vec3d right = view.right() * (2 * view.focal_px() / size.width);
    const Vec3d up = view.up() * (2 * view.focal_px() / size.height);
    const Vec3d forward = -view.back();
    GLfloat clip[16] = {};
    for (int k = 0; k < 3; ++k) {
        clip[4 * k] = GLfloat(right[k]);
        clip[4 * k + 1] = GLfloat(up[k]);
        clip[4 * k + 3] = GLfloat(forward[k]);
    }
    clip[12] = GLfloat(-glm::dot(right, view.eye()));
    clip[13] = GLfloat(-glm::dot(up, view.eye()));
    clip[14] = 1;
    clip[15] = GLfloat(-glm::dot(forward, view.eye()));
    glUniformMatrix4fv(glGetUniformLocation(program, "clip_from_lattice"), 1, GL_FALSE, clip);
    GLfloat rotation[9];
    for (int k = 0; k < 3; ++k) {
        rotation[3 * k] = GLfloat(view.right()[k]);
        rotation[3 * k + 1] = GLfloat(view.up()[k]);
        rotation[3 * k + 2] = GLfloat(view.back()[k]);
    }
    glUniformMatrix3fv(glGetUniformLocation(program, "view_from_lattice"), 1, GL_FALSE, rotation);
}

Llvmpipe::Llvmpipe(const View& view, std::span<const DrawPatch> patches, int samples)
    : state_(std::make_unique<State>()) {
    state_->size = view.size();
    state_->samples = samples;
    state_->makeContext();
    state_->makeTargets();
    state_->upload(patches);
    state_->useProgram(view);
    glViewport(0, 0, view.size().width, view.size().height);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_GREATER);
    glClearDepth(0);
    glClearColor(0, 0, 0, 1);
}

Llvmpipe::~Llvmpipe() {
    eglMakeCurrent(state_->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(state_->display, state_->context);
}

void Llvmpipe::draw() {
    State& s = *state_;
    eglMakeCurrent(s.display, EGL_NO_SURFACE, EGL_NO_SURFACE, s.context);
    glBindFramebuffer(GL_FRAMEBUFFER, s.target);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glDrawElements(GL_TRIANGLES, s.index_count, GL_UNSIGNED_INT, nullptr);
    if (s.resolved != s.target) {
        glBindFramebuffer(GL_READ_FRAMEBUFFER, s.target);
        glBindFramebuffer(GL_DRAW_FRAMEBUFFER, s.resolved);
        glBlitFramebuffer(0, 0, s.size.width, s.size.height, 0, 0, s.size.width, s.size.height,
                          GL_COLOR_BUFFER_BIT, GL_NEAREST);
    }
    glFinish();
}

std::string Llvmpipe::renderer() const {
    return reinterpret_cast<const char*>(glGetString(GL_RENDERER));
}

size_t Llvmpipe::pixelsCovered() {
    State& s = *state_;
    std::vector<Rgba8> colour(size_t(s.size.width) * size_t(s.size.height));
    glBindFramebuffer(GL_READ_FRAMEBUFFER, s.resolved);
    glReadPixels(0, 0, s.size.width, s.size.height, GL_RGBA, GL_UNSIGNED_BYTE, colour.data());
    size_t covered = 0;
    for (const Rgba8& c : colour) covered += c.r != 0;
    return covered;
}

}  // namespace pietra
