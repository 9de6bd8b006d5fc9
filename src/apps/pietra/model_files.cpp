#include "apps/pietra/model_files.h"

#include <algorithm>

#include "methods/method_table.h"

namespace pietra {

ModelFiles::ModelFiles(const std::vector<std::string>& paths) {
    for (const std::string& path : paths) models.push_back(std::make_unique<ModelReader>(path));
}

Box3d ModelFiles::bounds() const {
    return boundsOf(views());
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

bool ModelFiles::proveErrors() const {
    return std::all_of(models.begin(), models.end(),
                       [](const auto& model) { return provesErrors(model->info()); });
}

std::vector<const ModelReader*> ModelFiles::views() const {
    std::vector<const ModelReader*> all;
    for (const auto& model : models) all.push_back(model.get());
    return all;
}

}  // namespace pietra
