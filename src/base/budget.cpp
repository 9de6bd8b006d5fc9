#include "base/budget.h"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <utility>

#include "base/error.h"
#include "base/text.h"

namespace pietra {

Reservation::Reservation(Reservation&& other) noexcept
    : budget_(std::exchange(other.budget_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}

Reservation& Reservation::operator=(Reservation&& other) noexcept {
    if (this != &other) {
        release();
        budget_ = std::exchange(other.budget_, nullptr);
        bytes_ = std::exchange(other.bytes_, 0);
    }
    return *this;
}

void Reservation::release() {
    if (budget_) budget_->used_.fetch_sub(bytes_, std::memory_order_relaxed);
    budget_ = nullptr;
    bytes_ = 0;
}

bool Budget::take(size_t bytes) {
    size_t used = used_.load(std::memory_order_relaxed);
    do {
        if (bytes > limit_ - std::min(used, limit_)) return false;
    } while (!used_.compare_exchange_weak(used, used + bytes, std::memory_order_relaxed));
    size_t peak = peak_.load(std::memory_order_relaxed);
    while (peak < used + bytes &&
           !peak_.compare_exchange_weak(peak, used + bytes, std::memory_order_relaxed)) {
    }
    return true;
}

Reservation Budget::reserve(size_t bytes, const std::string& what) {
    if (!take(bytes))
        throw MemoryError(fmt::format("{} needs {}, but only {} of the memory limit are left", what,
                                      formatBytes(bytes), formatBytes(available())));
    return Reservation(this, bytes);
}

Reservation Budget::tryReserve(size_t bytes) {
    return take(bytes) ? Reservation(this, bytes) : Reservation();
}

size_t Budget::available() const {
    return limit_ - std::min(used(), limit_);
}

namespace {

size_t statusField(const char* name) {
    std::ifstream status("/proc/self/status");
    std::string line;
    while (std::getline(status, line))
        if (line.starts_with(name)) return std::stoull(line.substr(line.find(':') + 1)) * 1024;
    return 0;
}

}  // namespace

size_t residentBytes() {
    return statusField("VmRSS:");
}
size_t peakResidentBytes() {
    return statusField("VmHWM:");
}

void shareHeap() {
    ::mallopt(M_ARENA_MAX, 1);
}
void trimHeap() {
    ::malloc_trim(0);
}

size_t machineMemoryBytes() {
    size_t bytes = size_t(sysconf(_SC_PHYS_PAGES)) * size_t(sysconf(_SC_PAGE_SIZE));
    for (const char* path :
         {"/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"}) {
        std::ifstream file(path);
        size_t limit = 0;
        if (file >> limit) bytes = std::min(bytes, limit);
    }
    return bytes;
}

}  // namespace pietra
