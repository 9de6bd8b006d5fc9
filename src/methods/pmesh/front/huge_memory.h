#pragma once
// Memory for large arrays that are met at random: in pages of 2 MiB where the system has them, as
// translating addresses is a good part of every miss. Untouched, it takes addresses only.

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <new>

namespace pietra::pmesh {

template <class T>
struct HugeAllocator {
    using value_type = T;
    HugeAllocator() = default;
    template <class Other>
    HugeAllocator(const HugeAllocator<Other>&) {}

    T* allocate(size_t count) {
        constexpr size_t kHuge = size_t(2) << 20;
        const size_t align = count * sizeof(T) < kHuge ? alignof(std::max_align_t) : kHuge;
        const size_t unit = align > alignof(T) ? align : alignof(T);
        const size_t bytes = (count * sizeof(T) + unit - 1) / unit * unit;
        void* memory = std::aligned_alloc(unit, bytes);
        if (memory == nullptr && bytes > 0) throw std::bad_alloc();
        if (unit == kHuge) ::madvise(memory, bytes, MADV_HUGEPAGE);  // or not: it is only slower
        return static_cast<T*>(memory);
    }
    void deallocate(T* memory, size_t) { std::free(memory); }
    bool operator==(const HugeAllocator&) const = default;
};

}  // namespace pietra::pmesh
