#pragma once
// A picture of one or several models at a tolerance, drawn once and from the files: what `render`
// and the references of tests and benchmarks are made with. Nodes are selected, then their pages
// are read, decoded and drawn in batches, so that memory stays within a bound whatever the size of
// the models.
//
// Deterministic on the CPU: the picture depends on models, view and settings, not on threads or
// memory. By OpenGL it is the same but for what the driver's arithmetic moves (gl/renderer.h).

#include <cstdint>
#include <span>
#include <utility>

#include "base/progress.h"
#include "multires/cut.h"
#include "multires/live_model.h"
#include "render/picture.h"
#include "render/shading.h"
#include "store/model_reader.h"

namespace pietra {

enum class DrawWith { kCpu, kGl };

struct OfflineSettings {
    DrawWith renderer = DrawWith::kCpu;
    /// Tolerance in pixels (multires/view.h); 0 draws the full mesh.
    double pixels = 1;
    SelectBy select = SelectBy::kError;  ///< what it bounds; face sizes only where models know them
    Culling culling;                     ///< of contribution, only where there is a tolerance
    int samples = 1;                     ///< 1 or 4
    /// value_min and value_max are set by drawModels(): Show::kError shows errors in pixels, from 0
    /// to the tolerance, or to the largest one drawn where there is none. From within a closed part
    /// everything is two-sided (runtime/eye_side.h).
    ShadeSettings shade;
    /// Bound of everything held: node tables, picture, and the patches in flight; with OpenGL also
    /// of the graphics memory for pages, but not of what the driver needs for itself.
    size_t memory_bytes = size_t(1) << 30;
    int jobs = 1;  ///< threads that work, about: as many pages are decoded ahead
    /// Of models whose pages are not patches, which are in memory one at a time. Where there is too
    /// little of it, they are drawn coarser.
    OpenLive open_live = nullptr;
};

struct OfflineStatistics {
    uint64_t patches = 0;    ///< drawn, after culling
    uint64_t triangles = 0;  ///< in them
    uint64_t pixels_covered = 0;
    double tolerance_px = 0;    ///< what was asked for, or more, where memory was too small
    size_t resident_bytes = 0;  ///< largest amount held at a time, of what memory_bytes bounds
    size_t device_bytes = 0;    ///< of these, graphics memory for pages
    /// Reading and decoding are summed over threads, and go on while batches are drawn; the others
    /// are wall clock.
    double select_ms = 0, load_ms = 0, decode_ms = 0, draw_ms = 0, total_ms = 0;
};

struct OfflinePicture {
    Picture picture;
    OfflineStatistics statistics;
};

/// Models in one scene have their coordinates in common. With Show::kScalar all must have the same
/// scalars. Begins one stage of `progress`. Throws MemoryError, which says how much is needed,
/// where the bound does not hold picture, node tables and one page; UsageError where there is no
/// OpenGL 4.5 that is to draw; and what reading throws.
OfflinePicture drawModels(std::span<const ModelReader* const> models, const Camera& camera,
                          const PictureSize& size, const OfflineSettings& settings,
                          Progress& progress);

/// Smallest and largest value of a scalar attribute in the coarsest cut; {0, 1} where there is none
/// that is finite.
std::pair<float, float> scalarRange(std::span<const ModelReader* const> models, int scalar);

}  // namespace pietra
