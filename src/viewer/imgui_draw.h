#pragma once
// Draws Dear ImGui's triangles with SDL's renderer. (Debian's library has that backend's header,
// but not the backend.)

#include <SDL.h>
#include <imgui.h>

#include <memory>

namespace pietra {

class ImguiDraw {
public:
    /// `renderer` must outlive this; an ImGui context must exist.
    explicit ImguiDraw(SDL_Renderer* renderer);
    ~ImguiDraw();
    ImguiDraw(const ImguiDraw&) = delete;
    ImguiDraw& operator=(const ImguiDraw&) = delete;

    /// Over what is there.
    void draw(const ImDrawData& data) const;

private:
    SDL_Renderer* renderer_;
    SDL_Texture* font_;
};

}  // namespace pietra
