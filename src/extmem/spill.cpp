#include "extmem/spill.h"

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

uint64_t Spill::append(std::span<const std::byte> data) {
    uint64_t position;
    bool in_file;
    {
        const std::lock_guard lock(mutex_);
        position = end_;
        if (!in_file_ && !growMemory(end_ + data.size())) {
            in_file_ = true;
            file_base_ = end_;
            file_ = File(space_->directory, File::Mode::kTemporary);
        }
        end_ += data.size();
        in_file = in_file_;
        if (!in_file_) {
            uint64_t at = position;
            for (size_t done = 0; done < data.size();) {
                const size_t offset = at % kBlock;
                const size_t part = std::min(kBlock - offset, data.size() - done);
                std::memcpy(blocks_[at / kBlock].get() + offset, data.data() + done, part);
                done += part;
                at += part;
            }
        }
    }
    space_->add(data.size());
    if (in_file) file_.writeAt(position - file_base_, data.data(), data.size());
    return position;
}

void Spill::read(uint64_t position, std::span<std::byte> data) const {
    const auto inFile = [&] {
        const std::lock_guard lock(mutex_);
        CHECK_LE(position + data.size(), end_);
        return in_file_ && position >= file_base_;
    };
    if (inFile()) return file_.readAt(position - file_base_, data.data(), data.size());
    // Blocks, once there, never move; only the table of them may, so it alone is read under the
    // lock.
    for (size_t done = 0; done < data.size();) {
        const std::byte* block;
        {
            const std::lock_guard lock(mutex_);
            block = blocks_[position / kBlock].get();
        }
        const size_t offset = position % kBlock;
        const size_t part = std::min(kBlock - offset, data.size() - done);
        std::memcpy(data.data() + done, block + offset, part);
        done += part;
        position += part;
    }
}

void Spill::clear() {
    blocks_.clear();
    reservations_.clear();
    file_.close();
    in_file_ = false;
    space_->remove(end_);
    end_ = 0;
}

}  // namespace pietra
