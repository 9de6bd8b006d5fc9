#pragma once
// The window, what draws its pictures, and Dear ImGui over them: with the processor, shown by SDL's
// renderer, or with OpenGL.

#include <SDL.h>
#include <imgui.h>

#include <functional>
#include <memory>
#include <string>

#include "gpu/context.h"
#include "render/live/live_renderer.h"

namespace pietra {

class Screen {
public:
    virtual ~Screen();
    Screen(const Screen&) = delete;
    Screen& operator=(const Screen&) = delete;

    SDL_Window* window() const { return window_.get(); }
    /// In pixels, of which there may be several to a unit of the window's own coordinates.
    virtual PictureSize size() const = 0;
    /// What draws, for people to read.
    virtual std::string rendererName() const = 0;
    virtual LiveRenderer& renderer() = 0;

    /// Begins a frame of Dear ImGui.
    virtual void beginFrame() = 0;
    /// The renderer's last picture, and Dear ImGui's lists over it; seen after swap().
    virtual void show(ImDrawData& lists) = 0;
    virtual void swap() = 0;
    /// What show() has shown.
    virtual Picture read() = 0;

protected:
    struct Destroy {
        void operator()(SDL_Window* window) const { SDL_DestroyWindow(window); }
    };
    /// Throws UsageError where no window can be opened.
    Screen(const PictureSize& size, bool with_gl);
    std::unique_ptr<SDL_Window, Destroy> window_;
};

std::unique_ptr<Screen> openCpuScreen(const PictureSize& size);

/// Throws UsageError where there is no OpenGL 4.5, or only one that draws with the processor and
/// `software` is false; MemoryError as GlRenderer. With a handler the driver is asked to check.
std::unique_ptr<Screen> openGlScreen(const PictureSize& size, size_t vram_bytes, bool software,
                                     GlMessageHandler handler);

}  // namespace pietra
