#include "apps/pietra/camera_options.h"

#include "apps/pietra/camera_json.h"
#include "base/error.h"

namespace pietra {

void CameraOptions::declareFile(OptionSet& options) {
    options.text("--camera", "C.json", file_,
                 "Look as this file says: {\"eye\":[x,y,z], \"target\":[x,y,z], \"up\":[x,y,z], "
                 "\"fovy_deg\":45}, in the input's coordinates.");
}

void CameraOptions::declareUp(OptionSet& options, const char* help) {
    options.choice("--up", up_, {"y", "z"}, help);
}

void CameraOptions::declare(OptionSet& options) {
    declareFile(options);
    options
        .choice("--view", view_, {"front", "back", "left", "right", "top", "bottom", "iso"},
                "Look at the whole from this side; front looks along +y, iso from a corner.")
        .defaultsTo("front");
    declareUp(options, "Which axis points up in standard views, and in cameras that do not say.");
    options.number("--fovy", "DEG", fovy_deg_, {.min = 1, .max = 170},
                   "Vertical field of view of standard views, in degrees.");
}

Camera CameraOptions::fromFile() const {
    return readCamera(file_, upVector(up()));
}

Camera CameraOptions::camera(const Box3d& bounds, const PictureSize& size) const {
    if (!file_.empty() && !view_.empty())
        throw UsageError("--camera and --view exclude each other: give one");
    if (!file_.empty()) return fromFile();
    const auto view = parseStandardView(view_.empty() ? "front" : view_);
    return standardCamera(*view, up(), bounds, size, fovy_deg_);
}

}  // namespace pietra
