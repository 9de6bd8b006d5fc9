#pragma once
// Options that several verbs share: memory, threads, and what they mean when they are not given.

#include <cstddef>
#include <cstdint>
#include <optional>

#include "apps/pietra/option_set.h"

namespace pietra {

struct Limits {
    std::optional<uint64_t> memory;
    std::optional<uint64_t> jobs;

    /// Declares --memory and --jobs.
    void declare(OptionSet& options);
    /// Bytes the process may have resident; half of the machine's memory if not given. Throws
    /// MemoryError if less was given than `least`, which `what` (as in "building") needs.
    size_t memoryBytes(size_t least, const char* what) const;
    /// Threads: all cores if not given.
    int threads() const;
};

}  // namespace pietra
