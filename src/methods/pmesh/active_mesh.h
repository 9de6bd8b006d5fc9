#pragma once
// The mesh that a progressive mesh has been refined to: dense arrays that change in place, an
// element a vertex or a face, as a GPU would keep them (Derzapf et al. 2011, table 1).
//
// Where the paper gathers neighbourhoods by passes over all faces, each half-edge knows its twin
// here. A split or a merge then walks its own star, and writes to nothing but
//   - the vertices v and u,
//   - the star's own triangles, and those that come or go,
//   - the corner of a neighbour, if it is one of those that come or go.
// No triangle lies in the stars of two operations of a pass (adaption.h): so they run in any order,
// in parallel, without atomics and without a copy, to the same bytes.
//
// Base vertices and base triangles keep their places for ever: refined and coarsened again, the
// arrays are as they were.

#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "methods/pmesh/operations.h"
#include "methods/pmesh/twins.h"

namespace pietra::pmesh {

/// A triangle: its corners, the first once more at the end; and for each the corner at the same
/// vertex in the next triangle counter-clockwise, or kNoCorner.
struct alignas(32) ActiveFace {
    std::array<uint32_t, 4> vertex{};
    std::array<uint32_t, 4> left{};  ///< the fourth is another matter: its chunk
    /// That it is drawn in (draw_chunks.h). At first 1 for what is closed, and 0.
    uint32_t chunk() const { return left[3]; }
    bool operator==(const ActiveFace&) const = default;
};

/// What a vertex's neighbours look at.
struct alignas(16) VertexPulse {
    uint32_t name;
    /// One of its corners; where the fan is open, the first. Else, after a split and until the
    /// next, in a triangle with the other end.
    uint32_t corner;
    uint16_t next_level;  ///< of the next split, or kLeafLevel
    uint16_t last_level;  ///< 1 + that of the last, or 0; equal only for v and u of one split
    /// How many neighbours' next levels are lower: these must split before; and, in the upper half,
    /// how many neighbours' last levels are higher: these must merge before.
    uint32_t around = 0;
    uint32_t lower() const { return loadAround() & 0xffff; }
    uint32_t higher() const { return loadAround() >> 16; }
    uint32_t loadAround() const {
        return std::atomic_ref(const_cast<uint32_t&>(around)).load(std::memory_order_relaxed);
    }
    /// What it adds to `around` of a neighbour.
    uint32_t weightOn(const VertexPulse& neighbour) const {
        return uint32_t(next_level < neighbour.next_level) |
               uint32_t(last_level > neighbour.last_level) << 16;
    }
    bool operator==(const VertexPulse&) const = default;
};

/// What an operation on a vertex needs.
struct alignas(16) VertexRecord {
    OperationId next;                        ///< its next split, or kNoOperation
    OperationId last;                        ///< the split it came from last, or kNoOperation
    OperationId undo_last = 0;               ///< if it is the u of a split: what v had before
    uint16_t undo_normal = 0;                ///< the same
    uint16_t provisional = 0;                ///< 1: its split's criteria are a Reference's
    static constexpr uint16_t kRefused = 2;  ///< its split does not fit its star: it never splits
};

/// The spheres, errors and normals that a scan for work compares (criterion.h): those of the next
/// split, around the vertex, and, where canUndo(), those of the last one; there the sphere is a
/// smaller one around u, which tells in haste that nothing is to do.
struct VertexCriteria {
    uint16_t split_radius = 0;
    uint8_t split_error = 0;
    uint8_t unused = 0;
    uint32_t split_normals = 0;  ///< NormalBox::word()
    uint16_t merge_radius = kEverNeeded;
    uint8_t merge_error = 0;
    uint8_t unused_too = 0;
    uint32_t merge_normals = 0;
    static constexpr uint16_t kEverNeeded = 0x7fff;  ///< beyond all distances
    /// Added to merge_radius: a neighbour hinders the merge, whatever the view.
    static constexpr uint16_t kBlocked = 0x8000;
};

/// At most the radius that remains of the operation's sphere around its u: a code.
uint16_t radiusAroundU(const Operation& o);

/// The triangles around a vertex, counter-clockwise; where the fan is open, from its beginning.
struct Star {
    static constexpr uint32_t kRoom = 24;
    uint32_t count = 0;  ///< of corners; 0: more than there is room for
    bool closed = false;
    uint32_t first = 0;                  ///< ranks count from here
    std::array<uint32_t, kRoom> corner;  ///< at the vertex
    std::array<uint32_t, kRoom + 1> neighbour;
    uint32_t neighbours() const { return closed ? count : count + 1; }
    uint32_t placeOf(uint32_t rank) const {
        const uint32_t place = first + rank;
        return place < neighbours() ? place : place - neighbours();
    }
    std::span<const uint32_t> ring() const { return {neighbour.data(), neighbours()}; }
};

class ActiveMesh {
public:
    /// The base mesh. `mesh` must outlive this; validate() must find no fault. `references`: only
    /// where some of it is not loaded.
    explicit ActiveMesh(const ProgressiveMesh& mesh, const References* references = nullptr);

