#include <backends/imgui_impl_opengl3.h>
#include <backends/imgui_impl_sdl.h>
#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "render/live/gl_live.h"
#include "viewer/screen.h"

namespace pietra {
namespace {

bool isSoftware(const std::string& renderer) {
    return renderer.find("llvmpipe") != renderer.npos || renderer.find("softpipe") != renderer.npos;
}

class GlScreen : public Screen {
public:
    GlScreen(const PictureSize& wanted, size_t vram_bytes, bool software, GlMessageHandler handler)
        : Screen(wanted, true) {
        SDL_GL_SetAttribute(SDL_GL_CONTEXT_FLAGS, handler ? SDL_GL_CONTEXT_DEBUG_FLAG : 0);
        context_.reset(SDL_GL_CreateContext(window()));
        if (!context_) throw UsageError(fmt::format("there is no OpenGL 4.5: {}", SDL_GetError()));
        GlContext context = GlContext::adoptCurrent(std::move(handler));
        name_ = context.renderer();
        if (isSoftware(name_) && !software)
            throw UsageError(fmt::format("OpenGL is drawn by the processor here ({})", name_));
        live_.emplace(std::move(context), size(), vram_bytes);
        imgui_ =
            ImGui_ImplOpenGL3_Init("#version 450 core") && ImGui_ImplOpenGL3_CreateDeviceObjects();
        if (!imgui_) throw UsageError("the library of OpenGL cannot be loaded");
        SDL_GL_SetSwapInterval(1);
    }
    ~GlScreen() override {
        if (imgui_) ImGui_ImplOpenGL3_Shutdown();
    }

    PictureSize size() const override {
        PictureSize size;
        SDL_GL_GetDrawableSize(window(), &size.width, &size.height);
        return {std::max(size.width, 16), std::max(size.height, 16)};
    }
    std::string rendererName() const override { return name_; }
    LiveRenderer& renderer() override { return *live_; }

    void beginFrame() override {
        ImGui_ImplOpenGL3_NewFrame();
        ImGui_ImplSDL2_NewFrame();
    }
    void show(ImDrawData& lists) override {
        live_->present();
        ImGui_ImplOpenGL3_RenderDrawData(&lists);
    }
    void swap() override { SDL_GL_SwapWindow(window()); }

    Picture read() override {
        Picture picture;
        picture.size = size();
        picture.colour.resize(picture.pixelCount());
        const auto width = size_t(picture.size.width);
        glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
        glPixelStorei(GL_PACK_ALIGNMENT, 4);
        glBindFramebuffer(GL_FRAMEBUFFER, 0);
        glReadPixels(0, 0, picture.size.width, picture.size.height, GL_RGBA, GL_UNSIGNED_BYTE,
                     picture.colour.data());
        // OpenGL's row 0 is at the bottom.
        for (auto low = picture.colour.begin(), high = picture.colour.end() - ptrdiff_t(width);
             low < high; low += ptrdiff_t(width), high -= ptrdiff_t(width))
            std::swap_ranges(low, low + ptrdiff_t(width), high);
        return picture;
    }

private:
    struct Delete {
        void operator()(void* context) const { SDL_GL_DeleteContext(context); }
    };
    std::unique_ptr<void, Delete> context_;
    std::optional<GlLive> live_;
    std::string name_;
    bool imgui_ = false;
};

}  // namespace

std::unique_ptr<Screen> openGlScreen(const PictureSize& size, size_t vram_bytes, bool software,
                                     GlMessageHandler handler) {
    return std::make_unique<GlScreen>(size, vram_bytes, software, std::move(handler));
}

}  // namespace pietra
