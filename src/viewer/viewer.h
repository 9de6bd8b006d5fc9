#pragma once
// The window: opens models and builds those of meshes, looks at them with the mouse and the
// keyboard, draws on the processor, and shows what it is doing. What can be done is listed by F1
// (kHelp in panel.cpp).
//
// The frame thread never waits for a file (runtime/scene.h). While the camera moves, the tolerance
// may be raised so that frames stay fluent; at rest it is what was asked for.

#include <string>
#include <vector>

#include "multires/standard_views.h"
#include "runtime/scene.h"

namespace pietra {

struct ViewerSettings {
    PictureSize size{1280, 800};
    double pixels = 1;
    SceneSettings scene;
    UpAxis up = UpAxis::kZ;
    /// A file of commands to run as if a user did (viewer/script.h); empty: none.
    std::string script;
    std::string program = "/proc/self/exe";  ///< builds the models of meshes
};

/// Models are shown, meshes are offered to be built first; more of both may be dropped on the
/// window. Returns when the user closes it. Throws UsageError where no window can be opened,
/// MemoryError as Scene does, what ModelReader throws, IoError and InputError for the script.
void runViewer(const std::vector<std::string>& files, const ViewerSettings& settings);

}  // namespace pietra
