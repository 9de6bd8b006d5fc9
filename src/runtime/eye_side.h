#pragma once
// On which side of a model's closed parts is the eye? From outside, what faces away is hidden and
// may be culled; from within, it is all there is to see.
//
// Outside all closed parts their winding number is 0, else it is taken for another whole number. Of
// a cut only what closed nodes hold is known to belong to them; other nodes may hold some of it
// too, which adds at most the solid angles of all their triangles, whichever side they show.

#include <limits>
#include <span>

#include "geometry/bounds.h"
#include "multires/view.h"
#include "store/model_reader.h"

namespace pietra {

/// What holds all closed parts of a model at every level of detail, in lattice units: from without
/// the eye is outside. Empty where nothing is closed. Linear in the nodes.
Box3d closedPartsWithin(const ModelInfo& info, std::span<const Node> nodes);
bool holds(const Box3d& box, const Vec3d& point);

/// Sums up the patches of a valid cut, whose nodes may come in any order.
class EyeSide {
public:
    explicit EyeSide(const Vec3d& eye) : eye_(eye) {}
    void add(const Node& node, const Mesh& patch);
    void add(const EyeSide& others);

    /// True unless the eye is certainly outside: by the winding number (van Oosterom, Strackee
    /// 1983), and further from any triangle than errors may move a surface.
    bool mayBeInside() const;
    /// Whether the same must hold for another eye: no surface of the model lies between, at this
    /// level of detail or any finer one.
    bool decides(const Vec3d& eye) const { return glm::distance(eye, eye_) < clearance_; }

private:
    Vec3d eye_;
    double winding_ = 0;  // of closed nodes
    double unknown_ = 0;  // most that other nodes may add to it
    double clearance_ = std::numeric_limits<double>::infinity();
};

/// Of such a cut that is coarse but whole near the eye, and so decides the matter in few triangles:
/// in a picture of usual size, what is an error E away from the eye states less than E / 5.
inline constexpr double kEyeSidePixels = 256;

/// Of a model on disk. May read some pages; throws what that throws.
bool eyeMayBeInside(const ModelReader& model, const View& view);

}  // namespace pietra
