#pragma once
// A recorded flight: cameras at times, linear in between, so that frame i of N shows the same
// picture on any machine at any speed.

#include <string>
#include <vector>

#include "multires/view.h"

namespace pietra {

struct CameraPath {
    struct Key {
        double t = 0;  ///< seconds
        Camera camera;
    };
    double seconds = 0;     ///< length of the flight, more than 0
    std::vector<Key> keys;  ///< at least one, in strictly rising order of t

    /// The camera at time t. Eye, target, up and field of view are linear between two keys; before
    /// the first key and after the last one the camera stands still.
    Camera at(double t) const;
    /// The camera of frame `i` of `frames`: t = seconds * i / (frames - 1); a single frame shows t
    /// = 0.
    Camera frame(int i, int frames) const;
};

/// As the JSON that `bench --path` reads (apps/pietra/camera_json.h).
std::string cameraPathText(const CameraPath& path);

}  // namespace pietra
