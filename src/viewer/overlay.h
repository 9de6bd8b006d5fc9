#pragma once
// Lines over the picture: the distance that is measured and, with the selection frozen, from where
// it was selected and what bounds its nodes, as in the papers' figures.

#include <array>
#include <span>

#include "runtime/scene.h"
#include "store/model_reader.h"

namespace pietra {

/// Which spheres of the nodes drawn are shown.
enum class ShowSpheres { kNone, kTight, kSaturated };

struct OverlayScene {
    Camera camera;                     ///< of the picture
    const Camera* selected = nullptr;  ///< whose frustum is shown; null: none
    ShowSpheres spheres = ShowSpheres::kNone;
    std::span<const Vec3d> measured;  ///< points, joined by lines
    std::span<const ModelReader* const> models;
    const Frame* frame = nullptr;
};

/// Within an ImGui frame, behind its panels. The picture fills the window.
void drawOverlay(const OverlayScene& scene);

}  // namespace pietra
