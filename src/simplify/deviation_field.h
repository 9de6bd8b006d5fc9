#pragma once
// The fast way to cover a source face T: look at the target along T's normal. Where the target's
// faces about T form a height field over T, every point of T has a point of one of them straight
// above or below, no further than the largest height of that face's corners over T's plane.
//
// Proof. Let F be a set of target faces such that (1) the neighbour across every edge whose
// projection meets T is in F too, (2) every face of F looks T's way (its normal has a positive
// component along T's), (3) one of them covers some point of T. The number of faces of F over a
// point of T cannot change from point to point: by (1) the projected border of F stays away from T,
// and inside, by (2), leaving one face over an edge means entering its neighbour. By (3) it is not
// zero. So all of T is covered, and on the overlap of T with a face of F, both flat, the height is
// largest at the face's corners. F is found by flooding from a face over T's centre; where (1), (2)
// or (3) fails (borders, folds, creases, non-manifold edges), run() says so and the general way
// (Partition) is taken.
//
// Rounding: the flood works on T enlarged by kDilation in barycentric coordinates, far more than
// its predicates can err (faces too thin for that are refused).

#include <array>
#include <cstdint>
#include <vector>

#include "simplify/deviation_partition.h"
#include "simplify/deviation_surface.h"

namespace pietra::deviation {

class FieldCover {
public:
    static constexpr float kContraction = 0x1p-14f;

    /// One face of F that overlaps the enlarged T.
    struct Hit {
        /// Per corner: homogeneous barycentric coordinates with respect to the enlarged T, and the
        /// height over T's plane.
        alignas(16) std::array<std::array<float, 4>, 3> corner;
        uint32_t face;
        float height;  ///< largest of the three, slack for rounding not included
    };

    FieldCover();

    /// Before the first run() with this target.
    void setTarget(const Surface& target);

    /// Tries to cover face `t` of `source`, looking for the face over its centre from `start` on.
    /// False: no height field, or too hard to tell; then nothing is known.
    bool run(const Surface& source, uint32_t t, uint32_t start);

    const std::vector<Hit>& hits() const { return hits_; }
    /// To be added to each height.
    float slack() const { return slack_; }
    /// The largest height of the face over T's plane above the overlap itself.
    float overlapHeight(const Hit& hit) const;
    /// The part of the enlarged T under `hit`, relative to T's first corner. False: not
    /// representable.
    bool overlap(const Hit& hit, Polygon& polygon) const;

private:
    struct Chart;
    struct Seen;
    struct Entry;
    bool flood(const Chart& chart, uint32_t start);

    const Surface* target_ = nullptr;
    std::vector<Hit> hits_;
    std::vector<uint32_t> visited_;  ///< per target face: the last run that met it
    uint32_t run_ = 0;
    float slack_ = 0;
    std::array<Vec3f, 3> corner_;  ///< of the contracted T
    Vec3f origin_, normal_;
};

}  // namespace pietra::deviation
