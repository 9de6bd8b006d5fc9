#pragma once
// Parallel loops over oneTBB. Bodies must not depend on the order of execution; results that reach
// a file are written in index order by the caller, so output is the same for any number of threads.
// While somebody draws frames, workers of loops keep off the frame thread's processor
// (worker_placement.h).

#include <tbb/enumerable_thread_specific.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/parallel_sort.h>

#include <cstddef>
#include <optional>
#include <vector>

#include "base/task_order.h"
#include "base/worker_placement.h"

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
    TaskOrder order;
    tbb::parallel_for(
        tbb::blocked_range<size_t>(0, count, 1),
        [&](const tbb::blocked_range<size_t>& range) {
            const TaskOrder::Task task(order);
            WorkerPlacement::enter();
            for (size_t i = range.begin(); i < range.end(); ++i) body(i);
        },
        tbb::simple_partitioner());
}

/// body(begin, end) over slices of [0, count) of about `grain` elements: for fine work.
template <class Body>
void parallelForSlices(size_t count, size_t grain, Body&& body) {
    TaskOrder order;
    tbb::parallel_for(
        tbb::blocked_range<size_t>(0, count, grain),
        [&](const tbb::blocked_range<size_t>& range) {
            const TaskOrder::Task task(order);
            WorkerPlacement::enter();
            body(range.begin(), range.end());
        },
        tbb::simple_partitioner());
}

/// By <; where elements are equal, in any order.
template <class T>
void parallelSort(std::vector<T>& elements) {
    tbb::parallel_sort(elements.begin(), elements.end());
}

/// produce(i) in parallel for i of [0, count); consume(result) for one at a time, in the order of
/// i. At most `in_flight` results exist at a time.
template <class Produce, class Consume>
void orderedPipeline(size_t count, size_t in_flight, Produce&& produce, Consume&& consume) {
    using Result = decltype(produce(size_t(0)));
    // Results wait in slots of ours: where a body throws, the pipeline forgets what is under way.
    // As they are consumed in order, those under way are consecutive: no two have one slot.
    std::vector<std::optional<Result>> slots(in_flight);
    size_t next = 0;
    TaskOrder order;
    tbb::parallel_pipeline(
        in_flight,
        tbb::make_filter<void, size_t>(tbb::filter_mode::serial_in_order,
                                       [&](tbb::flow_control& control) {
                                           const TaskOrder::Turn turn(order);
                                           if (next == count) control.stop();
                                           return next < count ? next++ : size_t(0);
                                       }) &
            tbb::make_filter<size_t, size_t>(tbb::filter_mode::parallel,
                                             [&](size_t i) {
                                                 const TaskOrder::Task task(order);
                                                 slots[i % in_flight].emplace(produce(i));
                                                 return i;
                                             }) &
            tbb::make_filter<size_t, void>(tbb::filter_mode::serial_in_order, [&](size_t i) {
                const TaskOrder::Turn turn(order);
                consume(*slots[i % in_flight]);
                slots[i % in_flight].reset();
            }));
}

/// Scratch space, one instance a thread, kept between tasks.
template <class T>
using PerThread = tbb::enumerable_thread_specific<T>;

}  // namespace pietra
