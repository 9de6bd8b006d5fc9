#pragma once
// How far a mesh is from the input, proven, collapse by collapse (docs/design/pmesh.md).
//
// Each face f has a bound. Of any mesh of such faces: the input is a union of sets, one a face, and
// each point of a face's set is no farther from that face than its bound; nor is any point of the
// face from the input.
//
// A collapse replaces the faces around its ends, the old fan, by those around the merged vertex,
// the new fan. Seen along some direction both cover the same polygon. The old faces are cut along
// the new edges as seen from there, and each piece goes to the new face it is seen in: the set of
// the old face goes on to where its piece does, the new face is covered by what its pieces are seen
// at. The distance to one triangle is convex, so the largest of a piece lies at a corner.
//
// Sums of distances, one a collapse, would be loose, as each adds to what the last one said. So the
// pieces that matter are kept, with where they come from and where they are, and measured as a
// whole again at the next collapse. They matter if their bound is more than a part of what is
// stated there anyhow. All others are the *rest* of a face: one number, for all of the face.
//
// The result is a function of the collapses. Single precision, relative to the merged vertex; slack
// pays for rounding. Memory: 64 bytes a face, 128 a piece, of which most faces have some.

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "geometry/mesh.h"
#include "methods/pmesh/split_node.h"
#include "simplify/lanes4.h"

namespace pietra::pmesh {

/// What a collapse replaces. Positions are integers, relative to what all those of a map are.
struct CollapsingStar {
    uint32_t size = 0;  ///< of the ring
    bool closed = false;
    /// Counter-clockwise, where it is open from its beginning.
    std::array<Vec3f, kMaxNeighbours> ring;
    /// The faces on the ring's edges, before and after, and the apex' corner in each; the ring's
    /// edge runs from the corner after that to the one before.
    std::array<uint32_t, kMaxNeighbours> face, apex;
    std::array<bool, kMaxNeighbours> of_u;  ///< the apex was u, else v
    struct Wing {
        uint32_t face = 0;
        std::array<uint32_t, 3> corner{};  ///< of v, of u, and on the ring
        uint32_t ring = 0;
    };
    std::array<Wing, 2> wing;  ///< faces on the edge between the ends, which die
    uint32_t wings = 0;
    std::array<Vec3f, 2> end;  ///< v and u
    std::array<bool, 2> on_border{};
    Vec3f merged;
    uint32_t edges() const { return size - !closed; }
    uint32_t after(uint32_t i) const { return i + 1 == size ? 0 : i + 1; }
};

class SurfaceMap {
public:
    static constexpr uint32_t kMostKept = 13;
    /// What tightness is worth.
    struct Effort {
        uint32_t kept = 8;     ///< pieces of a face, at most; up to kMostKept
        float matters = 0.5f;  ///< of what is stated anyhow: pieces below do not matter
    };
    /// `bound`: one a face.
    SurfaceMap(const std::vector<float>& bound, const Effort& effort);

    /// The faces that remain have new bounds after this; the star's places are relative to the
    /// merged vertex then. `stated`: an error that the collapse
    /// states anyhow. False: nothing is done, as the new fan is not to be seen from anywhere, and
    /// its bounds would exceed `most`.
    bool collapse(CollapsingStar& star, float stated, float most);
    float bound(uint32_t face) const { return face_[face].bound; }
    /// A face may soon be in a star; and again, when this may have come.
    void expect(uint32_t face) const { __builtin_prefetch(&face_[face]); }
    void expectPieces(uint32_t face) const {
        for (uint32_t p = 0; p < face_[face].pieces; ++p) {
            const Piece* const piece = &pieceAt(face_[face].piece[p]);
            __builtin_prefetch(piece);
            __builtin_prefetch(&piece->corner[1]);
        }
    }
    /// Of the faces that the last collapse made.
    float largestOfLast() const { return largest_; }

private:
    static constexpr uint32_t kMostCorners = 5;  ///< of a piece that is kept
    static constexpr uint32_t kMostCut = 16;     ///< of one that is being cut
    class Plane;
    float limit() const { return effort_.matters * std::max(stated_, largest_); }

    struct alignas(64) Face {
        float bound;
        float rest;  ///< of what is not in its pieces; negative: there is nothing
        uint32_t pieces;
        std::array<uint32_t, kMostKept> piece;
    };
    /// A face as it once was.
    struct Source {
        Vec3f origin;
        std::array<Vec3f, 2> edge;
        float bound;
        float rest;  ///< as Face::rest: of what is meant
    };
    /// Corners: weights of the source's corners 1 and 2, and of those of the face that it is in.
    struct alignas(64) Piece {
        Source source;
        uint32_t size;
        std::array<Lanes4, kMostCorners> corner;
    };
    /// The latter: coordinates in the plane.
    struct Polygon {
        uint32_t size = 0;
        std::array<Lanes4, kMostCut> corner;
        void add(const Lanes4& c) {
            if (size < kMostCut) corner[size] = c;
            ++size;
        }
    };
    /// An old face: its corners as ends and ring, in the order of its slot.
    struct Old {
        uint32_t face;
        std::array<uint32_t, 3> at;
    };

    std::array<Old, kMaxNeighbours + 2> oldFaces(uint32_t& count) const;
    Vec3f placeOf(uint32_t at) const;
    void take(const Old& old);
    void setWeights(uint32_t edge);
    void cut(const Polygon& polygon);
    static void split(const Polygon& polygon, const glm::vec2& ray, Polygon& left, Polygon& right);
    void sweep(const Polygon& polygon, const glm::vec2& base, uint32_t sector);
    void give(uint32_t edge, const Polygon& part);
    void keep(uint32_t edge, const Polygon& part, float bound);
    uint32_t placeAmong(uint32_t edge, float bound);
    void finish();
    bool takeUnseen(std::span<const Old> old, float most);

    Effort effort_;
    std::vector<Face> face_;
    // Never moved: doubling would take twice the memory.
    static constexpr uint32_t kChunk = 1024;
    std::vector<std::unique_ptr<std::array<Piece, kChunk>>> chunk_;
    Piece& pieceAt(uint32_t i) const { return (*chunk_[i / kChunk])[i % kChunk]; }
    std::vector<uint32_t> free_;

    // While collapsing; all positions are relative to the merged vertex.
    struct Made {
        uint32_t piece;
        float bound;
    };
    struct Sector {
        std::array<Vec3f, 2> edge, dual;
        float rest;
        /// To get weights of the ring's corners; of the shorter edge's first: what it is off by,
        /// the other one makes good, so that together they are where they should be, whatever the
        /// triangle's shape.
        glm::vec2 to_shorter, to_longer, shorter;
        bool second_is_longer;
        uint32_t made;  ///< pieces: those that matter most, the first one least
        std::array<Made, kMostKept> piece;
    };
    const CollapsingStar* star_ = nullptr;
    const Plane* plane_ = nullptr;
    std::array<Sector, kMaxNeighbours> sector_;  // the new faces
    Source from_;                                // where the polygon at work is from
    std::array<Vec3f, 2> from_dual_;
    bool has_dual_ = false;
    float extent_ = 0, slack_ = 0, stated_ = 0, largest_ = 0;
    bool overflow_ = false;
};

}  // namespace pietra::pmesh
