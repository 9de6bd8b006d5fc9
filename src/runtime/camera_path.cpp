#include "runtime/camera_path.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/check.h"

namespace pietra {

Camera CameraPath::at(double t) const {
    CHECK(!keys.empty());
    const auto after = std::upper_bound(keys.begin(), keys.end(), t,
                                        [](double time, const Key& key) { return time < key.t; });
    if (after == keys.begin()) return keys.front().camera;
    if (after == keys.end()) return keys.back().camera;
    const Key& before = after[-1];
    const double s = (t - before.t) / (after->t - before.t);
    const auto mix = [s](const auto& a, const auto& b) { return a * (1 - s) + b * s; };
    const Camera& a = before.camera;
    const Camera& b = after->camera;
    return {mix(a.eye, b.eye), mix(a.target, b.target), mix(a.up, b.up),
            mix(a.fovy_deg, b.fovy_deg)};
}

Camera CameraPath::frame(int i, int frames) const {
    CHECK(i >= 0 && i < frames);
    return at(frames == 1 ? 0 : seconds * i / (frames - 1));
}

std::string cameraPathText(const CameraPath& path) {
    const auto vector = [](const Vec3d& v) { return fmt::format("[{},{},{}]", v.x, v.y, v.z); };
    std::string text = fmt::format("{{\"seconds\":{},\"keys\":[", path.seconds);
    for (size_t i = 0; i < path.keys.size(); ++i) {
        const Camera& c = path.keys[i].camera;
        text += fmt::format("{}\n{{\"t\":{},\"eye\":{},\"target\":{},\"up\":{},\"fovy_deg\":{}}}",
                            i ? "," : "", path.keys[i].t, vector(c.eye), vector(c.target),
                            vector(c.up), c.fovy_deg);
    }
    return text + "\n]}\n";
}

}  // namespace pietra
