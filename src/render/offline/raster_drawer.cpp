#include "render/offline/batch_drawer.h"
#include "render/raster/rasteriser.h"

namespace pietra {
namespace {

/// What the rasteriser keeps of a vertex (rasteriser.h).
constexpr size_t kScreenVertexBytes = 16;

/// Of a mesh while it is drawn.
size_t drawnBytes(const Mesh& mesh) {
    const auto bytes = [](const auto& array) { return array.size() * sizeof(array[0]); };
    return bytes(mesh.position) + bytes(mesh.triangle) + bytes(mesh.edge_class) +
           bytes(mesh.normal) + bytes(mesh.colour) + bytes(mesh.scalar) +
           mesh.vertexCount() * kScreenVertexBytes;
}

class RasterDrawer : public BatchDrawer {
public:
    RasterDrawer(const View& view, const Lattice& lattice, const DrawerSettings& settings)
        : batch_bytes_(settings.batch_bytes),
          leave_out_hidden_(settings.leave_out_hidden),
          rasteriser_(view, lattice, settings.samples, settings.shade),
          models_{{{view, &lattice, {}}, 0}} {}

    void setModel(const View& view, const Lattice& lattice) override {
        models_.push_back({{view, &lattice, {}}, list_.size()});
    }

    void add(std::vector<Mesh> patches, std::vector<DrawPatch> list) override {
        for (const Mesh& mesh : patches) bytes_ += drawnBytes(mesh);
        meshes_.push_back(std::move(patches));  // they stay where they are
        list_.insert(list_.end(), list.begin(), list.end());
        if (bytes_ >= batch_bytes_) drawBatch();
    }

    Picture finish() override {
        drawBatch();
        Picture picture = rasteriser_.finish();
        const RasterStatistics& raster = rasteriser_.statistics();
        statistics_.patches = raster.patches;
        statistics_.triangles = raster.triangles;
        statistics_.pixels_covered = raster.pixels_covered;
        statistics_.draw_ms = raster.totalMs();
        return picture;
    }

private:
    void drawBatch() {
        std::vector<ModelPatches> models;
        for (size_t m = 0; m < models_.size(); ++m) {
            const size_t end = m + 1 < models_.size() ? models_[m + 1].first : list_.size();
            models.push_back(models_[m].part);
            models.back().patches =
                std::span(list_).subspan(models_[m].first, end - models_[m].first);
        }
        rasteriser_.draw(models, leave_out_hidden_);
        statistics_.held_bytes = std::max(statistics_.held_bytes, bytes_);
        models_.erase(models_.begin(), models_.end() - 1);
        models_[0].first = 0;
        list_.clear();
        meshes_.clear();
        bytes_ = 0;
    }

    struct Model {
        ModelPatches part;
        size_t first;  ///< of list_
    };

    const size_t batch_bytes_;
    const bool leave_out_hidden_;
    Rasteriser rasteriser_;
    std::vector<std::vector<Mesh>> meshes_;
    std::vector<DrawPatch> list_;
    std::vector<Model> models_;  // the last is the one that is set
    size_t bytes_ = 0;
};

}  // namespace

std::unique_ptr<BatchDrawer> makeRasterDrawer(const View& view, const Lattice& lattice,
                                              const DrawerSettings& settings) {
    return std::make_unique<RasterDrawer>(view, lattice, settings);
}

}  // namespace pietra
