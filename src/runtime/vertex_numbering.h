#pragma once
// Gives the vertices of a sequence of patches numbers, one number a lattice point, in bounded
// memory: what makes one indexed mesh of patches that share vertices along their borders.
//
// The sequence is told twice. In the first round every vertex is noted with its place in the
// sequence, and an external sort by position finds those that repeat an earlier one. In the second
// round vertices get their numbers in the order of their first appearance.
//
// Exact, and a function of the sequence alone. Memory: what is given, and 1.2 bits a vertex told;
// disk: 16 bytes a vertex told where memory does not hold them. Not thread-safe.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/budget.h"
#include "extmem/external_sort.h"
#include "geometry/vec.h"

namespace pietra {

class VertexNumbering {
public:
    /// `at_most`: vertices that will be told. Takes `memory_bytes` of `budget` at most, or throws
    /// MemoryError; temporary files are unnamed and lie in `temp_dir`.
    VertexNumbering(Budget& budget, size_t memory_bytes, std::string temp_dir, uint64_t at_most);

    /// First round.
    void note(std::span<const Vec3i> positions);
    /// Between the rounds.
    void finishNoting();
    /// Different points, known from then on.
    uint64_t count() const { return places_ - repeats_; }

    /// Second round: the same positions in the same order, however cut into calls. number[i] is
    /// that of positions[i]; one that comes for the first time has the next number, from 0 on.
    void number(std::span<const Vec3i> positions, std::vector<uint64_t>& number);

private:
    /// The place of a vertex in the sequence, by its position.
    struct Place {
        uint64_t key, place;
        bool operator<(const Place& o) const {
            return key != o.key ? key < o.key : place < o.place;
        }
    };
    /// A place whose vertex first came at an earlier one.
    struct Repeat {
        uint64_t place, first;
        bool operator<(const Repeat& o) const { return place < o.place; }
    };

    void setRepeat(uint64_t place) { is_repeat_[place / 64] |= uint64_t(1) << place % 64; }
    void countRepeats();
    /// Repeats before a place.
    uint64_t repeatsBefore(uint64_t place) const;

    Budget& budget_;
    const size_t memory_bytes_;
    const std::string temp_dir_;
    uint64_t places_ = 0;   // told in the first round
    uint64_t repeats_ = 0;  // of these
    uint64_t next_ = 0;     // place of the second round
    std::optional<ExternalSort<Place>> by_key_;
    std::optional<ExternalSort<Repeat>> by_place_;
    Repeat next_repeat_{};
    Reservation bits_reservation_;
    std::vector<uint64_t> is_repeat_;  // a bit a place
    std::vector<uint64_t> before_;     // repeats before each block of places
};

}  // namespace pietra
