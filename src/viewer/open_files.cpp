#include "viewer/open_files.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include "base/error.h"
#include "base/hash.h"

namespace pietra {
namespace fs = std::filesystem;
namespace {

/// A model that is no older than its mesh.
bool isModelOf(const fs::path& model, const fs::path& mesh) {
    std::error_code fault;
    const auto made = fs::last_write_time(model, fault);
    if (fault) return false;
    return isModelFile(model) && made >= fs::last_write_time(mesh, fault) && !fault;
}

fs::path cacheFolder() {
    if (const char* folder = std::getenv("XDG_CACHE_HOME"); folder && *folder == '/')
        return fs::path(folder) / "pietra";
    const char* home = std::getenv("HOME");
    return (home ? fs::path(home) / ".cache" : fs::temp_directory_path()) / "pietra";
}

}  // namespace

std::string modelPathOf(const std::string& mesh) {
    const fs::path path = fs::absolute(mesh);
    fs::path name = path.filename();
    // statue.ply.gz is statue, too
    for (const char* ending : {".gz", ".xz", ".zst"})
        if (name.extension() == ending) name = name.stem();
    name.replace_extension(".pietra");
    if (::access(path.parent_path().c_str(), W_OK) == 0) return path.parent_path() / name;
    // Two meshes of one name from different folders must not meet there.
    const std::string folder = path.parent_path();
    return cacheFolder() / fmt::format("{:016x}", hashBytes(folder.data(), folder.size())) / name;
}

void OpenFiles::open(const std::string& path, bool build_now) {
    if (::access(path.c_str(), R_OK) != 0) throw IoError(path, "open", errno);
    if (fs::is_directory(path)) throw IoError(path, "open", EISDIR);
    const std::string model = isModelFile(path) ? path : modelPathOf(path);
    if (model == path || isModelOf(model, path)) {
        models_.push_back(std::make_unique<ModelReader>(model));
    } else if (build_now) {
        build(path);
    } else {
        offers_.push_back(path);
    }
}

void OpenFiles::build(const std::string& mesh) {
    const std::string model = modelPathOf(mesh);
    fs::create_directories(fs::path(model).parent_path());
    builds_.push_back(std::make_unique<BackgroundBuild>(program_, mesh, model));
}

void OpenFiles::acceptOffers() {
    for (const std::string& mesh : std::exchange(offers_, {})) build(mesh);
}

void OpenFiles::poll() {
    std::erase_if(builds_, [&](const std::unique_ptr<BackgroundBuild>& build) {
        const BackgroundBuild::State state = build->poll();
        if (state == BackgroundBuild::State::kRunning) return false;
        try {
            if (state == BackgroundBuild::State::kFailed)
                faults_.push_back(build->text());
            else
                models_.push_back(std::make_unique<ModelReader>(build->model()));
        } catch (const Error& error) {
            faults_.push_back(error.what());
        }
        return true;
    });
}

void OpenFiles::stopBuild(const BackgroundBuild* build) {
    std::erase_if(builds_, [&](const auto& other) { return other.get() == build; });
}

void OpenFiles::closeAfter(size_t count, const std::string& why) {
    for (size_t i = count; i < models_.size(); ++i)
        addFault(fmt::format("{}: {}", models_[i]->path(), why));
    models_.resize(count);
}

std::vector<const ModelReader*> OpenFiles::models() const {
    std::vector<const ModelReader*> all;
    for (const auto& model : models_) all.push_back(model.get());
    return all;
}

}  // namespace pietra
