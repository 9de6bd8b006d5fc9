#pragma once
// Cameras and camera paths as JSON files:
//   {"eye":[x,y,z],"target":[x,y,z],"up":[x,y,z],"fovy_deg":45}
//   {"seconds":20,"keys":[{"t":0,"eye":[..],"target":[..],"up":[..],"fovy_deg":45}, ...]}
// in the input's own coordinates. `up` may be left out (the default), and `fovy_deg` (45). Keys
// come in rising order of t. Unknown members are left alone, with a warning in the log.
//
// Throw IoError, or InputError that names the file, the byte or the member, and the fault.

#include <string>

#include "runtime/camera_path.h"

namespace pietra {

/// `up`: what a camera without its own `up` gets.
Camera readCamera(const std::string& path, const Vec3d& up);
CameraPath readCameraPath(const std::string& path, const Vec3d& up);

/// The same from the bytes of a file; `path` is for messages.
Camera parseCamera(const std::string& text, const std::string& path, const Vec3d& up);
CameraPath parseCameraPath(const std::string& text, const std::string& path, const Vec3d& up);

}  // namespace pietra
