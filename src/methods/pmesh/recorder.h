#pragma once
// Writes down every collapse of the simplifier as the vertex split that undoes it, and forbids
// those that no split could undo:
//   - of irregular vertices (non-manifold edges, bow-ties): locked, they stay in the base mesh;
//   - of stars with more than kMaxNeighbours;
//   - that would make chains of dependencies too long.
//
// A collapse depends on the last one of each vertex around: its criterion encloses theirs, and its
// height, the length of the longest chain, is one more. So both are known while collapsing,
// whatever comes later and elsewhere.
//
// Of each face it knows which leaves its corners were in the input, by their places among the
// leaves below the vertices that they are now: of a merged vertex those of v come first.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/bounds.h"
#include "methods/pmesh/normal_box.h"
#include "methods/pmesh/split_node.h"
#include "methods/pmesh/surface_map.h"
#include "methods/pmesh/vertex_words.h"
#include "simplify/collapse_sink.h"

namespace pietra::pmesh {

inline constexpr uint32_t kNoVertex = ~0u;
inline constexpr uint32_t kMostHeight = 0xfffe;
/// The least error that is stated, in steps.
inline constexpr double kLeastError = 1.0 / 64;

/// A collapse, as packing into nodes sees it.
struct CollapseLink {
    uint64_t u = 0;                 ///< a vertex: by its place in the recorder's mesh
    std::array<uint32_t, 2> child;  ///< the records that v and u came from, or kNoSplit
    uint32_t operations = 1;        ///< it and all below
    float error = 0;                ///< lattice units; as in the shape
    Box3i box;                      ///< likewise, in steps
};

/// The rest, as encoding sees it. Positions in steps, and as they were before the collapse.
struct CollapseShape {
    std::array<Vec3i, 2> position;   ///< of v and of u
    Vec3i merged;                    ///< of both after it
    std::array<uint16_t, 2> normal;  ///< of v and of u
    std::array<uint32_t, 2> leaves;  ///< the same
    /// Lattice units: the largest bound (surface_map.h) of the faces that this made; no less than
    /// that of those it depends on. They are in the box, too, and their normals in the box of
    /// these, where they are of a closed component.
    float error;
    Box3i box;
    NormalBox normals;
    bool closed = false;  ///< surely of a closed component
    uint16_t height;      ///< from 1
};
/// A face that a collapse removes: its corners, as leaves counted from the first of v's, of u's and
/// of the third vertex's.
struct CollapseWing {
    uint32_t vertex = kNoVertex;  ///< the third one; none: there is no such face
    std::array<uint32_t, 3> offset{};
};
struct CollapseRecord : CollapseShape {
    std::array<CollapseWing, 2> wing;  ///< of (v, u, third) and of (u, v, third)
};

/// What a vertex has been through.
struct VertexHistory {
    uint32_t last = kNoSplit;               ///< the record of the last collapse into it
    uint32_t height = 0;                    ///< of that
    uint32_t operations = 0;                ///< of that and all below: one less than leaves
    float error = 0;                        ///< of that
    Box3i box;                              ///< of that
    NormalBox normals = NormalBox::none();  ///< of that
    uint8_t unused = 0;
};

using FaceLeaves = std::array<uint32_t, 3>;  ///< of each corner, counted as in CollapseWing

class Recorder : public CollapseSink {
public:
    struct Refused {
        uint64_t irregular = 0, valence = 0, level = 0, unseen = 0;
    };

    /// `mesh`: the one that is simplified; `irregular`: one a vertex, as HalfEdges has it, or empty
    /// where such have the rank kRankFixed; both must outlive this. Positions are multiples of
    /// 2^shift. All is taken for closed.
    Recorder(const Mesh& mesh, std::span<const uint8_t> irregular, int shift);
    /// Goes on where others ended: `history` is that of the vertices, one each, `bound` and
    /// `leaves` those of the faces, `closed` whether these are surely of a closed component;
    /// records of this one are counted from `first_record` on.
    Recorder(const Mesh& mesh, std::vector<VertexHistory> history, const std::vector<float>& bound,
             std::vector<FaceLeaves> leaves, std::vector<uint8_t> closed,
             const SurfaceMap::Effort& effort, uint32_t first_record, int shift);

    /// From now on, heights come to at most so many above the largest that there is.
    void limitHeights(uint32_t more);

    void expect(uint32_t face, bool again) override {
        again ? map_.expectPieces(face) : map_.expect(face);
    }
    bool take(const CollapseStep& step) override;

    /// As many links as records; children before parents.
    std::vector<CollapseLink>& links() { return link_; }
    const std::vector<CollapseLink>& links() const { return link_; }
    std::vector<CollapseRecord>& records() { return record_; }
    /// For each record the words of v and of u before the collapse.
    std::vector<uint32_t>& words() { return words_; }
    uint32_t largestHeight() const { return largest_; }
    /// Attempts, not edges: an edge may be tried again.
    const Refused& refused() const { return refused_; }
    /// Of a face of the mesh that was not removed.
    float boundOf(uint32_t face) const { return map_.bound(face); }
    /// The same.
    bool isClosed(uint32_t face) const { return closed_[face]; }
    const FaceLeaves& leavesOf(uint32_t face) const { return leaves_[face]; }
    /// Has all its triangles in this mesh. Known only once a collapse was offered; else false.
    bool isInside(uint32_t v) const { return !inside_.empty() && inside_[v]; }
    const VertexHistory& historyOf(uint32_t v) const { return history_[v]; }
    OctNormal normalOf(uint32_t v) const { return normal_[v]; }

private:
    /// The neighbours of the merged vertex, counter-clockwise; where it is open, from the
    /// beginning.
    struct OrderedRing {
        std::array<uint32_t, kMaxNeighbours> vertex;
        uint32_t size = 0;
        bool closed = false;
    };

    static OrderedRing orderedRing(const Ring& ring);
    void addWords(const CollapseStep& step, uint32_t vertex);
    void enclose(const CollapseStep& step, const OrderedRing& ring, CollapseRecord& record) const;
    bool mapOn(const CollapseStep& step, const OrderedRing& ring, CollapseRecord& record);
    void removeFaces(const CollapseStep& step, CollapseRecord& record);
    bool spreadClosed(const CollapsingStar& star);
    uint32_t heightOf(uint32_t v) const { return history_[v].height; }
    Vec3i stepsOf(const WorkingMesh& mesh, const Vec3f& p) const;

    std::span<const uint8_t> irregular_;
    int shift_;
    std::vector<OctNormal> normal_;
    std::vector<VertexHistory> history_;
    std::vector<FaceLeaves> leaves_;
    std::vector<uint8_t> closed_, inside_;
    SurfaceMap map_;
    float largest_error_ = 0;  // of any face, ever
    uint32_t first_record_ = 0;
    std::vector<CollapseLink> link_;
    std::vector<CollapseRecord> record_;
    std::vector<uint32_t> words_;
    const WordLayout layout_;
    Mesh one_;  // of one vertex: room for its attributes
    uint32_t largest_ = 0, most_height_ = kMostHeight;
    Refused refused_;
};

}  // namespace pietra::pmesh
