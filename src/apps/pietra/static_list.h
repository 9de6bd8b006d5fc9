#pragma once
// What a draw list shows, as one static, cache-ordered buffer: the yardstick of `bench`.

#include <span>
#include <vector>

#include "multires/page_sink.h"
#include "store/model_reader.h"

namespace pietra {

/// A copy of a model's patches, merged: those culled by orientation and those that are not. Corners
/// on the borders of patches are welded, triangles stand in the order of a vertex cache, vertices
/// in that of their first use.
class StaticList {
public:
    /// Patches without a mesh are read from the model. `key` must not be in use in `sink`, which
    /// may be null, and must outlive this.
    StaticList(const ModelReader& model, std::span<const DrawPatch> patches, PageKey key,
               PageSink* sink);
    ~StaticList();
    StaticList(const StaticList&) = delete;
    StaticList& operator=(const StaticList&) = delete;

    /// False if the sink has no room for it.
    bool drawable() const { return drawable_; }
    std::span<const DrawPatch> patches() const { return patches_; }

private:
    PageKey key_;
    PageSink* sink_;
    std::vector<Mesh> mesh_;
    std::vector<DrawPatch> patches_;
    bool drawable_ = true;
};

}  // namespace pietra
