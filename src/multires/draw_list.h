#pragma once
// What a renderer is given: meshes on one lattice, and how each is to be drawn. A refiner makes the
// list; renderers know nothing of nodes, pages or methods.

#include <cstdint>

#include "geometry/mesh.h"

namespace pietra {

/// A page of one of the models in a scene: by what loaders and renderers that keep pages tell them.
struct PageKey {
    uint32_t model = 0;
    uint32_t page = 0;
    bool operator==(const PageKey&) const = default;
};

/// One mesh of a frame's draw list. Plain data; the mesh is not owned.
struct DrawPatch {
    /// Must stay as it is until the renderer's draw() has returned; null only for a renderer with
    /// pages of its own. Every vertex has a normal; triangles with two equal corners are allowed
    /// and draw nothing.
    const Mesh* mesh = nullptr;
    /// Triangles seen from behind are left out. Only for closed, consistently oriented components;
    /// everything else is drawn, and lit, from both sides.
    bool one_sided = false;
    /// Names the patch for Show::kPatches: the same id has the same colour in every frame.
    uint32_t id = 0;
    /// Multiplies the surface's colour in Show::kShaded; white changes nothing.
    Rgba8 tint{};
    /// What Show::kLod and Show::kError show of this patch, see ShadeSettings.
    float value = 0;
    /// Where a renderer with pages of its own (PageSink) finds it: which of the page's patches.
    PageKey page{};
    uint32_t patch = 0;
};

}  // namespace pietra
