#pragma once
// From where a verb looks: a camera file, or a standard view of the whole scene.

#include <string>

#include "apps/pietra/option_set.h"
#include "multires/standard_views.h"

namespace pietra {

class CameraOptions {
public:
    /// Declares --camera, --view, --up and --fovy.
    void declare(OptionSet& options);
    /// `bounds` of the scene, in input coordinates. Throws UsageError where a camera and a view are
    /// given, and what readCamera() throws.
    Camera camera(const Box3d& bounds, const PictureSize& size) const;
    bool fileGiven() const { return !file_.empty(); }
    /// Only what the file says, which must be given.
    Camera fromFile() const;

    /// Some of the options alone, for verbs that take no standard view.
    void declareUp(OptionSet& options, const char* help);
    void declareFile(OptionSet& options);
    UpAxis up() const { return up_ == "y" ? UpAxis::kY : UpAxis::kZ; }

private:
    std::string file_;
    std::string view_;
    std::string up_ = "z";
    double fovy_deg_ = 45;
};

}  // namespace pietra
