#include "apps/pietra/limits.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

#include "base/budget.h"
#include "base/error.h"
#include "base/text.h"

namespace pietra {

void Limits::declare(OptionSet& options) {
    options
        .size("--memory", memory,
              "Keep the resident set of the process below this; more goes to temporary files.")
        .defaultsTo("half of the machine's memory");
    options.count("-j,--jobs", "N", jobs, {.min = 1, .max = 1024}, "Threads to work with.")
        .defaultsTo("all cores");
}

size_t Limits::memoryBytes(size_t least, const char* what) const {
    const size_t limit = memory ? size_t(*memory) : std::max(machineMemoryBytes() / 2, least);
    if (limit < least)
        throw MemoryError(fmt::format("--memory {}: {} needs {} at least", formatBytes(limit), what,
                                      formatBytes(least)));
    return limit;
}

int Limits::threads() const {
    return jobs ? int(*jobs) : std::max(1, int(std::thread::hardware_concurrency()));
}

}  // namespace pietra
