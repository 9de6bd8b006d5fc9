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
          rasteriser_(view, lattice, settings.samples, settings.shade) {}

    void setModel(const View& view, const Lattice& lattice) override {
        drawBatch();
        rasteriser_.setModel(view, lattice);
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
        rasteriser_.draw(list_);
        statistics_.held_bytes = std::max(statistics_.held_bytes, bytes_);
        list_.clear();
        meshes_.clear();
        bytes_ = 0;
    }

    const size_t batch_bytes_;
    Rasteriser rasteriser_;
    std::vector<std::vector<Mesh>> meshes_;
    std::vector<DrawPatch> list_;
    size_t bytes_ = 0;
};

}  // namespace

std::unique_ptr<BatchDrawer> makeRasterDrawer(const View& view, const Lattice& lattice,
                                              const DrawerSettings& settings) {
    return std::make_unique<RasterDrawer>(view, lattice, settings);
}

}  // namespace pietra
