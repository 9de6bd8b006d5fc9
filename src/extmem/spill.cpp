#include "extmem/spill.h"

#include <unistd.h>

#include <algorithm>
#include <cstring>

#include "base/check.h"

namespace pietra {

void TempSpace::add(uint64_t more) {
    const uint64_t now = bytes.fetch_add(more) + more;
    uint64_t peak = peak_bytes.load();
    while (peak < now && !peak_bytes.compare_exchange_weak(peak, now)) {
    }
}

bool Spill::growMemory(uint64_t end) {
    while (blocks_.size() * kBlock < end) {
        if (space_->budget->available() < space_->keep_free_bytes + kBlock) return false;
        Reservation reservation = space_->budget->tryReserve(kBlock);
        if (reservation.bytes() == 0) return false;
        reservations_.push_back(std::move(reservation));
        blocks_.push_back(std::make_unique_for_overwrite<std::byte[]>(kBlock));
    }
    return true;
}

void Spill::openFile() {
    if (file_.isOpen()) return;
    file_ = path_.empty() ? File(space_->directory, File::Mode::kTemporary)
                          : File(path_, File::Mode::kCreate);
}

/// Under the lock: makes room up to `end`.
void Spill::extend(uint64_t end) {
    if (end <= end_) return;
    if (!in_file_ && !growMemory(end)) {
        openFile();
        in_file_ = true;
        file_base_ = end_;
    }
    space_->add(end - end_);
    end_ = end;
}

/// block(bytes in memory, offset in the data, size) and in_file(position, offset in the data,
/// size), for all parts of a range. Blocks, once there, never move; only the table of them may, so
/// it alone is read under the lock.
template <class Block, class InFile>
void Spill::forParts(uint64_t position, size_t bytes, Block&& block, InFile&& in_file) const {
    for (size_t done = 0; done < bytes;) {
        const uint64_t at = position + done;
        size_t part = std::min(kBlock - size_t(at % kBlock), bytes - done);
        std::byte* memory = nullptr;
        {
            const std::lock_guard lock(mutex_);
            CHECK_LE(position + bytes, end_);
            if (!in_file_ || at < file_base_) {
                if (in_file_) part = std::min(part, size_t(file_base_ - at));
                memory = blocks_[at / kBlock].get() + at % kBlock;
            }
        }
        if (!memory) {
            part = bytes - done;
            in_file(at, done, part);
        } else {
            block(memory, done, part);
        }
        done += part;
    }
}

uint64_t Spill::append(std::span<const std::byte> data) {
    uint64_t position;
    {
        const std::lock_guard lock(mutex_);
        position = end_;
        extend(end_ + data.size());
    }
    write(position, data);
    return position;
}

void Spill::write(uint64_t position, std::span<const std::byte> data) {
    {
        const std::lock_guard lock(mutex_);
        extend(position + data.size());
    }
    forParts(
        position, data.size(),
        [&](std::byte* to, size_t from, size_t size) { std::memcpy(to, data.data() + from, size); },
        [&](uint64_t to, size_t from, size_t size) {
            file_.writeAt(to, data.data() + from, size);
        });
}

void Spill::read(uint64_t position, std::span<std::byte> data) const {
    forParts(
        position, data.size(),
        [&](const std::byte* from, size_t to, size_t size) {
            std::memcpy(data.data() + to, from, size);
        },
        [&](uint64_t from, size_t to, size_t size) { file_.readAt(from, data.data() + to, size); });
}

void Spill::save() {
    openFile();
    const uint64_t end = in_file_ ? file_base_ : end_;
    while (saved_bytes_ < end) {
        const size_t within = size_t(saved_bytes_ % kBlock);
        const size_t part = size_t(std::min<uint64_t>(kBlock - within, end - saved_bytes_));
        file_.writeAt(saved_bytes_, blocks_[saved_bytes_ / kBlock].get() + within, part);
        saved_bytes_ += part;
    }
    is_saved_ = true;
}

void Spill::restore(uint64_t bytes) {
    CHECK_EQ(end_, uint64_t(0));
    file_ = File(path_, File::Mode::kUpdate);
    file_.truncate(bytes);
    is_saved_ = in_file_ = true;
    file_base_ = 0;
    end_ = bytes;
    space_->add(bytes);
}

void Spill::clear() {
    blocks_.clear();
    reservations_.clear();
    if (file_.isOpen() && !path_.empty() && !is_saved_) ::unlink(path_.c_str());
    file_.close();
    is_saved_ = false;
    saved_bytes_ = 0;
    in_file_ = false;
    space_->remove(end_);
    end_ = 0;
}

}  // namespace pietra
