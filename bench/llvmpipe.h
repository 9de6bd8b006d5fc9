#pragma once
// The rival of bench_raster: Mesa's software renderer drawing the same triangles, without a window.

#include <memory>
#include <span>
#include <string>

#include "geometry/lattice.h"
#include "multires/view.h"
#include "multires/draw_list.h"

namespace pietra {

class Llvmpipe {
public:
    /// Uploads the patches as one static buffer with 32-bit indices. `samples`: 1 or 4.
    Llvmpipe(const View& view, std::span<const DrawPatch> patches, int samples);
    ~Llvmpipe();
    /// Clears, draws, resolves the samples and waits until all is done; nothing is read back.
    void draw();
    /// The driver's own name for itself.
    std::string renderer() const;
    /// Pixels that are not background, by reading back: both renderers draw the same.
    size_t pixelsCovered();

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace pietra
