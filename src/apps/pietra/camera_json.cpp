#include "apps/pietra/camera_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string_view>

#include "apps/pietra/logging.h"
#include "base/error.h"
#include "extmem/file.h"

namespace pietra {

namespace {

using nlohmann::json;

constexpr size_t kMaxFileBytes = 64 << 20;

std::string readText(const std::string& path) {
    File file(path, File::Mode::kRead);
    std::string text(1 << 16, '\0');
    size_t used = 0;
    while (size_t n = file.readSome(text.data() + used, text.size() - used)) {
        used += n;
        if (used > kMaxFileBytes)
            throw InputError(path, "", "is too large to be a camera or a path");
        if (used == text.size()) text.resize(2 * used);
    }
    text.resize(used);
    return text;
}

/// One JSON object of a file, with where it is, for messages.
class ObjectReader {
public:
    ObjectReader(const std::string& path, std::string place, const json& object)
        : path_(path), place_(std::move(place)), object_(object) {
        if (!object.is_object()) fail("", "is not a JSON object");
    }

    const json& at(const char* member) const {
        const auto found = object_.find(member);
        if (found == object_.end()) fail("", fmt::format("lacks \"{}\"", member));
        return *found;
    }
    double number(const char* member) const {
        const json& value = at(member);
        if (!value.is_number()) fail(member, "is not a number");
        return value.get<double>();
    }
    Vec3d vector(const char* member) const {
        const json& value = at(member);
        const auto is_number = [](const json& v) { return v.is_number(); };
        if (!value.is_array() || value.size() != 3 ||
            !std::all_of(value.begin(), value.end(), is_number))
            fail(member, "is not an array of three numbers");
        return {value[0].get<double>(), value[1].get<double>(), value[2].get<double>()};
    }
    bool has(const char* member) const { return object_.contains(member); }

    void warnOfOthers(std::initializer_list<std::string_view> known) const {
        for (const auto& [member, value] : object_.items())
            if (std::find(known.begin(), known.end(), member) == known.end())
                logWarning(
                    fmt::format("{}: \"{}\" is unknown and left out", path_, placeOf(member)));
    }

    std::string placeOf(std::string_view member) const {
        if (place_.empty() || member.empty()) return place_ + std::string(member);
        return fmt::format("{}.{}", place_, member);
    }
    [[noreturn]] void fail(std::string_view member, const std::string& what) const {
        throw InputError(path_, placeOf(member), what);
    }

private:
    const std::string& path_;
    const std::string place_;
    const json& object_;
};

Camera cameraOf(const ObjectReader& object, const Vec3d& up) {
    Camera camera;
    camera.eye = object.vector("eye");
    camera.target = object.vector("target");
    camera.up = object.has("up") ? object.vector("up") : up;
    camera.fovy_deg = object.has("fovy_deg") ? object.number("fovy_deg") : 45;
    if (camera.eye == camera.target) object.fail("target", "is the same point as \"eye\"");
    if (camera.up == Vec3d(0)) object.fail("up", "is zero");
    if (!(camera.fovy_deg > 0 && camera.fovy_deg < 180))
        object.fail("fovy_deg", "must be more than 0 and less than 180");
    return camera;
}

json parseText(const std::string& text, const std::string& path) {
    try {
        return json::parse(text);
    } catch (const json::parse_error& fault) {
        throw InputError::atByte(path, std::max<size_t>(fault.byte, 1) - 1,
                                 "is not valid JSON here");
    } catch (const json::out_of_range&) {
        throw InputError(path, "", "a number is too large");
    }
}

}  // namespace

Camera readCamera(const std::string& path, const Vec3d& up) {
    return parseCamera(readText(path), path, up);
}

CameraPath readCameraPath(const std::string& path, const Vec3d& up) {
    return parseCameraPath(readText(path), path, up);
}

Camera parseCamera(const std::string& text, const std::string& path, const Vec3d& up) {
    const json root = parseText(text, path);
    const ObjectReader object(path, "", root);
    const Camera camera = cameraOf(object, up);
    object.warnOfOthers({"eye", "target", "up", "fovy_deg"});
    return camera;
}

CameraPath parseCameraPath(const std::string& text, const std::string& path, const Vec3d& up) {
    const json root = parseText(text, path);
    const ObjectReader object(path, "", root);
    CameraPath result;
    result.seconds = object.number("seconds");
    if (!(result.seconds > 0)) object.fail("seconds", "must be more than 0");
    const json& keys = object.at("keys");
    if (!keys.is_array() || keys.empty())
        object.fail("keys", "is not an array of at least one key");
    for (size_t i = 0; i < keys.size(); ++i) {
        const ObjectReader key(path, fmt::format("keys[{}]", i), keys[i]);
        result.keys.push_back({key.number("t"), cameraOf(key, up)});
        if (i > 0 && !(result.keys[i].t > result.keys[i - 1].t))
            key.fail("t", "must be later than that of the key before");
        key.warnOfOthers({"t", "eye", "target", "up", "fovy_deg"});
    }
    object.warnOfOthers({"seconds", "keys"});
    return result;
}

}  // namespace pietra
