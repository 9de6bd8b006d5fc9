#pragma once
// Where the threads of parallel loops run while one thread draws frame after frame.
//
// A thread that is woken on a virtual machine whose other processors sleep is put on the processor
// of the one that wakes it: Linux takes a halted virtual processor for one that the host has taken
// away. A frame of a few milliseconds after some idling is then over before the scheduler spreads
// the threads, and has had one processor. So the workers are kept off the frame thread's.

#include <atomic>

namespace pietra {

/// One at a time. Workers keep the place they were given when this is gone. Does nothing where the
/// process may use one processor only.
class WorkerPlacement {
public:
    WorkerPlacement() { update(); }
    ~WorkerPlacement() { frame_cpu_.store(-1, std::memory_order_relaxed); }
    WorkerPlacement(const WorkerPlacement&) = delete;
    WorkerPlacement& operator=(const WorkerPlacement&) = delete;

    /// By the frame thread, at the beginning of each frame, for it may have been moved.
    void update();

    /// By the tasks of parallel loops (parallel.h does). Costs nothing where all is in place.
    static void enter() {
        if (const int cpu = frame_cpu_.load(std::memory_order_relaxed); cpu >= 0) keepOff(cpu);
    }

private:
    static void keepOff(int cpu);
    static inline std::atomic<int> frame_cpu_{-1};
};

}  // namespace pietra
