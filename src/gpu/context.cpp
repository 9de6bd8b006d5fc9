#include "gpu/context.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#define EGL_NO_X11
#include <epoxy/egl.h>
#include <epoxy/gl.h>

namespace pietra {

struct GlContext::State {
    EGLDisplay display = EGL_NO_DISPLAY;
    EGLContext context = EGL_NO_CONTEXT;  // none: adopted
    GlMessageHandler handler;
    std::string renderer, version;

    /// note: the display is left initialised: it is the process's, others may use it.
    ~State();
    bool makeCurrent() const { return use(context); }
    bool leave() const { return use(EGL_NO_CONTEXT); }
    /// note: the API is a property of the thread, and what is current is so for one API.
    bool use(EGLContext which) const {
        return eglBindAPI(EGL_OPENGL_API) == EGL_TRUE &&
               eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, which) == EGL_TRUE;
    }
    void listen();
};

namespace {

constexpr const char* kNeededExtensions[] = {"GL_ARB_shader_draw_parameters"};

std::string textOf(GLenum name) {
    const auto* text = reinterpret_cast<const char*>(glGetString(name));
    return text != nullptr ? text : "";
}

/// What the current context lacks; empty if it will do.
std::string missing() {
    if (!epoxy_is_desktop_gl()) return "is no desktop OpenGL";
    if (epoxy_gl_version() < 45)
        return fmt::format("offers only {}.{}", epoxy_gl_version() / 10, epoxy_gl_version() % 10);
    for (const char* extension : kNeededExtensions)
        if (!epoxy_has_gl_extension(extension)) return fmt::format("lacks {}", extension);
    return {};
}

void GLAPIENTRY receive(GLenum, GLenum type, GLuint, GLenum, GLsizei length, const GLchar* text,
                        const void* handler) {
    const bool error = type == GL_DEBUG_TYPE_ERROR || type == GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR;
    (*static_cast<const GlMessageHandler*>(handler))({{text, size_t(length)}, error});
}

bool hasWord(const char* list, std::string_view word) {
    const std::string padded = fmt::format(" {} ", list != nullptr ? list : "");
    return padded.find(fmt::format(" {} ", word)) != padded.npos;
}

/// Displays to try, best first.
std::vector<EGLDisplay> displays() {
    std::vector<EGLDisplay> found;
    const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    if (hasWord(client, "EGL_EXT_platform_device") &&
        hasWord(client, "EGL_EXT_device_enumeration")) {
        std::array<EGLDeviceEXT, 32> devices{};
        EGLint count = 0;
        if (eglQueryDevicesEXT(EGLint(devices.size()), devices.data(), &count) != EGL_TRUE)
            count = 0;
        const auto software = [](EGLDeviceEXT device) {
            return hasWord(eglQueryDeviceStringEXT(device, EGL_EXTENSIONS),
                           "EGL_MESA_device_software");
        };
        const auto end = devices.begin() + count;
        std::stable_partition(devices.begin(), end, [&](auto d) { return !software(d); });
        for (auto device = devices.begin(); device != end; ++device)
            found.push_back(eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, *device, nullptr));
    }
    if (hasWord(client, "EGL_MESA_platform_surfaceless"))
        found.push_back(
            eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr));
    std::erase(found, EGL_NO_DISPLAY);
    return found;
}

EGLContext createContext(EGLDisplay display, bool debug) {
    if (eglInitialize(display, nullptr, nullptr) != EGL_TRUE) return EGL_NO_CONTEXT;
    const char* extensions = eglQueryString(display, EGL_EXTENSIONS);
    for (const char* needed :
         {"EGL_KHR_no_config_context", "EGL_KHR_surfaceless_context", "EGL_KHR_create_context"})
        if (!hasWord(extensions, needed)) return EGL_NO_CONTEXT;
    if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) return EGL_NO_CONTEXT;
    const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION_KHR,
                                 4,
                                 EGL_CONTEXT_MINOR_VERSION_KHR,
                                 5,
                                 EGL_CONTEXT_OPENGL_PROFILE_MASK_KHR,
                                 EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT_KHR,
                                 EGL_CONTEXT_FLAGS_KHR,
                                 debug ? EGL_CONTEXT_OPENGL_DEBUG_BIT_KHR : 0,
                                 EGL_NONE};
    return eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes);
}

}  // namespace

GlContext::State::~State() {
    if (context == EGL_NO_CONTEXT) return;
    if (eglBindAPI(EGL_OPENGL_API) == EGL_TRUE && eglGetCurrentContext() == context) leave();
    eglDestroyContext(display, context);
}

void GlContext::State::listen() {
    renderer = textOf(GL_RENDERER);
    version = textOf(GL_VERSION);
    if (!handler) return;
    glEnable(GL_DEBUG_OUTPUT);
    glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
    glDebugMessageControl(GL_DONT_CARE, GL_DONT_CARE, GL_DONT_CARE, 0, nullptr, GL_TRUE);
    glDebugMessageControl(GL_DONT_CARE, GL_DONT_CARE, GL_DEBUG_SEVERITY_NOTIFICATION, 0, nullptr,
                          GL_FALSE);
    glDebugMessageCallback(receive, &handler);
}

GlContext GlContext::headless(GlMessageHandler handler) {
    constexpr const char* kLacking = "there is no OpenGL 4.5: ";
    if (!epoxy_has_egl()) throw UsageError(fmt::format("{}no EGL library", kLacking));
    std::string found;
    for (const EGLDisplay display : displays()) {
        auto state = std::make_unique<State>();
        state->display = display;
        state->context = createContext(display, bool(handler));
        if (state->context == EGL_NO_CONTEXT || !state->makeCurrent()) continue;
        if (const std::string lack = missing(); !lack.empty()) {
            found += fmt::format("{}{} {}", found.empty() ? "" : ", ", textOf(GL_RENDERER), lack);
            continue;
        }
        state->handler = std::move(handler);
        state->listen();
        return GlContext(std::move(state));
    }
    throw UsageError(kLacking + (found.empty() ? "no EGL device offers it" : found));
}

GlContext GlContext::adoptCurrent(GlMessageHandler handler) {
    if (const std::string lack = missing(); !lack.empty())
        throw UsageError(fmt::format("there is no OpenGL 4.5: {} {}", textOf(GL_RENDERER), lack));
    auto state = std::make_unique<State>();
    state->handler = std::move(handler);
    state->listen();
    return GlContext(std::move(state));
}

GlContext::GlContext(std::unique_ptr<State> state) : state_(std::move(state)) {}
GlContext::GlContext(GlContext&&) noexcept = default;
GlContext& GlContext::operator=(GlContext&&) noexcept = default;
GlContext::~GlContext() = default;

void GlContext::makeCurrent() {
    if (state_->context != EGL_NO_CONTEXT) CHECK(state_->makeCurrent());
}

void GlContext::leave() {
    if (state_->context != EGL_NO_CONTEXT) CHECK(state_->leave());
}

const std::string& GlContext::renderer() const {
    return state_->renderer;
}
const std::string& GlContext::version() const {
    return state_->version;
}

}  // namespace pietra