    std::vector<Vertex> vertex;
    std::vector<VertexPulse> pulse;
    std::vector<VertexCriteria> criteria;
    std::vector<VertexRecord> record;
    std::vector<ActiveFace> face;
    /// One a chunk: faces of it, or their vertices, have changed. Empty if nobody asks.
    std::vector<uint8_t> chunk_touched;

    const ProgressiveMesh& source() const { return *source_; }
    size_t vertexCount() const { return vertex.size(); }
    size_t faceCount() const { return face.size(); }
    void resize(size_t vertices, size_t faces);

    uint32_t vertexAt(uint32_t corner) const { return face[corner >> 2].vertex[corner & 3]; }
    /// The corner at the same vertex in the next face counter-clockwise, or kNoCorner.
    uint32_t leftOf(uint32_t corner) const { return face[corner >> 2].left[corner & 3]; }
    uint32_t twinOf(uint32_t half_edge) const { return leftOf(nextCorner(half_edge)); }

    /// body(w) for each neighbour w of v, until it returns false; false then. v must not be
    /// irregular.
    template <class Body>
    bool allNeighbours(uint32_t v, Body&& body) const;

    /// Walks around several vertices in step, so that what one waits for, others use. At most
    /// kTogether at a time; prefetch(w) is called for each neighbour. Stars begin anywhere.
    static constexpr uint32_t kTogether = 16;
    template <class Prefetch>
    void gatherStars(std::span<const uint32_t> vertices, Star* stars, Prefetch&& prefetch) const;

    /// Finds from where ranks count in the star of a vertex that is to split: where it is closed,
    /// from the neighbour of the least name. False if it has too many neighbours.
    [[nodiscard]] bool orient(Star& star) const;
    /// Orients it. False if v cannot split so: always true of models without damage.
    [[nodiscard]] bool mayBeNext(Star& star, uint32_t v) const;
    /// The last split of `u` made it.
    bool isNewEnd(uint32_t u) const {
        return pulse[u].last_level != 0 && pulse[u].name == source_->nameOf(record[u].last);
    }
    /// The operation that `u` came from last made it, or is a dummy: it is undone from here.
    bool canUndo(uint32_t u) const {
        const OperationId last = record[u].last;
        return last != kNoOperation && (isNewEnd(u) || source_->at(last).isDummy());
    }

    /// The other end of the last split of v, or v itself if that one has gone on or there is none.
    uint32_t otherEnd(uint32_t v) const {
        const VertexPulse& p = pulse[v];
        if (p.last_level == 0) return v;
        for (const uint32_t w :
             {vertexAt(nextCorner(p.corner)), vertexAt(previousCorner(p.corner))})
            if (pulse[w].last_level == p.last_level) return w;
        uint32_t other = v;
        allNeighbours(v, [&](uint32_t w) {
            if (pulse[w].last_level == p.last_level) other = w;
            return other == v;
        });
        return other;
    }

    bool isNextLoaded(uint32_t v) const { return source_->isLoaded(record[v].next); }
    /// Takes the criteria of the next split of v, which has been loaded since, from itself.
    void updateCriteria(uint32_t v);

    /// Performs the next operation of v alone, and makes room for it. False, and nothing done, if
    /// its ranks do not fit v's star.
    [[nodiscard]] bool apply(uint32_t v);

    /// Performs the next operation of v, a dummy; undoes its last, one too.
    void move(uint32_t v, const Star& star);
    void moveBack(uint32_t v, const Star& star);

    /// Performs the next split of v, no dummy, whose oriented star is `star`. u and `faces`, one
    /// for each of the operation's ranks, the first ones, are made; room for them must be there.
    /// Returns which neighbours are v's now, and which u's: a bit each, in the star's order.
    std::array<uint32_t, 2> split(uint32_t v, const Star& star, uint32_t u,
                                  std::array<uint32_t, 2> faces);

