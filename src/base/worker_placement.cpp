#include "base/worker_placement.h"

#include <sched.h>
#include <tbb/task_arena.h>

namespace pietra {
namespace {

/// Those that the process may use, asked for once: before any thread has been restricted.
const cpu_set_t& allowedCpus() {
    static const cpu_set_t allowed = [] {
        cpu_set_t set;
        if (::sched_getaffinity(0, sizeof set, &set) != 0) CPU_ZERO(&set);
        return set;
    }();
    return allowed;
}

}  // namespace

void WorkerPlacement::update() {
    if (CPU_COUNT(&allowedCpus()) > 1)
        frame_cpu_.store(::sched_getcpu(), std::memory_order_relaxed);
}

/// A thread moves itself: another one could not know that it still lives.
void WorkerPlacement::keepOff(int cpu) {
    thread_local int kept_off = -1;
    const bool is_worker = tbb::this_task_arena::current_thread_index() > 0;
    if (cpu == kept_off || !is_worker) return;
    cpu_set_t others = allowedCpus();
    CPU_CLR(cpu, &others);
    ::sched_setaffinity(0, sizeof others, &others);
    kept_off = cpu;
}

}  // namespace pietra
