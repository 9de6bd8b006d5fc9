#pragma once
// Temporary data of a build: a store that lies in memory as far as the budget allows and in an
// unlinked file beyond. Positions are stable; any thread may append and read at any time. What was
// appended is read back by position and size; there is no order between appends of different
// threads.

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "base/budget.h"
#include "extmem/file.h"

namespace pietra {

/// Where temporary data goes, and how much memory it may take.
struct TempSpace {
    std::string directory;
    Budget* budget = nullptr;             ///< memory taken from here, as long as...
    size_t keep_free_bytes = 0;           ///< ...this much of it stays free for the work itself
    std::string kept{};                   ///< folder of what outlives the process, or none
    std::atomic<uint64_t> bytes{0};       ///< temporary bytes held now, in memory and in files
    std::atomic<uint64_t> peak_bytes{0};  ///< largest value of `bytes`
    void add(uint64_t more);
    void remove(uint64_t less) { bytes.fetch_sub(less); }
};

class Spill {
public:
    /// One with a name can outlive the process, where the space keeps such.
    explicit Spill(TempSpace& space, const std::string& name = "")
        : space_(&space),
          path_(name.empty() || space.kept.empty() ? "" : space.kept + "/" + name) {}
    ~Spill() { clear(); }
    Spill(const Spill&) = delete;
    Spill& operator=(const Spill&) = delete;

    /// Returns the position of the data. Throws IoError (disk full).
    uint64_t append(std::span<const std::byte> data);
    void read(uint64_t position, std::span<std::byte> data) const;
    /// At a place of the caller's choice, as often as it likes; what lies between the end so far
    /// and there is undefined. Nobody reads or writes the same bytes meanwhile. Throws IoError.
    void write(uint64_t position, std::span<const std::byte> data);
    uint64_t bytes() const { return end_; }
    /// Only of one that can outlive the process, while nobody else uses it. What it has now lies in
    /// its file afterwards, which remains, for restore(), whatever becomes of this.
    void save();
    void restore(uint64_t bytes);
    /// Frees memory, and the file but for what was saved.
    void clear();

private:
    static constexpr size_t kBlock = size_t(4) << 20;
    bool growMemory(uint64_t end);
    void extend(uint64_t end);
    void openFile();
    template <class Block, class InFile>
    void forParts(uint64_t position, size_t bytes, Block&& block, InFile&& in_file) const;
    TempSpace* space_;
    mutable std::mutex mutex_;
    std::vector<std::unique_ptr<std::byte[]>>
        blocks_;  // the first blocks_.size() * kBlock positions
    std::vector<Reservation> reservations_;
    const std::string path_;  // of the file, if it has a name
    File file_;               // positions from file_base_ on, and those that were saved
    uint64_t file_base_ = 0;
    uint64_t saved_bytes_ = 0;  // of what lies in memory
    bool is_saved_ = false;
    bool in_file_ = false;
    uint64_t end_ = 0;
};

}  // namespace pietra
