#pragma once
// Writes down every collapse of the simplifier as the vertex split that undoes it, and forbids
// those that no split could undo:
//   - of irregular vertices (non-manifold edges, bow-ties): locked, they stay in the base mesh;
//   - of stars with more neighbours than ranks can tell.
// Where an edge is so long beside others around it that eight bits a coordinate would not do, its
// ends are first moved by dummy operations.
//
// Heights are levels counted from the fine side: one more than the largest height around. So they
// are known while collapsing, whatever comes later and elsewhere.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/bounds.h"
#include "methods/pmesh/normal_box.h"
#include "methods/pmesh/operations.h"
#include "methods/pmesh/surface_map.h"
#include "methods/pmesh/vertex_words.h"
#include "simplify/collapse_sink.h"

namespace pietra::pmesh {

inline constexpr uint32_t kNoVertex = ~0u;

/// A collapse, as packing into nodes sees it.
struct CollapseLink {
    static constexpr uint64_t kNone = ~uint64_t(0);
    uint64_t u = kNone;  ///< a vertex: by its place in the recorder's mesh; of a dummy none
    std::array<uint32_t, 2> child;  ///< the records that v and u came from, or kNoOperation
    uint32_t operations = 1;        ///< it and all below
    /// Lattice units: the largest bound (surface_map.h) of the faces that this made; no less than
    /// those below.
    float error = 0;
    Box3i box;  ///< of where it and all below bring vertices, in steps
};

/// The rest, as encoding sees it. Positions in steps, and as they were before the collapse.
struct CollapseShape {
    std::array<Vec3i, 2> position;            ///< of v and of u
    std::array<uint16_t, 2> normal;           ///< the same
    float error;                              ///< as in the link
    uint32_t radius = 0;                      ///< from the merged vertex to the farthest touched
    uint16_t height;                          ///< from 1
    uint8_t left = kNoRank, right = kNoRank;  ///< of vl and vr, in the ring
    uint8_t ring_size = 0;                    ///< 0: a dummy
    bool closed = false;
    /// Of the faces that it and all below found and made, if they are of a closed component.
    NormalBox normals;
};
struct CollapseRecord : CollapseShape {
    /// The neighbours of the merged vertex, counter-clockwise; where it is open, from the
    /// beginning.
    std::array<uint32_t, kMaxNeighbours> ring;
};

/// How the offsets of one operation's ends are stored.
struct QuantisedOffsets {
    uint8_t shift = 0;
    std::array<std::array<int8_t, 3>, 2> delta;
};
QuantisedOffsets quantiseOffsets(const std::array<Vec3i, 2>& offset);

/// What a vertex has been through.
struct VertexHistory {
    uint32_t last = kNoOperation;           ///< the record of the last collapse into it
    uint32_t height = 0;                    ///< of that
    uint32_t operations = 0;                ///< of that and all below
    float error = 0;                        ///< of that
    Box3i box;                              ///< of that and all below
    NormalBox normals = NormalBox::none();  ///< likewise: CollapseShape::normals
    uint8_t unused = 0;
};

class Recorder : public CollapseSink {
public:
    struct Refused {
        uint64_t irregular = 0, valence = 0, level = 0, unseen = 0;
    };

    /// `mesh`: the one that is simplified; `irregular`: one a vertex, as HalfEdges has it, or empty
    /// where such have the rank kRankFixed; both must outlive this. Positions are multiples of
    /// 2^shift. All is taken for closed.
    Recorder(const Mesh& mesh, std::span<const uint8_t> irregular, int shift);
    /// Goes on where others ended: `history` is that of the vertices, one each, `bound` that of the
    /// faces, `closed` whether these are surely of a closed component; records of this one are
    /// counted from `first_record` on.
    Recorder(const Mesh& mesh, std::vector<VertexHistory> history, const std::vector<float>& bound,
             std::vector<uint8_t> closed, const SurfaceMap::Effort& effort, uint32_t first_record,
             int shift);

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
    /// For each record the words of v and of u (of a dummy the same twice) before the collapse.
    std::vector<uint32_t>& words() { return words_; }
    uint32_t largestHeight() const { return largest_; }
    uint64_t dummies() const { return dummies_; }
    /// Attempts, not edges: an edge may be tried again.
    const Refused& refused() const { return refused_; }
    /// Of a face of the mesh that was not removed.
    float boundOf(uint32_t face) const { return map_.bound(face); }
    /// The same.
    bool isClosed(uint32_t face) const { return closed_[face]; }
    /// Has all its triangles in this mesh. Known only once a collapse was offered; else false.
    bool isInside(uint32_t v) const { return !inside_.empty() && inside_[v]; }
    const VertexHistory& historyOf(uint32_t v) const { return history_[v]; }
    OctNormal normalOf(uint32_t v) const { return normal_[v]; }

private:
    float precisionAt(const CollapseStep& step, uint32_t end) const;
    void addWords(const CollapseStep& step, uint32_t vertex);
    void recordDummy(const CollapseStep& step, uint32_t end, const NormalBox& normals);
    void push(uint32_t v, CollapseLink link, CollapseRecord record);
    void gatherRing(const CollapseStep& step, CollapseRecord& record) const;
    bool mapOn(const CollapseStep& step, CollapseRecord& record);
    bool spreadClosed(const CollapsingStar& star);
    uint32_t heightOf(uint32_t v) const { return history_[v].height; }
    Vec3i stepsOf(const WorkingMesh& mesh, const Vec3f& p) const;

    std::span<const uint8_t> irregular_;
    int shift_;
    std::vector<OctNormal> normal_;
    std::vector<VertexHistory> history_;
    std::vector<uint8_t> closed_, inside_;
    SurfaceMap map_;
    float largest_error_ = 0;  // of any face, ever
    uint32_t first_record_ = 0;
    std::vector<CollapseLink> link_;
    std::vector<CollapseRecord> record_;
    std::vector<uint32_t> words_;
    const WordLayout layout_;
    Mesh one_;  // of one vertex: room for its attributes
    uint32_t largest_ = 0, most_height_ = kMaxLevel;
    uint64_t dummies_ = 0;
    Refused refused_;
};

}  // namespace pietra::pmesh
