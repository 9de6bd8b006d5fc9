// Any bytes are a camera, a path, or an InputError: nothing else happens.

#include <string>

#include "apps/pietra/camera_json.h"
#include "apps/pietra/logging.h"
#include "base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t bytes) {
    using namespace pietra;
    setUpLogging("error", true, "");
    const std::string text(reinterpret_cast<const char*>(data), bytes);
    try {
        parseCamera(text, "camera", {0, 0, 1});
    } catch (const InputError&) {
    }
    try {
        const CameraPath flight = parseCameraPath(text, "path", {0, 0, 1});
        for (int i = 0; i < 3; ++i) flight.frame(i, 3);
    } catch (const InputError&) {
    }
    return 0;
}
