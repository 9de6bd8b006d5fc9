#pragma once
// Renderer on the GPU, by OpenGL 4.5: page meshes in one buffer of fixed size, drawn by few calls
// of multi-draw-indirect, whatever their number. Its pictures are the CPU renderer's
// (raster/rasteriser.h), but for what a driver's arithmetic moves: the same images of vertices,
// rounded to 1/256 pixel, the same fill rule, near distance, depth, light and debug views.
//
// Depth is reversed, the far plane at infinity, in float: there is no near or far plane to choose,
// and triangles are cut where they come within kNearDepth lattice units of the eye. Of equal depths
// the one drawn first wins, within a draw() in no particular order.
//
// A picture: begin(), then uploads, draws and releases in any order, then readPicture() or
// present(). Of `vram_bytes` at most an eighth is the ring for uploads and some 4 in a hundred
// serve culling; pages have the rest. Targets come on top: 8 bytes a sample and 8 a pixel. All
// memory is taken and all shaders are compiled when a renderer is made; a frame does neither, nor
// does it wait, as long as it uploads what mayUpload().
//
// The context must be current whenever anything here is called, also on destruction. Other state of
// the context than what is bound does not matter, and clip control, culling and tests are left as
// OpenGL has them at first.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "geometry/lattice.h"
#include "multires/page_sink.h"
#include "multires/seen_depth.h"
#include "multires/view.h"
#include "render/picture.h"
#include "render/shading.h"

namespace pietra {

struct GlStatistics {
    uint64_t triangles = 0;     ///< drawn since begin()
    uint64_t patches = 0;       ///< with triangles, likewise
    uint64_t upload_bytes = 0;  ///< likewise
    /// Of the last picture whose time is known, from begin() to its end; 0 before there is one.
    double gpu_ms = 0;
};

/// Least memory for pages.
inline constexpr size_t kLeastVramBytes = size_t(1) << 19;

class GlRenderer : public PageSink {
public:
    /// `samples`: 1 at the pixel's centre, or 4 where the driver has them, shaded once a pixel and
    /// triangle. Of more than 8 GiB of memory the rest is not used. Throws MemoryError for less
    /// than kLeastVramBytes, and for what the driver does not have.
    GlRenderer(const PictureSize& size, int samples, size_t vram_bytes);
    ~GlRenderer() override;
    GlRenderer(const GlRenderer&) = delete;
    GlRenderer& operator=(const GlRenderer&) = delete;

    bool upload(PageKey key, std::span<const Mesh> patches) override;
    void release(PageKey key) override;
    bool mayUpload(size_t bytes) override;
    size_t usedBytes() const override;
    size_t capacityBytes() const override;
    bool holds(PageKey key) const;

    /// Pictures of this size, with so many samples, from the next begin() on. Compiles shaders when
    /// a number of samples is asked for the first time.
    void resize(const PictureSize& size, int samples);
    /// Begins a picture; `view` must have been made with `lattice` and be of the picture's size.
    void begin(const View& view, const Lattice& lattice, const ShadeSettings& settings);
    /// What is drawn from now on lies on another lattice (another model of the same scene); `view`
    /// is the same camera in its coordinates.
    void setModel(const View& view, const Lattice& lattice);
    /// Of pages that are uploaded; meshes are not looked at.
    void draw(std::span<const DrawPatch> patches);
    /// Draws the same, but leaves out on the GPU what is hidden (occlusion.h), by what is drawn
    /// already or by each other: for the frames of a flight, where most that is seen was seen
    /// before. No pixel changes but where surfaces coincide. Appends the ids of those left out to
    /// `hidden`, for which it waits.
    void drawUnhidden(std::span<const DrawPatch> patches, std::vector<uint32_t>* hidden = nullptr);
    /// Completes the picture, without waiting for it. Nothing can be drawn before the next begin().
    void finish();
    /// Completes the picture and waits for it, as all that follows up to present().
    void wait();
    Picture readPicture();
    /// Of a pixel of the picture: its depth as in Picture.
    float depthAt(int x, int y);
    /// Completes the picture of one sample a pixel and has read, without waiting, what it hides
    /// (seen_depths.h). `camera`: its view's.
    void lookBack(const Camera& camera);
    /// Of the last picture that lookBack() has read, or null. Valid until the next call of either.
    const SeenDepth* seen();
    /// Completes the picture and copies it to the window's lower left corner.
    void present();

    const GlStatistics& statistics() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace pietra
