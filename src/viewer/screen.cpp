#include "viewer/screen.h"

#include <backends/imgui_impl_sdl.h>
#include <fmt/format.h>

#include "base/error.h"

namespace pietra {

Screen::Screen(const PictureSize& size, bool with_gl) {
    SDL_SetHint(SDL_HINT_VIDEO_X11_NET_WM_BYPASS_COMPOSITOR, "0");
    if (SDL_Init(SDL_INIT_VIDEO) == 0) {
        SDL_GL_SetAttribute(SDL_GL_CONTEXT_MAJOR_VERSION, 4);
        SDL_GL_SetAttribute(SDL_GL_CONTEXT_MINOR_VERSION, 5);
        SDL_GL_SetAttribute(SDL_GL_CONTEXT_PROFILE_MASK, SDL_GL_CONTEXT_PROFILE_CORE);
        SDL_GL_SetAttribute(SDL_GL_DEPTH_SIZE, 0);
        window_.reset(SDL_CreateWindow(
            "Pietra", SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED, size.width, size.height,
            SDL_WINDOW_RESIZABLE | SDL_WINDOW_ALLOW_HIGHDPI | (with_gl ? SDL_WINDOW_OPENGL : 0)));
    }
    if (!window_) {
        const std::string reason = SDL_GetError();
        SDL_Quit();
        throw UsageError(fmt::format("no window can be opened: {}", reason));
    }
    ImGui::CreateContext();
    ImGui::GetIO().IniFilename = nullptr;
    ImGui::StyleColorsDark();
    with_gl ? ImGui_ImplSDL2_InitForOpenGL(window_.get(), nullptr)
            : ImGui_ImplSDL2_InitForSDLRenderer(window_.get());
}

Screen::~Screen() {
    ImGui_ImplSDL2_Shutdown();
    ImGui::DestroyContext();
    window_.reset();
    SDL_Quit();
}

}  // namespace pietra
