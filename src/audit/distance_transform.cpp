#include "audit/distance_transform.h"

#include <algorithm>

#include "base/check.h"
#include "base/parallel.h"

namespace pietra {
namespace {

/// Distance along the column to the nearest marked pixel or to the rows just outside.
void scanColumns(const std::vector<uint8_t>& mask, const PictureSize& size, int begin, int end,
                 std::vector<int32_t>& vertical) {
    const auto at = [&](int x, int y) { return size_t(y) * size_t(size.width) + size_t(x); };
    for (int y = 0; y < size.height; ++y)
        for (int x = begin; x < end; ++x) {
            const int32_t above = y == 0 ? 0 : vertical[at(x, y - 1)];
            vertical[at(x, y)] = mask[at(x, y)] != 0 ? 0 : above + 1;
        }
    for (int y = size.height - 1; y >= 0; --y)
        for (int x = begin; x < end; ++x) {
            const int32_t below = y == size.height - 1 ? 0 : vertical[at(x, y + 1)];
            vertical[at(x, y)] = std::min(vertical[at(x, y)], below + 1);
        }
}

/// The lower envelope of the parabolas (x - i)^2 + vertical(i)^2, with marked columns -1 and width.
class RowEnvelope {
public:
    RowEnvelope(const int32_t* vertical, int width) : vertical_(vertical), width_(width) {
        for (int i = -1; i <= width_; ++i) push(i);
    }
    /// `squared` takes the values for x in [0, width).
    void evaluate(int32_t* squared) const {
        size_t k = 0;
        for (int x = 0; x < width_; ++x) {
            while (k + 1 < apex_.size() && start_[k + 1] <= x) ++k;
            squared[x] = int32_t(value(x, apex_[k]));
        }
    }

private:
    int64_t height(int i) const { return i < 0 || i >= width_ ? 0 : vertical_[i]; }
    int64_t value(int64_t x, int i) const { return (x - i) * (x - i) + height(i) * height(i); }
    /// First x from which apex `j` is at most as high as apex `i` < j.
    int64_t takeover(int i, int j) const {
        const int64_t numerator =
            int64_t(j) * j - int64_t(i) * i + height(j) * height(j) - height(i) * height(i);
        const int64_t denominator = 2 * int64_t(j - i);
        const int64_t q = numerator / denominator;
        return q + (numerator % denominator > 0);  // ceil
    }
    void push(int j) {
        int64_t start = -1;
        while (!apex_.empty()) {
            start = takeover(apex_.back(), j);
            if (start > start_.back()) break;
            apex_.pop_back();
            start_.pop_back();
            start = -1;
        }
        if (start > width_) return;
        apex_.push_back(j);
        start_.push_back(start);
    }

    const int32_t* vertical_;
    int width_;
    std::vector<int> apex_;
    std::vector<int64_t> start_;
};

}  // namespace

std::vector<int32_t> squaredDistances(const std::vector<uint8_t>& mask, const PictureSize& size) {
    CHECK_EQ(mask.size(), size_t(size.width) * size_t(size.height));
    std::vector<int32_t> vertical(mask.size()), squared(mask.size());
    parallelForSlices(size_t(size.width), 64, [&](size_t begin, size_t end) {
        scanColumns(mask, size, int(begin), int(end), vertical);
    });
    parallelForSlices(size_t(size.height), 16, [&](size_t begin, size_t end) {
        for (size_t y = begin; y < end; ++y) {
            const size_t row = y * size_t(size.width);
            RowEnvelope(&vertical[row], size.width).evaluate(&squared[row]);
        }
    });
    return squared;
}

}  // namespace pietra
