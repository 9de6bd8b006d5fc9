#pragma once
// Parallel loops over oneTBB. Bodies must not depend on the order of execution; results that reach a
// file are written in index order by the caller, so output is the same for any number of threads.

#include <tbb/enumerable_thread_specific.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <cstddef>
#include <memory>

namespace pietra {

/// While it lives, at most `jobs` threads work.
class ThreadLimit {
public:
    explicit ThreadLimit(int jobs)
        : control_(tbb::global_control::max_allowed_parallelism, size_t(jobs)) {}

private:
    tbb::global_control control_;
};

/// body(i) for each i of [0, count), one task each: for coarse work.
template <class Body>
void parallelFor(size_t count, Body&& body) {
    tbb::parallel_for(tbb::blocked_range<size_t>(0, count, 1),
                      [&](const tbb::blocked_range<size_t>& range) {
                          for (size_t i = range.begin(); i < range.end(); ++i) body(i);
                      },
                      tbb::simple_partitioner());
}

/// body(begin, end) over slices of [0, count) of about `grain` elements: for fine work.
template <class Body>
void parallelForSlices(size_t count, size_t grain, Body&& body) {
    tbb::parallel_for(tbb::blocked_range<size_t>(0, count, grain),
                      [&](const tbb::blocked_range<size_t>& range) {
                          body(range.begin(), range.end());
                      },
                      tbb::simple_partitioner());
}

/// Scratch space, one instance a thread, kept between tasks.
template <class T>
using PerThread = tbb::enumerable_thread_specific<T>;

}  // namespace pietra
