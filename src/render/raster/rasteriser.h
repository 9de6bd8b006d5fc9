#pragma once
// Renderer on the CPU: a visibility buffer of 64 bits a sample (reversed depth, triangle), filled
// by all threads tile by tile, then shaded once a pixel.
//
// Correctness. Positions are integers: the camera's integer part is subtracted first, so a vertex
// has one image, bit for bit, in every patch and wherever the model lies on Earth. Images are
// rounded to 1/256 pixel and everything about coverage is exact integer arithmetic with the
// top-left rule: of the triangles around an edge or a vertex of a closed surface, exactly one
// covers each sample. There is no near or far plane to choose: triangles are cut where they come
// within kNearDepth lattice units of the eye, shared edges at the same point from both sides. Of
// equal depths the triangle drawn first wins.
//
// Determinism: the picture does not depend on the number of threads, the SIMD level, how the draw
// list was cut into calls, or whether what is hidden was left out.
//
// Memory: 16 bytes a pixel (56 with 4 samples; 8 for what drawAll() draws at once), and 16 a vertex
// of what is drawn at once: a million, or those of the largest mesh. Not thread-safe: one thread
// calls, many work.

#include <cstdint>
#include <memory>
#include <span>

#include "geometry/lattice.h"
#include "multires/draw_list.h"
#include "multires/view.h"
#include "render/picture.h"
#include "render/shading.h"

namespace pietra {

struct RasterStatistics {
    uint64_t patches = 0;           ///< drawn
    uint64_t triangles = 0;         ///< in them
    uint64_t triangles_hidden = 0;  ///< of these, left out; depends on the number of threads
    uint64_t pixels_covered = 0;    ///< with anything in them; set by finish()
    /// Wall clock. Rasterising and shading, in drawAll() finishing too, run in one parallel loop,
    /// whose time is split as the threads spent it.
    double transform_ms = 0, raster_ms = 0, shade_ms = 0, finish_ms = 0;
    double totalMs() const { return transform_ms + raster_ms + shade_ms + finish_ms; }
};

/// Longest side of a picture, in pixels.
inline constexpr int kMaxPictureSide = 1 << 14;

/// What is drawn of one model of a scene. `view` and `lattice` as for Rasteriser::setModel().
struct ModelPatches {
    View view;
    const Lattice* lattice;
    std::span<const DrawPatch> patches;
};

class Rasteriser {
public:
    /// `view` must have been made with `lattice`. `samples`: 1 at the pixel's centre, or 4 on the
    /// usual rotated grid; shading is once a pixel and triangle in either case.
    Rasteriser(const View& view, const Lattice& lattice, int samples,
               const ShadeSettings& settings);
    ~Rasteriser();
    Rasteriser(const Rasteriser&) = delete;
    Rasteriser& operator=(const Rasteriser&) = delete;

    /// Begins another picture, reusing the memory of the one before.
    void restart(const View& view, const Lattice& lattice, const ShadeSettings& settings);
    /// What is drawn from now on lies on another lattice (another model of the same scene); `view`
    /// is the same camera and size in its coordinates.
    void setModel(const View& view, const Lattice& lattice);
    /// Draws, and shades what is visible so far: the meshes may vanish afterwards. At most 2^32 - 2
    /// triangles a mesh.
    void draw(std::span<const DrawPatch> patches);
    /// Draws the models as one after the other; the last one stays set. Patches that are hidden, by
    /// what is drawn already or by each other, may be left out: this changes no pixel, and costs
    /// next to nothing where none are.
    void draw(std::span<const ModelPatches> models, bool leave_out_hidden);
    /// The same, as all of the picture: nothing was drawn since it began. Faster than to draw and
    /// finish, as a tile's samples stay in a cache until its pixels are made. Appends the ids of
    /// patches that were left out to `hidden`.
    const Picture& drawAll(std::span<const ModelPatches> models, bool leave_out_hidden,
                           std::vector<uint32_t>* hidden = nullptr);
    /// Completes the picture, which is valid until restart(); nothing can be drawn in between.
    const Picture& finish();

    const RasterStatistics& statistics() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace pietra
