#pragma once
// A bag of small records that is read back grouped by key, in bounded memory: what counts edges,
// vertices and triangles over a whole model. Records stay in memory while they fit; then they go to
// one unnamed temporary file, split by the hash of their key.
//
// Record: trivially copyable, with operator< as a total order that puts equal keys side by side,
// and `uint64_t hash() const`, a good mix of the key alone. The budget gives `memory_bytes` at
// once, and nothing else is allocated but 64 bytes a chunk of the file. append() is thread-safe.
// What is read back depends on the set of records only, not on the order in which they came.

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "base/budget.h"
#include "base/error.h"
#include "base/parallel.h"
#include "extmem/file.h"

namespace pietra {

template <class Record>
class SpillTable {
public:
    /// Takes `memory_bytes` of `budget` (at least 1 MiB) or throws MemoryError naming `what`.
    /// `temp_dir`: where the file will be, if it comes to that.
    SpillTable(Budget& budget, size_t memory_bytes, std::string temp_dir, const std::string& what)
        : what_(what),
          temp_dir_(std::move(temp_dir)),
          memory_(std::max(memory_bytes, size_t(1) << 20)),
          reservation_(budget.reserve(memory_, what)) {}

    void append(std::span<const Record> records) {
        const std::lock_guard lock(mutex_);
        count_ += records.size();
        for (const Record& record : records)
            put(isSpilled() ? record.hash() >> kPartShift : 0, record);
    }

    uint64_t count() const { return count_; }
    /// Bytes written to the temporary file so far.
    uint64_t spilledBytes() const { return file_end_; }

    /// Calls visit(std::span<const Record>) on sorted runs; all records of one key are in one run.
    /// Runs are visited by several threads at once. Nothing may be appended afterwards; may be
    /// called again. Throws MemoryError if one key has more records than the memory holds.
    template <class Visit>
    void forEachRun(Visit&& visit) {
        const size_t capacity = memory_ / 2 / sizeof(Record);
        auto buffer =
            std::make_unique_for_overwrite<Record[]>(size_t(std::min<uint64_t>(capacity, count_)));
        for (Part& part : parts_) {
            const Bins sizes = countBins(part);
            for (size_t begin = 0; begin < kBins;) {
                size_t end = begin;
                size_t total = 0;
                while (end < kBins && total + sizes[end] <= capacity) total += sizes[end++];
                if (end == begin)
                    throw MemoryError(what_ + ": too many equal keys for the memory limit");
                if (total > 0) visitBins(part, sizes, begin, end, buffer.get(), visit);
                begin = end;
            }
        }
    }

private:
    static constexpr size_t kParts = 64;  // of the file; their number times a chunk stays in memory
    static constexpr int kPartShift = 58;
    static constexpr size_t kBins = 4096;  // by the bits of the hash below those of the part
    static constexpr int kBinShift = 46;
    using Bins = std::array<uint32_t, kBins>;

    /// Records of one range of hashes; before spilling there is one part, all in memory.
    struct Part {
        std::vector<std::unique_ptr<Record[]>> full;  // in memory
        std::vector<uint64_t> written;                // offsets in the file
        std::unique_ptr<Record[]> open;
        size_t open_count = 0;
    };

    bool isSpilled() const { return file_.isOpen(); }
    static size_t binOf(const Record& r) { return size_t(r.hash() >> kBinShift) % kBins; }
    /// A quarter of the memory holds the open chunks of all parts.
    size_t chunkRecords() const {
        return std::min<size_t>(memory_ / 4 / kParts, size_t(1) << 18) / sizeof(Record);
    }

    void put(size_t part_index, const Record& record) {
        Part& part = parts_[part_index];
        if (!part.open) part.open = std::make_unique_for_overwrite<Record[]>(chunkRecords());
        part.open[part.open_count++] = record;
        if (part.open_count == chunkRecords()) closeChunk(part);
    }

    void closeChunk(Part& part) {
        part.open_count = 0;
        if (isSpilled()) {
            const size_t bytes = chunkRecords() * sizeof(Record);
            file_.writeAt(file_end_, part.open.get(), bytes);
            part.written.push_back(file_end_);
            file_end_ += bytes;
            return;
        }
        part.full.push_back(std::move(part.open));
        // Half of the memory is kept for reading back.
        if ((part.full.size() + 1) * chunkRecords() * sizeof(Record) > memory_ / 4) spill();
    }

    void spill() {
        file_ = File(temp_dir_, File::Mode::kTemporary);
        std::vector<std::unique_ptr<Record[]>> chunks = std::move(parts_[0].full);
        parts_ = std::vector<Part>(kParts);
        for (std::unique_ptr<Record[]>& chunk : chunks) {
            for (size_t i = 0; i < chunkRecords(); ++i)
                put(chunk[i].hash() >> kPartShift, chunk[i]);
            chunk.reset();
        }
    }

    template <class Visit>
    void forEachChunk(const Part& part, Visit&& visit) {
        for (const auto& chunk : part.full) visit(std::span(chunk.get(), chunkRecords()));
        std::vector<Record> scratch(part.written.empty() ? 0 : chunkRecords());
        for (const uint64_t offset : part.written) {
            file_.readAt(offset, scratch.data(), chunkRecords() * sizeof(Record));
            visit(std::span<const Record>(scratch));
        }
        visit(std::span<const Record>(part.open.get(), part.open_count));
    }

    Bins countBins(const Part& part) {
        Bins sizes{};
        forEachChunk(part, [&](std::span<const Record> chunk) {
            for (const Record& r : chunk) ++sizes[binOf(r)];
        });
        return sizes;
    }

    template <class Visit>
    void visitBins(const Part& part, const Bins& sizes, size_t begin, size_t end, Record* buffer,
                   Visit& visit) {
        std::vector<size_t> offset(end - begin + 1, 0);
        for (size_t bin = begin; bin < end; ++bin)
            offset[bin - begin + 1] = offset[bin - begin] + sizes[bin];
        std::vector<size_t> cursor(offset.begin(), offset.end() - 1);
        forEachChunk(part, [&](std::span<const Record> chunk) {
            for (const Record& r : chunk) {
                const size_t bin = binOf(r);
                if (bin >= begin && bin < end) buffer[cursor[bin - begin]++] = r;
            }
        });
        parallelForSlices(end - begin, 16, [&](size_t first, size_t last) {
            for (size_t bin = first; bin < last; ++bin) {
                if (offset[bin] == offset[bin + 1]) continue;
                const std::span<Record> run(buffer + offset[bin], offset[bin + 1] - offset[bin]);
                std::sort(run.begin(), run.end());
                visit(std::span<const Record>(run));
            }
        });
    }

    std::string what_;
    std::string temp_dir_;
    size_t memory_;
    Reservation reservation_;
    std::mutex mutex_;
    std::vector<Part> parts_{1};
    File file_;
    uint64_t file_end_ = 0;
    uint64_t count_ = 0;
};

}  // namespace pietra
