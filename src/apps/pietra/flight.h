#pragma once
// A camera path flown through a scene, frame by frame, and measured.

#include <functional>
#include <vector>

#include "gpu/context.h"
#include "render/shading.h"
#include "runtime/camera_path.h"
#include "runtime/scene.h"

namespace pietra {

struct FlightSettings {
    int frames = 0;  ///< at least 1
    PictureSize size;
    double pixels = 1;
    SelectBy select = SelectBy::kError;
    Culling culling{true, true, true, true};
    bool prefetch = true;
    int samples = 1;
    enum class Draw { kNothing, kCpu, kGl } draw = Draw::kCpu;
    size_t vram_bytes = size_t(1) << 30;  ///< of graphics memory, for pages
    GlMessageHandler gl_messages;         ///< as of GlContext
    /// After the flight, in turn: its lists drawn as static ones.
    bool compare = false;
    /// In real time: no frame is shown before its time on the path. Else as fast as it can.
    bool real_time = false;
    SceneSettings scene;
};

struct FrameRecord {
    double seconds = 0;  ///< on the path
    double ms = 0, select_ms = 0, load_ms = 0, draw_ms = 0;
    double adapt_ms = 0;  ///< of select_ms: meshes that are adapted
    double gpu_ms = 0;    ///< by the GPU's own clock; 0: not known
    /// To draw this view again with everything resident, and nothing else to do; 0: not measured.
    double static_ms = 0;
    uint64_t triangles = 0, patches = 0;
    uint32_t operations = 0;                      ///< splits and collapses
    uint64_t bytes_read = 0;                      ///< in this frame
    size_t resident_bytes = 0, device_bytes = 0;  ///< of pages, in RAM and in graphics memory
    size_t process_bytes = 0;                     ///< of all that the process has in RAM
    double tolerance_px = 0;
    bool converged = false, settled = false;
};

struct FlightRecord {
    std::vector<FrameRecord> frames;
    double seconds = 0;          ///< of the flight
    double first_image_ms = -1;  ///< since the process began: a picture at kFirstImagePx; -1: none
    double converged_ms = -1;    ///< after the last frame; -1: not within a minute, or there is
                                 ///< no memory for it
    /// Of sampled frames with everything resident: the whole frame over drawing its list as one
    /// static, cache-ordered buffer, in turn; the median.
    double overhead_ratio = 0;
    std::vector<std::string> faults;
};

inline constexpr double kFirstImagePx = 16;

/// Since the process started, within the system's tick, a hundredth of a second.
double msSinceStart();

/// Throws what opening a scene throws, and UsageError where there is no OpenGL. `progress(i)` after
/// each frame.
FlightRecord fly(const std::vector<const ModelReader*>& models, const CameraPath& path,
                 const FlightSettings& settings, const std::function<void(int)>& progress);

/// The value that a share `p` of the values does not exceed; 0 of none.
double percentile(std::vector<double> values, double p);

}  // namespace pietra
