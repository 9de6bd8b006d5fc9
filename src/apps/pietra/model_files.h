#pragma once
// One or several models that are drawn together, each on its own lattice.

#include <memory>
#include <string>
#include <vector>

#include "geometry/bounds.h"
#include "store/model_reader.h"

namespace pietra {

struct ModelFiles {
    std::vector<std::unique_ptr<ModelReader>> models;

    /// Opens all; throws what ModelReader throws.
    explicit ModelFiles(const std::vector<std::string>& paths);
    /// Of all models, in input coordinates.
    Box3d bounds() const;
    /// Balls that hold all models, some tens or hundreds, in input coordinates.
    std::vector<Sphere> balls() const;
    std::vector<const ModelReader*> views() const;
    /// Of all of them, the errors stated are proven bounds.
    bool proveErrors() const;
};

}  // namespace pietra
