#pragma once
// A model of a scene: its table, and what of its pages is where.

#include <optional>
#include <span>
#include <vector>

#include "geometry/mesh.h"
#include "runtime/eye_side.h"
#include "runtime/forest_refiner.h"
#include "runtime/residency.h"
#include "store/model_reader.h"

namespace pietra {

struct SceneModel {
    explicit SceneModel(const ModelReader& r);

    /// Null where the page is drawn from elsewhere and has no copy here.
    const Mesh* mesh(NodeIndex i) const {
        const Node& node = forest.node(i);
        return hasCopy(node.page) ? &copies[node.page][node.patch] : nullptr;
    }
    bool hasCopy(PageIndex page) const { return !copies[page].empty(); }
    bool usedIn(uint32_t frame, PageIndex page) const {
        return last_used[page] == frame || eye_used[page] == frame;
    }
    const ModelReader& reader;
    Forest forest;
    Residency residency;  ///< of what may be drawn
    ForestRefiner refiner;
    Box3d closed_parts;
    std::optional<EyeSide> side;        ///< of the last eye that was not decided by one before
    std::vector<PageIndex> side_pages;  ///< of the cut that decided it
    // Of each page:
    std::vector<size_t> copy_bytes;         ///< of its meshes in RAM
    std::vector<size_t> drawn_bytes;        ///< where it is drawn from; about, until it was there
    std::vector<std::vector<Mesh>> copies;  ///< in RAM, or none
    std::vector<uint32_t> last_used;        ///< in which frame what is drawn needed it
    std::vector<uint32_t> eye_used;         ///< ... told where the eye is
    std::vector<uint32_t> last_wanted;      ///< ... was missing
    std::vector<uint8_t> arriving;          ///< has a copy, and waits to be resident
    std::vector<uint8_t> bad;               ///< cannot be read
};

}  // namespace pietra
