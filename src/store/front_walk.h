#pragma once
// The traversal behind page body 1, the same for encoder and decoder: it covers a patch triangle by
// triangle from its borders inward, and asks its `Side` only where the next triangle does not
// follow from what is known: how many triangles each vertex has. After Touma and Gotsman (1998);
// the order of the rules is FORMAT.md's, "Body 1". Internal to src/store.
//
// A front is a loop of items, each an occurrence of a vertex; what lies to the left of the loop is
// not yet covered. Several fronts are alive at a time (border loops at first; a split makes two of
// one, or joins two).
//
// Untrusted input is safe: every step checks that it leaves fronts in order, emits one triangle,
// and the side's limits on vertices and triangles end it.

#include <cstdint>
#include <vector>

#include "base/check.h"
#include "store/lanes.h"

namespace pietra {

inline constexpr uint32_t kNone = ~uint32_t(0);

struct FrontItem {
    Lanes at;    ///< position of the vertex
    Lanes over;  ///< where the parallelogram over the edge to next expects the vertex beyond it
    uint32_t vertex;
    uint32_t prev, next;
    uint32_t
        rest;  ///< uncovered triangles between the edge from prev and the edge to next; 0: dead
};

/// All items of a patch, dead and alive, in a room whose size is known beforehand.
class FrontItems {
public:
    /// Room for `vertices` first occurrences, and one more with each of `triangles` triangles.
    void reset(size_t vertices, size_t triangles) {
        if (items_.size() < vertices + triangles) items_.resize(vertices + triangles);
        count_ = 0;
    }
    uint32_t push(const FrontItem& item) {
        DCHECK(count_ < items_.size());
        items_[count_] = item;
        return count_++;
    }
    uint32_t size() const { return count_; }
    FrontItem& operator[](uint32_t i) { return items_[i]; }
    const FrontItem& operator[](uint32_t i) const { return items_[i]; }

private:
    std::vector<FrontItem> items_;
    uint32_t count_ = 0;
};

/// `Side` must have:
///   bool triangle(first, b, c): the next triangle, at the edge from item `first` to the item after
///   it,
///     which is the edge from its vertex to vertex b; false to stop
///   uint32_t symbol(V): 0 for a split, else the number of triangles (2 or more) of a new vertex
///   bool vertex(V, id&): the new vertex in front of the edge from item V to the next; false to
///   stop bool split(V, target&, left&): the item to which the front reaches over, and how many of
///   its
///     uncovered triangles fall to the part that stays with V
///   bool seed(): makes the front of a closed component, two items that are each other's next
///   void closed(i, p), added(V, x): the front now has a new edge after item p; after V and after x
template <class Side>
class FrontWalk {
public:
    FrontWalk(Side& side, FrontItems& items) : side_(side), items_(items) {}

    /// Covers everything to the left of the fronts in `items`, then `closed_components` more; may
    /// be called again for more of these. Returns false where the side did, or where fronts would
    /// not stay in order.
    [[nodiscard]] bool run(uint32_t closed_components) {
        for (;;) {
            while (first_ < items_.size() && items_[first_].rest == 0) ++first_;
            if (first_ < items_.size()) {
                if (!cover(first_)) return false;
            } else if (closed_components == 0) {
                return true;
            } else {
                --closed_components;
                if (!side_.seed()) return false;
            }
        }
    }

private:
    /// From pivot to pivot along a front until it is used up.
    bool cover(uint32_t pivot) {
        while (items_[pivot].rest > 0) {
            uint32_t next;
            do {
                next = items_[pivot].next;
                if (!step(pivot)) return false;
            } while (items_[pivot].rest > 0);
            pivot = next;
        }
        return true;
    }

    bool step(uint32_t pivot) {
        const FrontItem& v = items_[pivot];
        if (v.rest == 1) return close(pivot);
        if (items_[v.next].rest == 1) return close(v.next);
        if (items_[v.prev].rest == 1) return close(v.prev);
        const uint32_t valence = side_.symbol(pivot);
        return valence == 0 ? split(pivot) : add(pivot, valence);
    }

    /// The last triangle in the sector of `item`, which leaves the front.
    bool close(uint32_t item) {
        FrontItem& i = items_[item];
        FrontItem &p = items_[i.prev], &n = items_[i.next];
        if (i.prev == i.next || !side_.triangle(i.prev, i.vertex, n.vertex)) return false;
        const bool last = p.rest == 1 && n.rest == 1 && p.prev == i.next;
        if ((p.rest == 1 || n.rest == 1) && !last) return false;
        --p.rest;
        --n.rest;
        i.rest = 0;
        p.over = p.at + n.at - i.at;
        p.next = i.next;
        n.prev = i.prev;
        side_.closed(item, i.prev);
        return true;
    }

    bool add(uint32_t pivot, uint32_t valence) {
        uint32_t id;
        Lanes at;
        if (valence == 1 || !side_.vertex(pivot, id, at)) return false;
        FrontItem& v = items_[pivot];
        const uint32_t next = v.next;
        FrontItem& n = items_[next];
        if (n.rest < 2 || !side_.triangle(pivot, n.vertex, id)) return false;
        const Lanes along = n.at - v.at;
        const uint32_t x = items_.push({at, at + along, id, pivot, next, valence - 1});
        v.over = at - along;
        v.next = x;
        n.prev = x;
        --v.rest;
        --n.rest;
        side_.added(pivot, x);
        return true;
    }

    bool split(uint32_t pivot) {
        uint32_t target, left;
        if (!side_.split(pivot, target, left)) return false;
        const uint32_t next = items_[pivot].next;
        if (target >= items_.size() || target == pivot || target == next || left == 0 ||
            items_[target].rest < 3 || left > items_[target].rest - 2)
            return false;
        FrontItem &v = items_[pivot], &n = items_[next], &w = items_[target];
        if (n.rest < 2 || !side_.triangle(pivot, n.vertex, w.vertex)) return false;
        const Lanes along = n.at - v.at;
        const uint32_t copy =
            items_.push({w.at, w.at + along, w.vertex, w.prev, next, w.rest - 1 - left});
        items_[w.prev].next = copy;
        w.prev = pivot;
        w.rest = left;
        v.over = w.at - along;
        v.next = target;
        n.prev = copy;
        --v.rest;
        --n.rest;
        side_.added(pivot, copy);
        return true;
    }

    Side& side_;
    FrontItems& items_;
    uint32_t first_ = 0;  // no item before this one is alive
};

}  // namespace pietra
