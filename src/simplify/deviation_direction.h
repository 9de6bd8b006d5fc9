#pragma once
// One direction of the deviation bound: covers faces of a source surface by faces of a target
// surface and keeps the largest value met, per target face (A) or per source face (B).
//
// A face is covered the fast way (FieldCover) or the general way (Partition). What stays below a
// running limit is accepted as it comes; the pieces above it wait in a heap and are verified, worst
// first: the exact nearest faces of a piece's corners give a lower bound of what any cover can
// reach, and are tried for the whole piece; where that does not help the piece is cut again or
// bisected.

#include <cstdint>
#include <span>
#include <vector>

#include "simplify/deviation.h"
#include "simplify/deviation_field.h"
#include "simplify/deviation_partition.h"
#include "simplify/deviation_surface.h"

namespace pietra::deviation {

/// Shared by both directions of a step.
struct Progressing {
    float floor = 0;     ///< values up to this are accepted without effort
    float verified = 0;  ///< largest value verified so far: the result will be no smaller

    /// Values up to this are accepted as they come.
    float limit() const;
    /// Pieces above this are verified.
    float verifyAbove() const;
};

/// A target face got something of a source face.
struct Given {
    uint32_t target, source;
};

class Direction {
public:
    /// Values are base[source face] + offset[target face] + distance; an empty span is zero.
    /// `value` is indexed by target face if `by_target`, else by source face. All borrowed.
    void begin(const Surface& source, const Surface& target, std::span<const float> base,
               std::span<const float> offset, std::span<float> value, bool by_target);

    /// Appends to `given`, borrowed until the next begin(), what goes to target faces from this one
    /// on.
    void watch(uint32_t first_target, std::vector<Given>& given) {
        first_watched_ = first_target;
        watched_ = &given;
    }

    /// Covers source face `t`, looking first at target face `start`.
    void cover(uint32_t t, uint32_t start, Progressing& progress);

    /// Verifies what was left; after this the values are final.
    void finish(Progressing& progress);

    const Deviation::Counters& counters() const { return counters_; }

private:
    float base(uint32_t t) const { return base_.empty() ? 0.0f : base_[t]; }
    float offset(uint32_t f) const { return offset_.empty() ? 0.0f : offset_[f]; }
    /// What the value is that accept() would raise.
    float reached(uint32_t source, uint32_t target) const {
        return value_[by_target_ ? target : source];
    }
    void accept(uint32_t source, uint32_t target, float value) {
        float& at = value_[by_target_ ? target : source];
        at = at < value ? value : at;
        if (watched_ && target >= first_watched_) watched_->push_back({target, source});
    }
    bool coverField(uint32_t t, uint32_t start, const Progressing& progress);
    void take(const Piece& piece, const Progressing& progress);
    void push(const Piece& piece);
    void verifyTop(Progressing& progress);
    void verify(const Piece& piece, Progressing& progress);
    void bisect(const Piece& piece, Progressing& progress);

    const Surface* source_ = nullptr;
    const Surface* target_ = nullptr;
    std::span<const float> base_, offset_;
    std::span<float> value_;
    bool by_target_ = false;
    uint32_t first_watched_ = 0;
    std::vector<Given>* watched_ = nullptr;
    FieldCover field_;
    Partition partition_;
    std::vector<Piece> heap_, parts_;
    Deviation::Counters counters_;
};

}  // namespace pietra::deviation
