#pragma once
// The memory budget of a run. Every bulk stage takes a `Budget&`, asks how much it may use, and
// holds a `Reservation` for what it allocates, so that the process stays below --memory.
// Thread-safe. Reservations are bookkeeping: they do not allocate.

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

namespace pietra {

class Budget;

/// Move-only share of a budget, returned on destruction.
class Reservation {
public:
    Reservation() = default;
    Reservation(Reservation&& other) noexcept;
    Reservation& operator=(Reservation&& other) noexcept;
    ~Reservation() { release(); }
    void release();
    size_t bytes() const { return bytes_; }

private:
    friend class Budget;
    Reservation(Budget* budget, size_t bytes) : budget_(budget), bytes_(bytes) {}
    Budget* budget_ = nullptr;
    size_t bytes_ = 0;
};

class Budget {
public:
    /// `limit_bytes`: what may be reserved at any time.
    explicit Budget(size_t limit_bytes) : limit_(limit_bytes) {}

    /// Takes `bytes`; throws MemoryError naming `what` if they are not available.
    Reservation reserve(size_t bytes, const std::string& what);
    /// As reserve, but returns an empty reservation (bytes() == 0) where it does not fit.
    Reservation tryReserve(size_t bytes);

    size_t limit() const { return limit_; }
    size_t used() const { return used_.load(std::memory_order_relaxed); }
    size_t available() const;
    size_t peak() const { return peak_.load(std::memory_order_relaxed); }

private:
    friend class Reservation;
    bool take(size_t bytes);
    const size_t limit_;
    std::atomic<size_t> used_{0};
    std::atomic<size_t> peak_{0};
};

/// Resident set of this process, now and at its peak (VmRSS, VmHWM), in bytes.
size_t residentBytes();
size_t peakResidentBytes();
/// Has threads that are yet to come allocate from one heap: what one of them frees, another can
/// use, so the resident set stays near what is in use. For programs that are to keep a budget while
/// some threads load and others drop.
void shareHeap();
/// Gives back what is free between what is used: where threads make large results for another one,
/// several times as much as these take. A millisecond or so, and what is used next has to be
/// fetched again.
void trimHeap();
/// Physical memory of the machine or the cgroup's limit, whichever is smaller, in bytes.
size_t machineMemoryBytes();

}  // namespace pietra
