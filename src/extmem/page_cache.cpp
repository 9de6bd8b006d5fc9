#include "extmem/page_cache.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <vector>

#include "extmem/file.h"

namespace pietra {

uint64_t dropPageCache(const std::string& path) {
    const File file(path, File::Mode::kRead);
    ::fdatasync(file.descriptor());  // dirty pages cannot be dropped; that shows in what is left
    ::posix_fadvise(file.descriptor(), 0, 0, POSIX_FADV_DONTNEED);
    return cachedBytes(path);
}

uint64_t cachedBytes(const std::string& path) {
    const File file(path, File::Mode::kRead);
    const uint64_t bytes = file.size(), page_bytes = uint64_t(::sysconf(_SC_PAGESIZE));
    if (bytes == 0) return 0;
    void* mapped = ::mmap(nullptr, bytes, PROT_READ, MAP_SHARED, file.descriptor(), 0);
    if (mapped == MAP_FAILED) return bytes;
    std::vector<unsigned char> page((bytes + page_bytes - 1) / page_bytes, 1);
    ::mincore(mapped, bytes, page.data());
    ::munmap(mapped, bytes);
    const auto cached = std::count_if(page.begin(), page.end(), [](auto p) { return p & 1; });
    return std::min(bytes, uint64_t(cached) * page_bytes);
}

}  // namespace pietra
