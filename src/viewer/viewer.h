#pragma once
// The window: opens models and builds those of meshes, looks at them with the mouse and the
// keyboard, draws by OpenGL or with the processor, and shows what it is doing. What can be done is
// listed by F1 (kHelp in panel.cpp).
//
// The frame thread never waits for a file (runtime/scene.h). While the camera moves, the tolerance
// may be raised so that frames stay fluent; at rest it is what was asked for.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "gpu/context.h"
#include "multires/standard_views.h"
#include "runtime/scene.h"

namespace pietra {

/// What draws: OpenGL where a graphics card does it, else the processor; or one of them.
enum class ViewerRenderer { kAuto, kCpu, kGl };

struct ViewerSettings {
    PictureSize size{1280, 800};
    double pixels = 1;
    SelectBy select = SelectBy::kError;  ///< as FrameRequest has it
    SceneSettings scene;                 ///< without a sink
    ViewerRenderer renderer = ViewerRenderer::kAuto;
    size_t vram_bytes = size_t(1) << 30;           ///< for OpenGL
    std::function<void(const std::string&)> tell;  ///< takes notices; may be empty
    GlMessageHandler gl_messages;  ///< if not empty, OpenGL is asked to check what it is told
    std::optional<UpAxis> up;      ///< none: guessed (runtime/up_axis.h)
    /// A file of commands to run as if a user did (viewer/script.h); empty: none.
    std::string script;
    std::string program = "/proc/self/exe";  ///< builds the models of meshes
};

/// Models are shown, meshes are offered to be built first; more of both may be dropped on the
/// window. Returns when the user closes it. Throws UsageError where no window can be opened, or not
/// the one asked for, MemoryError as Scene does, what ModelReader throws, IoError and InputError
/// for the script.
void runViewer(const std::vector<std::string>& files, const ViewerSettings& settings);

}  // namespace pietra
