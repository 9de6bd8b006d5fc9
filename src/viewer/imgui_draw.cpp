#include "viewer/imgui_draw.h"

#include <cstddef>

namespace pietra {

ImguiDraw::ImguiDraw(SDL_Renderer* renderer) : renderer_(renderer) {
    unsigned char* pixels = nullptr;
    int width = 0, height = 0;
    ImFontAtlas& fonts = *ImGui::GetIO().Fonts;
    fonts.GetTexDataAsRGBA32(&pixels, &width, &height);
    font_ = SDL_CreateTexture(renderer, SDL_PIXELFORMAT_RGBA32, SDL_TEXTUREACCESS_STATIC, width,
                              height);
    SDL_UpdateTexture(font_, nullptr, pixels, 4 * width);
    SDL_SetTextureBlendMode(font_, SDL_BLENDMODE_BLEND);
    SDL_SetTextureScaleMode(font_, SDL_ScaleModeLinear);
    fonts.SetTexID(font_);
}

ImguiDraw::~ImguiDraw() {
    SDL_DestroyTexture(font_);
}

void ImguiDraw::draw(const ImDrawData& data) const {
    SDL_RenderSetScale(renderer_, data.FramebufferScale.x, data.FramebufferScale.y);
    for (int l = 0; l < data.CmdListsCount; ++l) {
        const ImDrawList& list = *data.CmdLists[l];
        for (const ImDrawCmd& command : list.CmdBuffer) {
            const SDL_Rect clip{int(command.ClipRect.x), int(command.ClipRect.y),
                                int(command.ClipRect.z - command.ClipRect.x),
                                int(command.ClipRect.w - command.ClipRect.y)};
            if (clip.w <= 0 || clip.h <= 0) continue;
            SDL_RenderSetClipRect(renderer_, &clip);
            const ImDrawVert* vertex = list.VtxBuffer.Data + command.VtxOffset;
            SDL_RenderGeometryRaw(renderer_, static_cast<SDL_Texture*>(command.GetTexID()),
                                  &vertex->pos.x, int(sizeof(ImDrawVert)),
                                  reinterpret_cast<const SDL_Color*>(&vertex->col),
                                  int(sizeof(ImDrawVert)), &vertex->uv.x, int(sizeof(ImDrawVert)),
                                  list.VtxBuffer.Size - int(command.VtxOffset),
                                  list.IdxBuffer.Data + command.IdxOffset, int(command.ElemCount),
                                  int(sizeof(ImDrawIdx)));
        }
    }
    SDL_RenderSetClipRect(renderer_, nullptr);
    SDL_RenderSetScale(renderer_, 1, 1);
}

}  // namespace pietra
