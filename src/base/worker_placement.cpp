#include "base/worker_placement.h"

#include <sched.h>

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

WorkerPlacement::WorkerPlacement() {
    if (CPU_COUNT(&allowedCpus()) > 1) observe(true);
    update();
}

WorkerPlacement::~WorkerPlacement() {
    observe(false);
}

void WorkerPlacement::update() {
    frame_cpu_.store(::sched_getcpu(), std::memory_order_relaxed);
}

/// Called in the thread that enters; it can be moved by itself alone, as it may end at any time.
void WorkerPlacement::on_scheduler_entry(bool is_worker) {
    thread_local int kept_off = -1;
    const int cpu = frame_cpu_.load(std::memory_order_relaxed);
    if (!is_worker || cpu == kept_off || cpu < 0) return;
    cpu_set_t others = allowedCpus();
    CPU_CLR(cpu, &others);
    ::sched_setaffinity(0, sizeof others, &others);
    kept_off = cpu;
}

}  // namespace pietra
