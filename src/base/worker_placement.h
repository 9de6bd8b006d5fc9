#pragma once
// Where the threads of parallel loops run while one thread draws frame after frame.
//
// A thread that is woken on a virtual machine whose other processors sleep is put on the processor
// of the one that wakes it: Linux takes a halted virtual processor for one that the host has taken
// away. A frame of a few milliseconds after some idling is then over before the scheduler spreads
// the threads, and has had one processor. So the workers are kept off the frame thread's.

#include <tbb/task_scheduler_observer.h>

#include <atomic>

namespace pietra {

/// From its making on, of the loops that the making thread runs. Workers keep the place they were
/// given when this is gone. Does nothing where the process may use one processor only.
class WorkerPlacement : private tbb::task_scheduler_observer {
public:
    WorkerPlacement();
    ~WorkerPlacement() override;

    /// By the frame thread, at the beginning of each frame, for it may have been moved.
    void update();

private:
    void on_scheduler_entry(bool is_worker) override;

    std::atomic<int> frame_cpu_{-1};
};

}  // namespace pietra
