#pragma once
// Clocks of the benchmarks, in seconds.

#include <time.h>

namespace pietra {

inline double secondsOf(clockid_t clock) {
    timespec t{};
    clock_gettime(clock, &t);
    return double(t.tv_sec) + double(t.tv_nsec) * 1e-9;
}
/// Processor time: the machine may be shared.
inline double threadSeconds() {
    return secondsOf(CLOCK_THREAD_CPUTIME_ID);
}
inline double processSeconds() {
    return secondsOf(CLOCK_PROCESS_CPUTIME_ID);
}
inline double wallSeconds() {
    return secondsOf(CLOCK_MONOTONIC);
}

}  // namespace pietra
