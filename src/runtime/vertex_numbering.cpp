#include "runtime/vertex_numbering.h"

#include <bit>

#include "base/check.h"
#include "geometry/lattice.h"

namespace pietra {

namespace {

constexpr uint64_t kNoPlace = ~uint64_t(0);
constexpr size_t kWordsOfBlock = 8;

}  // namespace

VertexNumbering::VertexNumbering(Budget& budget, size_t memory_bytes, std::string temp_dir,
                                 uint64_t at_most)
    : budget_(budget), memory_bytes_(memory_bytes), temp_dir_(std::move(temp_dir)) {
    // Sorting by position and sorting the repeats by place overlap.
    by_key_.emplace(budget, memory_bytes / 3 * 2, at_most, temp_dir_, "joining patches");
}

void VertexNumbering::note(std::span<const Vec3i> positions) {
    for (const Vec3i& p : positions) by_key_->append({latticeKey(p), places_++});
}

void VertexNumbering::finishNoting() {
    const size_t words = size_t(places_ / 64 + 1);
    bits_reservation_ =
        budget_.reserve((words + words / kWordsOfBlock + 1) * sizeof(uint64_t), "joining patches");
    is_repeat_.assign(words, 0);
    by_place_.emplace(budget_, memory_bytes_ / 3, places_, temp_dir_, "joining patches");
    Place first{kNoPlace, 0};
    for (Place place; by_key_->next(place);) {
        if (place.key != first.key) {
            first = place;
            continue;
        }
        by_place_->append({place.place, first.place});
        setRepeat(place.place);
        ++repeats_;
    }
    by_key_.reset();
    countRepeats();
    if (!by_place_->next(next_repeat_)) next_repeat_ = {kNoPlace, 0};
}

void VertexNumbering::countRepeats() {
    uint64_t sum = 0;
    for (size_t w = 0; w < is_repeat_.size(); ++w) {
        if (w % kWordsOfBlock == 0) before_.push_back(sum);
        sum += uint64_t(std::popcount(is_repeat_[w]));
    }
}

uint64_t VertexNumbering::repeatsBefore(uint64_t place) const {
    const size_t word = size_t(place / 64), block = word / kWordsOfBlock;
    uint64_t sum = before_[block];
    for (size_t w = block * kWordsOfBlock; w < word; ++w)
        sum += uint64_t(std::popcount(is_repeat_[w]));
    const uint64_t below = (uint64_t(1) << place % 64) - 1;
    return sum + uint64_t(std::popcount(is_repeat_[word] & below));
}

void VertexNumbering::number(std::span<const Vec3i> positions, std::vector<uint64_t>& number) {
    CHECK_LE(next_ + positions.size(), places_);
    number.resize(positions.size());
    uint64_t before = repeatsBefore(next_);
    for (uint64_t& n : number) {
        const uint64_t place = next_++;
        if (next_repeat_.place != place) {
            n = place - before;
            continue;
        }
        n = next_repeat_.first - repeatsBefore(next_repeat_.first);
        ++before;
        if (!by_place_->next(next_repeat_)) next_repeat_ = {kNoPlace, 0};
    }
}

}  // namespace pietra
