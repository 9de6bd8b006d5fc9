#pragma once
// On which side of a model's closed parts is the eye? From outside, what faces away is hidden and
// may be culled; from within, it is all there is to see.

#include "multires/view.h"
#include "store/model_reader.h"

namespace pietra {

/// Sums up the patches of a valid cut, whose nodes may come in any order. Only closed ones count.
class EyeSide {
public:
    explicit EyeSide(const Vec3d& eye) : eye_(eye) {}
    void add(const Node& node, const Mesh& patch);
    void add(const EyeSide& others);

    /// True unless the eye is certainly outside: by the winding number (van Oosterom, Strackee
    /// 1983), and no nearer to a triangle than the error stated.
    bool mayBeInside() const;

private:
    Vec3d eye_;
    double winding_ = 0;
    bool near_ = false;
};

/// Of such a cut that is coarse but whole near the eye, and so decides the matter in few triangles.
inline constexpr double kEyeSidePixels = 64;

/// Of a model on disk. Reads some pages; throws what that throws.
bool eyeMayBeInside(const ModelReader& model, const View& view);

}  // namespace pietra
