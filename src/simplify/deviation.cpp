#include "simplify/deviation.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "simplify/deviation_direction.h"
#include "simplify/deviation_surface.h"

namespace pietra {

namespace {

using deviation::Direction;
using deviation::kNone;
using deviation::Progressing;
using deviation::Surface;

constexpr float kTookNothing = -1;

/// The same three positions, in any order.
bool sameTriangle(const Mesh& a, uint32_t ta, const Mesh& b, uint32_t tb) {
    for (const uint32_t v : a.triangle[ta]) {
        bool found = false;
        for (const uint32_t w : b.triangle[tb]) found |= a.position[v] == b.position[w];
        if (!found) return false;
    }
    for (const uint32_t w : b.triangle[tb]) {
        bool found = false;
        for (const uint32_t v : a.triangle[ta]) found |= a.position[v] == b.position[w];
        if (!found) return false;
    }
    return true;
}

/// Of the first `faces`.
float largestOf(const FaceBounds& bounds, size_t faces) {
    float error = 0;
    for (size_t f = 0; f < faces; ++f)
        error = std::max({error, bounds.to_original[f], bounds.from_original[f]});
    return error;
}

}  // namespace

struct Deviation::State {
    Surface before, after;
    Direction direction;
    std::vector<uint32_t> slot;           ///< per new face: an old face in the same slot, or kNone
    std::vector<uint8_t> kept_old;        ///< per old face: it is a face of the new mesh, unchanged
    std::vector<uint8_t> kept_new;        ///< per new face
    std::vector<deviation::Given> given;  ///< what went to faces that may be given up
    void findKept(const DeviationInput& in, FaceBounds& bounds);
    uint32_t startForOld(const DeviationInput& in, uint32_t t) const;
    uint32_t startForNew(uint32_t t) const;
    bool giveUp(const DeviationInput& in, FaceBounds& bounds, Progressing& progress);
    static uint32_t nearestTo(const Surface& source, uint32_t t, const Surface& target);
};

Deviation::Deviation() : state_(std::make_unique<State>()) {}
Deviation::~Deviation() = default;
Deviation::Deviation(Deviation&&) noexcept = default;
const Deviation::Counters& Deviation::counters() const {
    return state_->direction.counters();
}

Deviation& Deviation::operator=(Deviation&&) noexcept = default;

void Deviation::State::findKept(const DeviationInput& in, FaceBounds& bounds) {
    const uint32_t new_count = after.faceCount();
    slot.assign(new_count, kNone);
    kept_old.assign(before.faceCount(), 0);
    kept_new.assign(new_count, 0);
    const size_t mapped = std::min<size_t>(in.triangle_map.size(), before.faceCount());
    for (uint32_t t = 0; t < mapped; ++t) {
        const uint32_t f = in.triangle_map[t];
        if (f >= new_count) continue;
        slot[f] = t;
        const bool unchanged = f < in.triangle_changed.size() && in.triangle_changed[f] == 0;
        if (!unchanged || !sameTriangle(*in.before, t, *in.after, f)) continue;
        kept_old[t] = kept_new[f] = 1;
        bounds.to_original[f] = std::max(bounds.to_original[f], in.before_bounds->to_original[t]);
        bounds.from_original[f] = in.before_bounds->from_original[t];
    }
}

uint32_t Deviation::State::nearestTo(const Surface& source, uint32_t t, const Surface& target) {
    const Vec3f origin = source.corner(t, 0);
    const Vec3f centre = (source.corner(t, 1) - origin + source.corner(t, 2) - origin) / 3.0f;
    return target.nearest(origin, centre, {}, {0, HUGE_VALF}).face;
}

uint32_t Deviation::State::startForOld(const DeviationInput& in, uint32_t t) const {
    const uint32_t mapped = t < in.triangle_map.size() ? in.triangle_map[t] : kNone;
    if (mapped < after.faceCount() && !after.isRemoved(mapped)) return mapped;
    for (const uint32_t v : before.face(t).vertex) {
        if (v >= in.vertex_map.size() || in.vertex_map[v] >= after.vertexCount()) continue;
        const uint32_t f = after.faceAt(in.vertex_map[v]);
        if (f != kNone) return f;
    }
    return nearestTo(before, t, after);
}

uint32_t Deviation::State::startForNew(uint32_t t) const {
    return slot[t] != kNone ? slot[t] : nearestTo(after, t, before);
}

/// Gives up the new faces that are not worth it; false if all are.
bool Deviation::State::giveUp(const DeviationInput& in, FaceBounds& bounds, Progressing& progress) {
    const uint32_t faces = after.faceCount() - in.after_takes;
    const float error = largestOf(bounds, faces);
    std::vector<uint8_t> again(before.faceCount(), 0);
    bool some = false;
    for (uint32_t f = faces; f < after.faceCount(); ++f) {
        if (after.isRemoved(f) || in.worth(f, bounds.to_original[f], error)) continue;
        after.remove(f);
        bounds.to_original[f] = kTookNothing;
        some = true;
    }
    if (!some) return false;
    for (const deviation::Given& g : given)
        if (after.isRemoved(g.target)) again[g.source] = 1;
    std::erase_if(given, [&](const deviation::Given& g) { return after.isRemoved(g.target); });
    direction.begin(before, after, in.before_bounds->to_original, {}, bounds.to_original, true);
    direction.watch(faces, given);
    for (uint32_t t = 0; t < before.faceCount(); ++t)
        if (again[t]) direction.cover(t, startForOld(in, t), progress);
    direction.finish(progress);
    return true;
}

float Deviation::run(const DeviationInput& in, FaceBounds& bounds) {
    State& s = *state_;
    CHECK(in.before && in.after && in.before_bounds);
    CHECK(!in.before->triangle.empty() && !in.after->triangle.empty());
    const FaceBounds& old = *in.before_bounds;
    CHECK_EQ(old.to_original.size(), in.before->triangle.size());
    CHECK_EQ(old.from_original.size(), in.before->triangle.size());
    bounds.to_original.assign(in.after->triangle.size(), 0.0f);
    bounds.from_original.assign(in.after->triangle.size(), 0.0f);
    CHECK(in.before_takes <= in.before->triangle.size() &&
          in.after_takes <= in.after->triangle.size());
    std::fill_n(bounds.to_original.rbegin(), in.after_takes, kTookNothing);
    s.given.clear();
    s.before.assign(*in.before);
    s.after.assign(*in.after);
    s.findKept(in, bounds);
    Progressing progress{in.child_error, 0};
    s.direction.begin(s.before, s.after, old.to_original, {}, bounds.to_original, true);
    if (in.worth) s.direction.watch(s.after.faceCount() - in.after_takes, s.given);
    for (uint32_t t = 0; t < s.before.faceCount() - in.before_takes; ++t) {
        if (!s.kept_old[t]) s.direction.cover(t, s.startForOld(in, t), progress);
    }
    s.direction.finish(progress);
    s.direction.begin(s.after, s.before, {}, old.from_original, bounds.from_original, false);
    for (uint32_t t = 0; t < s.after.faceCount() - in.after_takes; ++t) {
        if (!s.kept_new[t]) s.direction.cover(t, s.startForNew(t), progress);
    }
    s.direction.finish(progress);
    bool again = bool(in.worth);
    while (again) again = s.giveUp(in, bounds, progress);
    return largestOf(bounds, s.after.faceCount());
}

}  // namespace pietra
