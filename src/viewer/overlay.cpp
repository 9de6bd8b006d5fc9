#include "viewer/overlay.h"

#include <imgui.h>

#include <cmath>

namespace pietra {
namespace {

constexpr ImU32 kMeasureColour = IM_COL32(255, 214, 80, 255);
constexpr ImU32 kFrustumColour = IM_COL32(255, 255, 255, 200);
constexpr ImU32 kTightColour = IM_COL32(90, 220, 110, 150);
constexpr ImU32 kSaturatedColour = IM_COL32(240, 90, 80, 90);

/// Draws in a view's lattice.
class Pen {
public:
    explicit Pen(const View& view) : view_(view), list_(ImGui::GetBackgroundDrawList()) {}

    void line(const Vec3d& a, const Vec3d& b, ImU32 colour) const {
        Vec3d p = fromEye(a), q = fromEye(b);
        // What lies behind the eye is cut off a little before it.
        const double near = 1e-4 * std::max(p.z, q.z);
        if (near <= 0) return;
        if (p.z < near) p = q + (p - q) * ((q.z - near) / (q.z - p.z));
        if (q.z < near) q = p + (q - p) * ((p.z - near) / (p.z - q.z));
        list_->AddLine(project(p), project(q), colour, 1.5f);
    }
    void dot(const Vec3d& a, ImU32 colour) const {
        if (const Vec3d p = fromEye(a); p.z > 0) list_->AddCircleFilled(project(p), 4, colour);
    }
    /// As a circle: the outline of a sphere near the picture's middle.
    void sphere(const Sphere& sphere, ImU32 colour) const {
        const Vec3d centre = fromEye(Vec3d(sphere.centre));
        const double r = double(sphere.radius);
        if (r <= 0 || centre.z <= r) return;
        const double radius = view_.focal_px() * r / std::sqrt(centre.z * centre.z - r * r);
        list_->AddCircle(project(centre), float(radius), colour);
    }

private:
    /// To the right, up, and away from the eye.
    Vec3d fromEye(const Vec3d& p) const {
        const Vec3d d = p - view_.eye();
        return {glm::dot(d, view_.right()), glm::dot(d, view_.up()), -glm::dot(d, view_.back())};
    }
    ImVec2 project(const Vec3d& p) const {
        return {float(0.5 * view_.size().width + view_.focal_px() * p.x / p.z),
                float(0.5 * view_.size().height - view_.focal_px() * p.y / p.z)};
    }

    const View& view_;
    ImDrawList* list_;
};

/// The corners of the picture as `camera` sees it, as far away as its target.
void drawFrustum(const Pen& pen, const Camera& camera, const PictureSize& size) {
    const View view(camera, size, Lattice{});
    const double depth = glm::length(camera.target - camera.eye);
    std::array<Vec3d, 4> corner;
    for (int k = 0; k < 4; ++k) {
        const double x = k == 1 || k == 2 ? 1 : -1, y = k >= 2 ? 1 : -1;
        corner[size_t(k)] = camera.eye - view.back() * depth +
                            (view.right() * (x * size.width) + view.up() * (y * size.height)) *
                                (0.5 * depth / view.focal_px());
    }
    for (size_t k = 0; k < 4; ++k) {
        pen.line(camera.eye, corner[k], kFrustumColour);
        pen.line(corner[k], corner[(k + 1) % 4], kFrustumColour);
    }
}

}  // namespace

void drawOverlay(const OverlayScene& scene) {
    const ImVec2 window = ImGui::GetIO().DisplaySize;
    const PictureSize size{std::max(1, int(window.x)), std::max(1, int(window.y))};
    if (scene.spheres != ShowSpheres::kNone && scene.frame)
        for (size_t m = 0; m < scene.models.size(); ++m) {
            const View view(scene.camera, size, scene.models[m]->info().lattice);
            const bool tight = scene.spheres == ShowSpheres::kTight;
            for (const NodeIndex i : scene.frame->models[m].selection.draw) {
                const Node& node = scene.models[m]->nodes()[i];
                Pen(view).sphere(tight ? node.bounds : node.saturated,
                                 tight ? kTightColour : kSaturatedColour);
            }
        }
    const View view(scene.camera, size, Lattice{});
    const Pen pen(view);
    if (scene.selected) drawFrustum(pen, *scene.selected, size);
    for (size_t i = 0; i < scene.measured.size(); ++i) {
        pen.dot(scene.measured[i], kMeasureColour);
        if (i > 0) pen.line(scene.measured[i - 1], scene.measured[i], kMeasureColour);
    }
}

}  // namespace pietra
