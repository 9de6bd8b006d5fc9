#pragma once
// The fast way to cover a source face T: look at the target along T's normal. Where the target's
// faces about T form a height field over T, every point of T has a point of one of them straight
// above or below, at most as far as the faces' largest height over T.
//
// Proof. Let F be a set of target faces such that (1) the neighbour across every edge whose
// projection meets T is in F too, (2) every face of F looks T's way (its normal has a positive
// component along T's), (3) one of them covers some point of T. The number of faces of F over a
// point of T cannot change from point to point: by (1) the projected border of F stays away from T,
// and inside, by (2), leaving one face over an edge means entering its neighbour. By (3) it is not
// zero. So all of T is covered, and over the overlap of T with one face of F, both flat, the height
// is largest at a corner of the overlap: where an edge of the face enters or leaves T, or at a
// corner of T. F is found by flooding from a face over T's centre; where (1), (2) or (3) fails
// (borders, folds, creases, non-manifold edges), run() says so and the general way (Partition) is
// taken.
//
// Rounding. The flood works on T contracted a little, so that what only touches T is left out; any
// point of T is near one of the contracted T. Predicates err by less than the contraction: they are
// right for a T contracted twice as much (faces too thin for that are refused). slack() pays for
// both.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "simplify/deviation_partition.h"
#include "simplify/deviation_surface.h"
#include "simplify/lanes4.h"

namespace pietra::deviation {

class FieldCover {
public:
    static constexpr uint32_t kMaxHits = 96;

    /// One face of F.
    struct Hit {
        uint32_t face;
        float height;  ///< the largest, over the overlap with T; slack() not included
        float cosine;  ///< between the normals
    };

    FieldCover();
    ~FieldCover();

    /// Before the first run() with this target.
    void setTarget(const Surface& target);

    /// Tries to cover face `t` of `source`, looking for the face over its centre from `start` on.
    /// False: no height field, or too hard to tell; then nothing is known.
    bool run(const Surface& source, uint32_t t, uint32_t start);

    std::span<const Hit> hits() const { return {hits_.data(), hit_count_}; }
    /// To be added to each height.
    float slack() const { return slack_; }

    /// The overlap of the contracted T with a face that was hit by the last run, relative to T's
    /// first corner. False: it has too many corners.
    bool overlap(uint32_t face, Polygon& polygon) const;

private:
    struct Crossing;
    struct Entry;
    /// What is known of T. A target point is *seen* as lanes (height over T's plane, barycentric
    /// coordinates 0, 1, 2 with respect to the contracted T): an affine map.
    struct Chart {
        Lanes4 origin;                        ///< T's first corner
        Lanes4 edge1, edge2;                  ///< the others, relative to it
        Lanes4 constant, x, y, z;             ///< of the map
        Lanes4 corner_x, corner_y, corner_z;  ///< lanes: T's normal; corners 2, 0, 1 of the
                                              ///< contracted T, relative to the origin
    };
    bool makeChart(const Surface& source, uint32_t t);
    Lanes4 relative(uint32_t vertex) const;
    Lanes4 see(Lanes4 relative) const;
    bool findStart(uint32_t& face) const;
    bool flood(uint32_t start, bool& centre_met);
    Hit makeHit(uint32_t f, Lanes4 corner, float height, uint32_t corners) const;
    float slackOf(Lanes4 extent) const;

    const Surface* target_ = nullptr;
    Chart chart_;
    std::array<Hit, kMaxHits> hits_;
    uint32_t hit_count_ = 0;
    std::unique_ptr<Entry[]> queue_;
    std::vector<uint32_t> visited_;  ///< per target face, and for none: the last run that met it
    uint32_t run_ = 0;
    float slack_ = 0;
};

}  // namespace pietra::deviation
