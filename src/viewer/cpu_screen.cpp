#include <backends/imgui_impl_sdl.h>
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "render/raster/rasteriser.h"
#include "viewer/imgui_draw.h"
#include "viewer/screen.h"

namespace pietra {
namespace {

template <auto kDestroy>
struct DestroyWith {
    template <class T>
    void operator()(T* object) const {
        kDestroy(object);
    }
};

class CpuScreen : public Screen {
public:
    explicit CpuScreen(const PictureSize& size)
        : Screen(size, false), sdl_(SDL_CreateRenderer(window(), -1, 0)) {
        if (!sdl_) throw UsageError(fmt::format("no window can be opened: {}", SDL_GetError()));
        imgui_.emplace(sdl_.get());
    }

    PictureSize size() const override {
        PictureSize size;
        SDL_GetRendererOutputSize(sdl_.get(), &size.width, &size.height);
        return {std::clamp(size.width, 16, kMaxPictureSide),
                std::clamp(size.height, 16, kMaxPictureSide)};
    }
    std::string rendererName() const override { return "the processor"; }
    LiveRenderer& renderer() override { return *live_; }
    void beginFrame() override { ImGui_ImplSDL2_NewFrame(); }

    void show(ImDrawData& lists) override {
        update(live_->picture());
        SDL_RenderClear(sdl_.get());
        SDL_RenderCopy(sdl_.get(), texture_.get(), nullptr, nullptr);
        imgui_->draw(lists);
    }
    void swap() override { SDL_RenderPresent(sdl_.get()); }

    Picture read() override {
        Picture picture;
        picture.size = size();
        picture.colour.resize(picture.pixelCount());
        if (SDL_RenderReadPixels(sdl_.get(), nullptr, SDL_PIXELFORMAT_RGBA32, picture.colour.data(),
                                 picture.size.width * int(sizeof(Rgba8))) != 0)
            throw UsageError(fmt::format("the window cannot be read: {}", SDL_GetError()));
        return picture;
    }

private:
    void update(const Picture& picture) {
        const PictureSize size = picture.size;
        if (texture_size_.width != size.width || texture_size_.height != size.height)
            texture_.reset(SDL_CreateTexture(sdl_.get(), SDL_PIXELFORMAT_RGBA32,
                                             SDL_TEXTUREACCESS_STREAMING, size.width, size.height));
        texture_size_ = size;
        SDL_UpdateTexture(texture_.get(), nullptr, picture.colour.data(),
                          size.width * int(sizeof(Rgba8)));
    }

    std::unique_ptr<SDL_Renderer, DestroyWith<SDL_DestroyRenderer>> sdl_;
    std::unique_ptr<SDL_Texture, DestroyWith<SDL_DestroyTexture>> texture_;
    PictureSize texture_size_{0, 0};
    std::optional<ImguiDraw> imgui_;
    std::unique_ptr<LiveRenderer> live_ = makeRasterLive();
};

}  // namespace

std::unique_ptr<Screen> openCpuScreen(const PictureSize& size) {
    return std::make_unique<CpuScreen>(size);
}

}  // namespace pietra
