#pragma once
// By how much all tolerances are raised while memory is too small for what is asked for (DESIGN:
// smoothly, with a dead band, so that it settles).

#include <algorithm>
#include <cstddef>

namespace pietra {

class SceneTolerance {
public:
    /// What a frame found.
    struct Found {
        bool same_request = false;  ///< as the frame before
        bool blocked = false;       ///< something needed does not fit
        size_t missing = 0;         ///< pages needed that are on their way
        double used_share = 0;      ///< of memory
    };

    double factor() const { return factor_; }
    /// As long as the request stays the same, so does the factor.
    bool settled() const { return settled_; }

    void adapt(const Found& found) {
        if (!found.same_request) too_fine_ = 0;
        const double before = factor_;
        if (found.blocked) {
            too_fine_ = factor_;
            factor_ = std::min(factor_ * kRaise, kMostRaised);
        } else if (found.missing == 0) {
            const double share = found.used_share;
            const double lower = share < kPlenty ? kLowerFast : share < kComfortable ? kLower : 1;
            // In the view that stays what did not fit once is not tried again.
            if (factor_ * lower > too_fine_) factor_ = std::max(1.0, factor_ * lower);
        }
        settled_ = found.missing == 0 && factor_ == before;
        if (found.blocked) settled_ = before == kMostRaised;
    }

private:
    static constexpr double kMostRaised = 1 << 20;
    static constexpr double kRaise = 1.1, kLower = 0.99, kLowerFast = 0.9;
    /// Of the budget: below these the factor comes down.
    static constexpr double kComfortable = 0.8, kPlenty = 0.5;

    double factor_ = 1;
    double too_fine_ = 0;  // with which memory was too small, in this view
    bool settled_ = false;
};

}  // namespace pietra
