#include "simplify/deviation_direction.h"

#include <algorithm>
#include <cmath>

namespace pietra::deviation {

namespace {

/// Below this part of the children's error nothing is worth an effort.
constexpr float kFloorPart = 0.2f;
/// Accepted as it comes: this part of what was verified already.
constexpr float kAcceptPart = 0.5f;
/// A height over a face is accepted up to this part of what the step's error will be at least,
/// whatever the face had before.
constexpr float kAcceptHeight = 0.2f;
/// Verified: whatever is above this part of the largest value verified.
constexpr float kVerifyPart = 0.9f;
/// A piece this much above the largest value verified is verified at once, not at the end.
constexpr float kEagerFactor = 1.5f;
/// Above this cosine of the normals the vertical distance will do for what is below the largest.
constexpr float kVerticalIsTight = 0.7f;
/// Lattice units: far below what rounding to the lattice costs.
constexpr float kNegligible = 0x1p-4f;
/// A value this close to its lower bound is good enough.
constexpr float kTightEnough = 1.05f;
/// A piece is cut no more often than this.
constexpr int kMaxCuts = 20;
/// A new cut must gain this much, or the piece is bisected.
constexpr float kWorthACut = 0.9f;

bool smaller(const Piece& a, const Piece& b) {
    return a.value < b.value;
}

}  // namespace

float Progressing::limit() const {
    return std::max({kFloorPart * floor, kAcceptPart * verified, kNegligible});
}
float Progressing::verifyAbove() const {
    return std::max({kFloorPart * floor, kVerifyPart * verified, kNegligible});
}

void Direction::begin(const Surface& source, const Surface& target, std::span<const float> base,
                      std::span<const float> offset, std::span<float> value, bool by_target) {
    source_ = &source;
    target_ = &target;
    base_ = base;
    offset_ = offset;
    value_ = value;
    by_target_ = by_target;
    field_.setTarget(target);
    partition_.setTarget(target, offset);
    heap_.clear();
    watched_ = nullptr;
}

void Direction::cover(uint32_t t, uint32_t start, Progressing& progress) {
    ++counters_.faces;
    while (!heap_.empty() && heap_.front().value > kEagerFactor * progress.verified &&
           heap_.front().value > progress.verifyAbove()) {
        verifyTop(progress);
    }
    if (coverField(t, start, progress)) return;
    ++counters_.general;
    const Vec3f origin = source_->corner(t, 0);
    parts_.clear();
    partition_.cover(Polygon::of(source_->local(t, origin)), origin, t, base(t), start,
                     progress.limit(), parts_);
    for (const Piece& piece : parts_) take(piece, progress);
}

bool Direction::coverField(uint32_t t, uint32_t start, const Progressing& progress) {
    if (!field_.run(*source_, t, start)) return false;
    const float limit = progress.limit(), above = progress.verifyAbove();
    const float height_limit = kAcceptHeight * std::max(progress.floor, progress.verified);
    const float b = base(t) + field_.slack();
    for (const FieldCover::Hit& hit : field_.hits()) {
        ++counters_.overlaps;
        const float value = (b + offset(hit.face) + hit.height) * (1 + 0x1p-21f);
        if (value <= limit || value <= reached(t, hit.face) ||
            hit.height + field_.slack() <= height_limit ||
            (value <= above && hit.cosine > kVerticalIsTight)) {
            ++counters_.by_overlap;
            accept(t, hit.face, value);
            continue;
        }
        Piece piece{{}, t, hit.face, b, value};
        if (!field_.overlap(hit.face, piece.polygon)) return false;
        if (piece.polygon.count < 3) continue;
        const Vec3f origin = source_->corner(t, 0);
        piece.value = std::min(value, partition_.value(piece.polygon, origin, b, hit.face));
        take(piece, progress);
    }
    return true;
}

void Direction::take(const Piece& piece, const Progressing& progress) {
    if (piece.value <= std::max(progress.verifyAbove(), reached(piece.source, piece.target))) {
        accept(piece.source, piece.target, piece.value);
    } else {
        ++counters_.pieces;
        push(piece);
    }
}

void Direction::push(const Piece& piece) {
    heap_.push_back(piece);
    std::push_heap(heap_.begin(), heap_.end(), smaller);
}

void Direction::finish(Progressing& progress) {
    while (!heap_.empty() && heap_.front().value > progress.verifyAbove()) verifyTop(progress);
    for (const Piece& piece : heap_) accept(piece.source, piece.target, piece.value);
    heap_.clear();
}

void Direction::verifyTop(Progressing& progress) {
    std::pop_heap(heap_.begin(), heap_.end(), smaller);
    const Piece piece = heap_.back();
    heap_.pop_back();
    verify(piece, progress);
}

void Direction::verify(const Piece& piece, Progressing& progress) {
    if (piece.value <= reached(piece.source, piece.target)) {
        accept(piece.source, piece.target, piece.value);
        return;
    }
    ++counters_.verified;
    const Vec3f origin = source_->corner(piece.source, 0);
    const float b = piece.base;
    Piece best = piece;
    const auto finish = [&](float lower) {
        const float slack = distanceSlack(best.polygon, target_->local(best.target, origin));
        if (best.value > std::max(progress.verifyAbove(), kTightEnough * lower + 2 * slack) &&
            piece.cuts < kMaxCuts) {
            return false;
        }
        accept(best.source, best.target, best.value);
        progress.verified = std::max(progress.verified, best.value);
        return true;
    };
    // The worst corner first: mostly it settles the matter.
    const int worst_corner = farthestCorner(piece.polygon, target_->local(piece.target, origin));
    float lower = 0;
    Surface::Nearest worst;
    for (int turn = 0; turn < piece.polygon.count; ++turn) {
        const int i = turn == 0 ? worst_corner : turn <= worst_corner ? turn - 1 : turn;
        const Surface::Nearest near = target_->nearest(origin, piece.polygon.corner[i], offset_,
                                                       {piece.target, piece.value - b});
        if (near.value > worst.value || turn == 0) worst = near;
        lower = std::max(lower, b + near.value);
        if (near.face != best.target) {
            const float value = partition_.value(piece.polygon, origin, b, near.face);
            if (value < best.value) {
                best.value = value;
                best.target = near.face;
            }
        }
        if (turn == 0 && finish(lower)) return;
    }
    if (finish(lower)) return;
    parts_.clear();
    partition_.cover(piece.polygon, origin, piece.source, b, worst.face, progress.verifyAbove(),
                     parts_);
    float reached = 0;
    for (const Piece& part : parts_) reached = std::max(reached, part.value);
    if (reached > kWorthACut * best.value) {
        bisect(best, progress);
    } else {
        for (Piece& part : parts_) {
            part.cuts = piece.cuts + 1;
            take(part, progress);
        }
    }
}

void Direction::bisect(const Piece& piece, Progressing& progress) {
    const Vec3f origin = source_->corner(piece.source, 0);
    Vec3f from(0), to(0);
    float longest = -1;
    for (int i = 0; i < piece.polygon.count; ++i) {
        for (int j = 0; j < i; ++j) {
            const Vec3f &p = piece.polygon.corner[i], &q = piece.polygon.corner[j];
            const float length = glm::distance(p, q);
            if (length > longest) {
                longest = length;
                from = p;
                to = q;
            }
        }
    }
    Piece half[2] = {piece, piece};
    if (!splitPolygon(piece.polygon, 0.5f * (from + to), from - to, half[0].polygon,
                      half[1].polygon)) {
        accept(piece.source, piece.target, piece.value);
        progress.verified = std::max(progress.verified, piece.value);
        return;
    }
    for (Piece& part : half) {
        if (part.polygon.count < 3) continue;
        ++part.cuts;
        part.value = partition_.value(part.polygon, origin, piece.base, piece.target);
        take(part, progress);
    }
}

}  // namespace pietra::deviation
