#pragma once
// What the window shows beside the picture: figures, settings, help.

#include <array>
#include <string>
#include <vector>

#include "render/shading.h"
#include "runtime/scene.h"
#include "viewer/camera_control.h"
#include "viewer/open_files.h"
#include "viewer/overlay.h"

namespace pietra {

/// Set by keys and by the panel's own controls.
struct ViewState {
    double pixels = 1;
    int samples = 1;
    Show show = Show::kShaded;
    bool prefetch = true;
    bool show_panel = true, show_help = false;
    bool frozen = false;       ///< what is drawn stays as selected, wherever the camera goes
    bool show_hidden = false;  ///< when frozen: what others hide red, all else green
    ShowSpheres spheres = ShowSpheres::kNone;  ///< of the nodes drawn
    bool recording = false;
    bool measuring = false;
    std::array<Vec3d, 2> measured{};
    int measured_count = 0;
    std::string message;  ///< of what was done last
};

/// Of the last frames.
struct FrameFigures {
    static constexpr int kHistory = 120;
    std::array<float, kHistory> ms{}, megabytes{};
    int next = 0;
    double draw_ms = 0;
    double gpu_ms = 0;  ///< by the GPU's own clock; 0: not known
    double tolerance_px = 0;
    bool settled = false;          ///< this is what will be seen at rest
    bool short_of_memory = false;  ///< for the tolerance asked for
    uint64_t triangles = 0, patches = 0;
    size_t resident_bytes = 0, ram_bytes = 0;
    size_t device_bytes = 0, vram_bytes = 0;  ///< there is none if 0
    std::string renderer;
    uint64_t bytes_read = 0;

    void add(float frame_ms) {
        ms[size_t(next)] = frame_ms;
        megabytes[size_t(next)] = float(resident_bytes) / (1 << 20);
        next = (next + 1) % kHistory;
    }
};

/// Within an ImGui frame, as drawFiles.
void drawPanel(ViewState& state, const FrameFigures& figures, const CameraControl& control,
               const std::vector<std::string>& faults);

/// Meshes that are offered to be built, and builds that run: nothing where there are none.
void drawFiles(OpenFiles& files);

}  // namespace pietra
