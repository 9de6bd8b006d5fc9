#pragma once
// The traversal behind page body 1, the same for encoder and decoder: it covers a patch triangle by
// triangle from its borders inward, and asks its `Side` only where the next triangle does not
// follow from what is known: how many triangles each vertex has. After Touma and Gotsman (1998);
// the order of the rules is FORMAT.md's, "Body 1". Internal to src/store.
//
// A front is a loop of items, each an occurrence of a vertex; what lies to the left of the loop is
// not yet covered. Several fronts are alive at a time (border loops at first; a split makes one of
// one, or joins two).
//
// Untrusted input is safe: every step checks that it leaves fronts in order, emits one triangle,
// and the caller's limit on triangles ends it.

#include <cstdint>
#include <vector>

#include "store/fan_mesh.h"

namespace pietra {

struct FrontItem {
    uint32_t vertex;
    uint32_t prev, next;
    uint32_t
        rest;  ///< uncovered triangles between the edge from prev and the edge to next; 0: dead
    uint32_t
        behind;  ///< third vertex of the covered triangle at the edge to next; kNone on a border
};

/// `Side` must have:
///   bool triangle(first, b, c): the next triangle, at the edge from item `first` to the item after
///   it,
///     which is the edge from its vertex to vertex b; false to stop
///   uint32_t symbol(V): 0 for a split, else the number of triangles (2 or more) of a new vertex
///   bool vertex(V, n, p, valence, id&): the new vertex in front of the edge from item V to item n
///   bool split(V, n, target&, left&): the item to which the front reaches over, and how many of
///   its
///     uncovered triangles fall to the part that stays with V
///   bool seed(): makes the front of a closed component, two items that are each other's next
///   void closed(i, p), added(V, x), joined(V, copy): the fronts have changed so
template <class Side>
class FrontWalk {
public:
    FrontWalk(Side& side, std::vector<FrontItem>& items) : side_(side), items_(items) {}

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
            uint32_t next = items_[pivot].next;
            while (items_[pivot].rest > 0) {
                next = items_[pivot].next;
                if (!step(pivot)) return false;
            }
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
        if (valence == 1 || valence == kNone) return false;
        return valence == 0 ? split(pivot) : add(pivot, valence);
    }

    /// The last triangle in the sector of `item`, which leaves the front.
    bool close(uint32_t item) {
        FrontItem& i = items_[item];
        FrontItem &p = items_[i.prev], &n = items_[i.next];
        if (i.prev == i.next || !side_.triangle(i.prev, i.vertex, n.vertex)) return false;
        if ((p.rest == 1 || n.rest == 1) && !(p.rest == 1 && n.rest == 1 && p.prev == i.next))
            return false;
        --p.rest;
        --n.rest;
        i.rest = 0;
        p.behind = i.vertex;
        p.next = i.next;
        n.prev = i.prev;
        side_.closed(item, i.prev);
        return true;
    }

    bool add(uint32_t pivot, uint32_t valence) {
        const uint32_t next = items_[pivot].next;
        uint32_t id;
        if (!side_.vertex(pivot, next, items_[pivot].prev, valence, id)) return false;
        const auto x = uint32_t(items_.size());
        items_.push_back({id, pivot, next, valence - 1, items_[pivot].vertex});
        FrontItem &v = items_[pivot], &n = items_[next];
        if (n.rest < 2 || !side_.triangle(pivot, n.vertex, id)) return false;
        v.behind = n.vertex;
        v.next = x;
        n.prev = x;
        --v.rest;
        --n.rest;
        side_.added(pivot, x);
        return true;
    }

    bool split(uint32_t pivot) {
        const uint32_t next = items_[pivot].next;
        uint32_t target, left;
        if (!side_.split(pivot, next, target, left)) return false;
        if (target >= items_.size() || target == pivot || target == next || left == 0 ||
            items_[target].rest < 3 || left > items_[target].rest - 2)
            return false;
        const auto copy = uint32_t(items_.size());
        items_.push_back({items_[target].vertex, items_[target].prev, next,
                          items_[target].rest - 1 - left, items_[pivot].vertex});
        FrontItem &v = items_[pivot], &n = items_[next], &w = items_[target];
        if (n.rest < 2 || !side_.triangle(pivot, n.vertex, w.vertex)) return false;
        items_[w.prev].next = copy;
        w.prev = pivot;
        w.rest = left;
        v.behind = n.vertex;
        v.next = target;
        n.prev = copy;
        --v.rest;
        --n.rest;
        side_.joined(pivot, copy);
        return true;
    }

    Side& side_;
    std::vector<FrontItem>& items_;
    uint32_t first_ = 0;  // no item before this one is alive
};

}  // namespace pietra
