#include "base/give_back.h"

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>

namespace pietra {

void giveBack(void* begin, void* end) {
    static const auto page = uintptr_t(::sysconf(_SC_PAGESIZE));
    const uintptr_t first = (uintptr_t(begin) + page - 1) / page * page;
    const uintptr_t last = uintptr_t(end) / page * page;
    // It is a hint: where it fails, the memory stays.
    if (first < last) ::madvise(reinterpret_cast<void*>(first), last - first, MADV_DONTNEED);
}

}  // namespace pietra
