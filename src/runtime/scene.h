#pragma once
// Models that are looked at: which of their pages are in memory, and what to draw in a frame. The
// frame thread calls update() and draws; it never waits for a file. Whatever has been loaded, every
// frame is a valid, crack-free cut of each model (forest_refiner.h), or one mesh that is adapted
// (live_model.h): models of both kinds may share a scene.
//
// All models share the budgets: of decoded pages in RAM and, where a renderer draws from memory of
// its own, of that (page_pool.h). Pages that a frame needs are never evicted for others; where they
// do not fit, the tolerance is raised until they do, and lowered again when there is room. Pages
// for views to come are loaded after all that are needed now.
//
// One thread calls, the sink's; deterministic but for what the loader's threads have ready when.

#include <memory>
#include <string>
#include <vector>

#include "multires/draw_list.h"
#include "multires/live_model.h"
#include "multires/page_sink.h"
#include "runtime/eye_side.h"
#include "runtime/forest_refiner.h"

namespace pietra {

struct SceneSettings {
    /// Of decoded pages, those being decoded included, and of the models' tables.
    size_t ram_bytes = size_t(1) << 30;
    int loader_threads = 2;
    /// What pages must be in to be drawn; must outlive the scene, and have room for pages alone.
    /// Null: they are drawn from RAM.
    PageSink* sink = nullptr;
    /// Of models whose pages are not patches. Null: there are to be none.
    OpenLive open_live = nullptr;
    /// For adapting them, in a frame, about.
    double adapt_ms = 4;
};

/// What the table of nodes and what is made of it take, about.
size_t tableBytes(const ModelReader& model);

/// What a frame asks for.
struct FrameRequest {
    Camera camera;
    PictureSize size;
    double pixels = 1;                   ///< tolerance
    SelectBy select = SelectBy::kError;  ///< what it bounds, of models that know both
    double seconds = 0;  ///< since the beginning, for the prediction of where the camera goes
    Culling culling{true, true, true, true};
    /// The last picture of all that is drawn: meshes that are adapted need not be as fine where it
    /// hid them. Must outlive the update; null: nothing is known.
    const SeenDepth* seen = nullptr;
    bool prefetch = true;
    bool show_error = false;  ///< DrawPatch::value is the error in pixels, not the level

    View viewFrom(const Camera& from, const ModelInfo& model) const {
        return {from, size, model.lattice, model.face_sizes ? select : SelectBy::kError};
    }
    /// Asks for the same cut.
    bool sameView(const FrameRequest& other) const {
        return camera == other.camera && size == other.size && pixels == other.pixels &&
               select == other.select && culling == other.culling &&
               (seen != nullptr) == (other.seen != nullptr);
    }
};

/// What is drawn of a model.
struct ModelFrame {
    explicit ModelFrame(const View& v) : view(v) {}
    View view;
    bool two_sided = false;          ///< the eye may be inside of a closed part
    Selection selection;             ///< empty of a mesh that is adapted
    std::vector<DrawPatch> patches;  ///< valid until the next update(); with a sink, without meshes
};

struct Frame {
    std::vector<ModelFrame> models;
    /// What the picture keeps to: what was asked for, or more, because pages are missing or do not
    /// fit. Infinite where the eye is inside a sphere that could not be refined.
    double tolerance_px = 0;
    bool converged = false;  ///< nothing is missing, at the tolerance asked for
    bool raised = false;     ///< the tolerance, as memory is too small for the one asked for
    bool settled = false;    ///< nothing is missing, at a tolerance that memory allows: as long as
                             ///< the view stays, so does what is drawn
    uint64_t triangles = 0, patch_count = 0;
    uint32_t operations = 0;    ///< on meshes that are adapted
    size_t resident_bytes = 0;  ///< in RAM, tables included
    size_t device_bytes = 0;    ///< in the sink
    uint64_t bytes_read = 0;    ///< since the beginning
    double publish_ms = 0, select_ms = 0;
    double adapt_ms = 0;  ///< of select_ms
};

class Scene {
public:
    /// Models must outlive this. Loads the roots, waiting for them. Throws MemoryError, which says
    /// how much is needed where, if they do not fit, and what reading throws; InputError for a
    /// model that settings.open_live is to know, and does not.
    Scene(std::vector<const ModelReader*> models, const SceneSettings& settings);
    ~Scene();

    /// Valid until the next call.
    const Frame& update(const FrameRequest& request);
    /// Waits until the frame is settled. For screenshots and measurements. Throws Interrupted where
    /// that was asked for.
    const Frame& converge(const FrameRequest& request);

    /// Pages that cannot be read: a sentence each. What they hold is drawn coarser.
    const std::vector<std::string>& faults() const;

private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace pietra
