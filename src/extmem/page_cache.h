#pragma once
// What the system keeps of a file in memory: for measurements that begin as after a reboot.

#include <cstdint>
#include <string>

namespace pietra {

/// Writes out what is pending of a file and asks the system to forget what it caches of it. Returns
/// how many bytes it still caches: what others have mapped or are reading, or all, where a file
/// system has no other place. Linux tells this of files that the user may write, and calls all
/// others cached. Throws IoError.
uint64_t dropPageCache(const std::string& path);
/// How many bytes of the file are cached.
uint64_t cachedBytes(const std::string& path);

}  // namespace pietra
