#include "runtime/scene_patches.h"

#include <algorithm>

#include "base/parallel.h"

namespace pietra {
namespace {

SceneModels makeModels(const std::vector<const ModelReader*>& readers) {
    SceneModels models;
    for (const ModelReader* reader : readers)
        models.push_back(std::make_unique<SceneModel>(*reader));
    return models;
}

}  // namespace

ScenePatches::ScenePatches(const std::vector<const ModelReader*>& readers, size_t table_bytes,
                           const SceneSettings& settings)
    : models_(makeModels(readers)),
      pages_(models_, settings.ram_bytes, table_bytes, settings.loader_threads, settings.sink) {}

void ScenePatches::beginFrame() {
    pages_.publish(++frame_number_);
    missing_.clear();
    missing_for_eye_.clear();
    used_bytes_ = 0;
}

void ScenePatches::select(uint32_t m, const FrameRequest& request, double pixels, ModelFrame& out) {
    SceneModel& model = *models_[m];
    out.two_sided = mayBeInside(m, out.view);
    Culling culling = request.culling;
    culling.cone &= !out.two_sided;
    model.refiner.select(out.view, pixels, culling, out.selection);
    for (PageIndex page = 0; page < model.last_used.size(); ++page) {
        const bool used = model.refiner.used(page);
        if (used) model.last_used[page] = frame_number_;
        // Not what has just arrived and is not needed any more: that would settle, for a frame.
        if (model.residency.resident(page) && (used || model.eye_used[page] == frame_number_))
            used_bytes_ += model.drawn_bytes[page];
    }
    for (const PageRequest& r : out.selection.requests) missing_.push_back({{m, r.page}, r.pixels});
    describe(model, m, request.show_error, out);
}

void ScenePatches::wantMissing() {
    std::stable_sort(missing_.begin(), missing_.end(),
                     [](const Missing& a, const Missing& b) { return a.pixels > b.pixels; });
    for (const Missing& page : missing_) pages_.want(page.key, Need::kDraw);
    for (const PageKey& key : missing_for_eye_) pages_.want(key, Need::kEye);
}

void ScenePatches::prefetch(const Camera& camera, const FrameRequest& request, double pixels,
                            bool next_level) {
    std::vector<PageKey>& ahead = ahead_[next_level];
    ahead.clear();
    for (uint32_t m = 0; m < models_.size(); ++m) {
        SceneModel& model = *models_[m];
        requests_.clear();
        model.refiner.prefetch(request.viewFrom(camera, model.reader.info()), pixels,
                               request.culling, requests_);
        for (const PageRequest& r : requests_) ahead.push_back({m, r.page});
    }
}

void ScenePatches::wantPrefetched() {
    for (const auto& pages : ahead_)
        for (const PageKey& key : pages)
            if (!models_[key.model]->residency.resident(key.page)) pages_.want(key, Need::kLater);
}

/// Whatever is not known counts as inside.
bool ScenePatches::mayBeInside(uint32_t m, const View& view) {
    SceneModel& model = *models_[m];
    if (!holds(model.closed_parts, view.eye())) return false;
    // What is drawn is no coarser than what decided the matter, as long as that is all there.
    if (model.side && model.side->decides(view.eye()) &&
        std::all_of(model.side_pages.begin(), model.side_pages.end(),
                    [&](PageIndex page) { return model.residency.resident(page); })) {
        for (const PageIndex page : model.side_pages) model.eye_used[page] = frame_number_;
        return model.side->mayBeInside();
    }
    model.side.reset();
    if (!hasPagesForEye(m, view)) return true;
    model.side = sideOf(model, view);
    model.side_pages = pages_for_eye_;
    return model.side->mayBeInside();
}

/// Finds the cut that tells, as far as it is resident; what is missing is wanted.
bool ScenePatches::hasPagesForEye(uint32_t m, const View& view) {
    SceneModel& model = *models_[m];
    cut_for_eye_.clear();
    pages_for_eye_.clear();
    requests_.clear();
    model.refiner.visitDrawable(
        view.byError(), kEyeSidePixels,
        [&](NodeIndex i) {
            cut_for_eye_.push_back(i);
            pages_for_eye_.push_back(model.forest.node(i).page);
        },
        requests_);
    for (const PageRequest& r : requests_) missing_for_eye_.push_back({m, r.page});
    std::sort(pages_for_eye_.begin(), pages_for_eye_.end());
    pages_for_eye_.erase(std::unique(pages_for_eye_.begin(), pages_for_eye_.end()),
                         pages_for_eye_.end());
    size_t bytes = 0;
    for (const PageIndex page : pages_for_eye_) bytes += model.copy_bytes[page];
    if (!pages_.mayStay(bytes)) return false;
    const size_t missing_before = missing_for_eye_.size();
    for (const PageIndex page : pages_for_eye_) {
        model.eye_used[page] = frame_number_;
        if (!model.hasCopy(page)) missing_for_eye_.push_back({m, page});
    }
    return missing_for_eye_.size() == missing_before;
}

EyeSide ScenePatches::sideOf(const SceneModel& model, const View& view) const {
    constexpr size_t kSlice = 16;
    const size_t count = cut_for_eye_.size();
    std::vector<EyeSide> parts((count + kSlice - 1) / kSlice, EyeSide(view.eye()));
    parallelFor(parts.size(), [&](size_t k) {
        for (size_t i = k * kSlice; i < std::min(count, (k + 1) * kSlice); ++i)
            parts[k].add(model.forest.node(cut_for_eye_[i]), *model.mesh(cut_for_eye_[i]));
    });
    EyeSide side(view.eye());
    for (const EyeSide& part : parts) side.add(part);
    return side;
}

void ScenePatches::describe(const SceneModel& model, uint32_t m, bool show_error,
                            ModelFrame& out) const {
    out.patches.clear();
    for (const NodeIndex i : out.selection.draw) {
        const Node& node = model.forest.node(i);
        if (node.triangles == 0) continue;
        DrawPatch patch;
        patch.mesh = model.mesh(i);
        patch.page = {m, node.page};
        patch.patch = node.patch;
        patch.one_sided = node.closed && !out.two_sided;
        patch.id = i + m * 0x9e3779b9u;
        patch.value = show_error ? float(out.view.pixelsOf(node)) : float(node.level);
        out.patches.push_back(patch);
    }
}

}  // namespace pietra
