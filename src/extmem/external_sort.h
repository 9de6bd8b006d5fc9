#pragma once
// Sorts any number of records in bounded memory: in memory while they fit, else as sorted runs in
// one unnamed temporary file, merged as they are read back.
//
// Record: trivially copyable, with operator< as a total order, so that what is read back depends on
// the set of records alone. Time: O(n log n). Memory: what is given; with a limit M, runs can be
// merged up to about M^2 / 4 KiB bytes of records. Not thread-safe.

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "base/budget.h"
#include "base/check.h"
#include "base/error.h"
#include "extmem/file.h"

namespace pietra {

template <class Record>
class ExternalSort {
    static_assert(std::is_trivially_copyable_v<Record>);

public:
    /// Takes `memory_bytes` of `budget`, or what `expected` records need if that is less, or throws
    /// MemoryError naming `what`. The file will lie in `temp_dir`, if it comes to that.
    ExternalSort(Budget& budget, size_t memory_bytes, uint64_t expected, std::string temp_dir,
                 std::string what)
        : capacity_(size_t(std::clamp<uint64_t>(
              expected, 1, std::max<size_t>(memory_bytes / sizeof(Record), kLeastRecords)))),
          temp_dir_(std::move(temp_dir)),
          what_(std::move(what)),
          reservation_(budget.reserve(capacity_ * sizeof(Record), what_)),
          // Not initialised, so that what is not used takes no memory.
          buffer_(std::make_unique_for_overwrite<Record[]>(capacity_)) {}

    void append(const Record& record) {
        DCHECK(!reading_);
        if (used_ == capacity_) writeRun();
        buffer_[used_++] = record;
        ++count_;
    }

    uint64_t count() const { return count_; }
    /// Bytes written to the temporary file.
    uint64_t spilledBytes() const { return file_end_; }

    /// The next record in increasing order; false after the last one. Nothing may be appended once
    /// this was called.
    bool next(Record& record) {
        if (!reading_) startReading();
        if (runs_.empty()) {
            if (position_ == used_) return false;
            record = buffer_[position_++];
            return true;
        }
        if (heap_.empty()) return false;
        record = heap_.front().record;
        std::pop_heap(heap_.begin(), heap_.end(), later);
        const uint32_t run = heap_.back().run;
        if (takeFromRun(runs_[run], heap_.back().record))
            std::push_heap(heap_.begin(), heap_.end(), later);
        else
            heap_.pop_back();
        return true;
    }

private:
    static constexpr size_t kLeastRecords = 1024;
    static constexpr size_t kLeastReadBytes = 4096;

    /// A sorted stretch of the file, and its window of the buffer.
    struct Run {
        uint64_t offset = 0;  ///< in the file, of what has not been read
        uint64_t left = 0;    ///< records that have not been read
        Record* window = nullptr;
        size_t begin = 0, end = 0;  ///< in the window
    };
    struct Head {
        Record record;
        uint32_t run;
    };
    static bool later(const Head& a, const Head& b) { return b.record < a.record; }

    void sortBuffer() { tbb::parallel_sort(buffer_.get(), buffer_.get() + used_); }

    void writeRun() {
        if (!file_.isOpen()) file_ = File(temp_dir_, File::Mode::kTemporary);
        sortBuffer();
        const size_t bytes = used_ * sizeof(Record);
        file_.writeAt(file_end_, buffer_.get(), bytes);
        runs_.push_back({file_end_, used_, nullptr, 0, 0});
        file_end_ += bytes;
        used_ = 0;
    }

    void startReading() {
        reading_ = true;
        if (runs_.empty()) return sortBuffer();
        if (used_ > 0) writeRun();
        window_ = capacity_ / runs_.size();
        if (window_ * sizeof(Record) < std::min(kLeastReadBytes, capacity_ * sizeof(Record) / 64))
            throw MemoryError(what_ + ": too much for the memory limit");
        for (uint32_t r = 0; r < runs_.size(); ++r) {
            runs_[r].window = buffer_.get() + r * window_;
            heap_.push_back({{}, r});
            CHECK(takeFromRun(runs_[r], heap_.back().record));
        }
        std::make_heap(heap_.begin(), heap_.end(), later);
    }

    bool takeFromRun(Run& run, Record& record) {
        if (run.begin == run.end) {
            run.end = size_t(std::min<uint64_t>(window_, run.left));
            run.begin = 0;
            if (run.end == 0) return false;
            file_.readAt(run.offset, run.window, run.end * sizeof(Record));
            run.offset += run.end * sizeof(Record);
            run.left -= run.end;
        }
        record = run.window[run.begin++];
        return true;
    }

    const size_t capacity_;
    const std::string temp_dir_;
    const std::string what_;
    Reservation reservation_;
    std::unique_ptr<Record[]> buffer_;
    size_t used_ = 0;
    size_t position_ = 0;
    uint64_t count_ = 0;
    bool reading_ = false;
    File file_;
    uint64_t file_end_ = 0;
    std::vector<Run> runs_;
    size_t window_ = 0;
    std::vector<Head> heap_;
};

}  // namespace pietra
