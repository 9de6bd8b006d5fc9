#include "apps/pietra/model_files.h"

namespace pietra {

ModelFiles::ModelFiles(const std::vector<std::string>& paths) {
    for (const std::string& path : paths) models.push_back(std::make_unique<ModelReader>(path));
}

Box3d boundsOf(const ModelReader& model) {
    const ModelInfo& info = model.info();
    Box3d box;
    box.add(info.lattice.toInput(info.bounds.min));
    box.add(info.lattice.toInput(info.bounds.max));
    return box;
}

Box3d ModelFiles::bounds() const {
    Box3d box;
    for (const auto& model : models) box.add(boundsOf(*model));
    return box;
}

std::vector<Sphere> ModelFiles::balls() const {
    constexpr uint16_t kLevel = 9;
    std::vector<Sphere> balls;
    for (const auto& model : models) {
        const Lattice& lattice = model->info().lattice;
        for (const Node& node : model->nodes())
            if (node.level == kLevel || (node.level < kLevel && node.isLeaf()))
                balls.push_back({Vec3f(lattice.toInput(Vec3d(node.saturated.centre))),
                                 float(node.saturated.radius * lattice.step)});
    }
    return balls;
}

std::vector<const ModelReader*> ModelFiles::views() const {
    std::vector<const ModelReader*> all;
    for (const auto& model : models) all.push_back(model.get());
    return all;
}

}  // namespace pietra