    /// Undoes the split that made v and u of one, whose stars are these. Returns the faces that are
    /// free now, kNoCorner for none. u is free too; its name is kNoCorner then.
    std::array<uint32_t, 2> merge(uint32_t v, const Star& star, uint32_t u, const Star& other);

    /// Moves the last elements into the places of these, all different, and shrinks the arrays.
    void fillHoles(std::vector<uint32_t>& free_vertices, std::vector<uint32_t>& free_faces);

    /// Puts vertices and faces that are neighbours near each other, but for those of the base:
    /// walks then find them in the cache.
    void sortInSpace();

private:
    /// Of a neighbour: other operations may look at it, but only one has a reason to change it.
    std::atomic_ref<uint32_t> corner(uint32_t v) { return std::atomic_ref(pulse[v].corner); }
    void setVertexAt(uint32_t corner, uint32_t v) {
        ActiveFace& f = face[corner >> 2];
        f.vertex[corner & 3] = v;
        if ((corner & 3) == 0) f.vertex[3] = v;
    }
    void setTwin(uint32_t half_edge, uint32_t other) {
        const uint32_t corner = nextCorner(half_edge);
        face[corner >> 2].left[corner & 3] = other;
    }
    /// Of a neighbour of several vertices that change at once.
    void addAround(uint32_t v, uint32_t weight) {
        std::atomic_ref(pulse[v].around).fetch_add(weight, std::memory_order_relaxed);
    }
    void touch(const Star& star);
    void changeAround(uint32_t v, const Star& star, const VertexPulse& before);
    void changeAround(const Star& star, const VertexPulse& before, VertexPulse& a, uint32_t of_a,
                      VertexPulse& b, uint32_t of_b);
    void setNext(uint32_t v, OperationId next);
    void setLast(uint32_t v, OperationId last);
    void link(uint32_t half_edge, uint32_t other);
    uint32_t firstCorner(uint32_t corner) const;
    void moveVertex(uint32_t from, uint32_t to);
    void moveFaces(const std::vector<uint32_t>& from, const std::vector<uint32_t>& to,
                   size_t count);

    const ProgressiveMesh* source_;
    const References* references_;
};

/// Applies all operations in their order; validate() must find no fault. Empty if each finds the
/// star that it was encoded for, as far as that shows; else a sentence about the first that does
/// not.
[[nodiscard]] std::string validateStars(const ProgressiveMesh& mesh);

template <class Body>
bool ActiveMesh::allNeighbours(uint32_t v, Body&& body) const {
    const uint32_t first = pulse[v].corner;
    for (uint32_t c = first;;) {
        if (!body(vertexAt(nextCorner(c)))) return false;
        const uint32_t before = previousCorner(c), left = twinOf(before);
        if (left == kNoCorner) return body(vertexAt(before));
        if (left == first) return true;
        c = left;
    }
}

template <class Prefetch>
void ActiveMesh::gatherStars(std::span<const uint32_t> vertices, Star* stars,
                             Prefetch&& prefetch) const {
    std::array<uint32_t, kTogether> corner;
    uint32_t walking = (1u << vertices.size()) - 1;
    for (size_t i = 0; i < vertices.size(); ++i) {
        corner[i] = pulse[vertices[i]].corner;
        __builtin_prefetch(&face[corner[i] >> 2]);
        stars[i].count = stars[i].first = 0;
        stars[i].closed = false;
    }
    while (walking != 0)
        for (uint32_t rest = walking; rest != 0; rest &= rest - 1) {
            const uint32_t i = uint32_t(std::countr_zero(rest)), c = corner[i];
            const ActiveFace& f = face[c >> 2];
            Star& star = stars[i];
            const uint32_t w = f.vertex[(c & 3) + 1], left = f.left[c & 3], at = star.count++;
            star.corner[at] = c;
            star.neighbour[at] = w;
            prefetch(w);
            if (left == kNoCorner) {
                star.neighbour[at + 1] = vertexAt(previousCorner(c));
                prefetch(star.neighbour[at + 1]);
            } else if (left == star.corner[0]) {
                star.closed = true;
            } else if (at + 1 == Star::kRoom) {
                star.count = 0;
            } else {
                corner[i] = left;
                __builtin_prefetch(&face[left >> 2]);
                continue;
            }
            walking &= ~(1u << i);
        }
}

}  // namespace pietra::pmesh
