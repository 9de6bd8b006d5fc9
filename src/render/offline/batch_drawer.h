#pragma once
// What the pages of an offline picture are drawn with: they are handed over as they come from the
// file, and drawn in batches of a bounded size.

#include <memory>
#include <vector>

#include "multires/draw_list.h"
#include "render/picture.h"
#include "render/shading.h"

namespace pietra {

/// How a picture begins.
struct DrawerSettings {
    int samples = 1;
    ShadeSettings shade;
    bool leave_out_hidden = false;
    size_t batch_bytes = 0;  ///< of what is kept of pages that have been handed over
};

struct DrawerStatistics {
    uint64_t patches = 0, triangles = 0, pixels_covered = 0;
    double draw_ms = 0;       ///< wall clock
    size_t held_bytes = 0;    ///< largest sum of what was kept of pages
    size_t device_bytes = 0;  ///< of graphics memory, for pages
};

class BatchDrawer {
public:
    virtual ~BatchDrawer() = default;
    /// Of what comes from now on. The view is the same camera throughout; lattices must outlive
    /// this.
    virtual void setModel(const View& view, const Lattice& lattice) = 0;
    /// A page's patches, `list` in their order: list[i].mesh is patches.data() + i. Called by one
    /// thread at a time, but by any.
    virtual void add(std::vector<Mesh> patches, std::vector<DrawPatch> list) = 0;
    /// Draws what is left; then no more may come.
    virtual Picture finish() = 0;

    const DrawerStatistics& statistics() const { return statistics_; }

protected:
    DrawerStatistics statistics_;
};

/// On the CPU: batches are what is given out, with 16 bytes a vertex, and may be larger by a page.
std::unique_ptr<BatchDrawer> makeRasterDrawer(const View& view, const Lattice& lattice,
                                              const DrawerSettings& settings);

/// By OpenGL, where pages go to graphics memory of batch_bytes, kLeastGlBatch at least. Throws
/// UsageError where there is no OpenGL 4.5.
std::unique_ptr<BatchDrawer> makeGlDrawer(const View& view, const Lattice& lattice,
                                          const DrawerSettings& settings);
size_t leastGlBatchBytes(size_t largest_page_bytes);

}  // namespace pietra
