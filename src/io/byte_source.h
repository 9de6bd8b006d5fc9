#pragma once
// The bytes of an input file, whether it is stored plain or packed (gzip, xz, zstd; see
// packed_source.h). Readers of formats sit on top and never know which.
//
// Reads are by offset into the plain bytes. A packed file can only be decompressed forwards: a read
// before the position reached starts again from the beginning. Memory: a few hundred KiB, and what
// unpacking takes.
// Files are read, never mapped, since mapped pages count in the resident set. Not thread-safe.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace pietra {

class ByteSource {
public:
    virtual ~ByteSource() = default;
    /// What messages call the file.
    virtual const std::string& path() const = 0;
    /// Reads up to `bytes` plain bytes at `offset`; less only at the end. Throws IoError, or
    /// InputError where compressed data is damaged or cut off.
    virtual size_t read(uint64_t offset, void* data, size_t bytes) = 0;
    /// The number of plain bytes: exact where isCompressed() is false, else an upper bound that
    /// follows from the size of the file.
    virtual uint64_t lengthBound() const = 0;
    /// The folder for temporary files.
    virtual const std::string& tempDir() const = 0;
    /// Bytes on disk.
    virtual uint64_t storedBytes() const = 0;
    virtual bool isCompressed() const = 0;
    /// Gives file descriptor and memory back until the next read, so that a model may have more
    /// files than a process may hold open.
    virtual void release() {}
    /// The same bytes once more, to be read at another place at the same time.
    virtual std::unique_ptr<ByteSource> again() const = 0;
    /// The same plain bytes, to be read in any order: of a packed file, a copy in a temporary one.
    virtual std::unique_ptr<ByteSource> unpacked() { return again(); }
};

/// Opens a file; packed ones are recognised by their magic bytes. As a mesh is read several times,
/// a pipe is first copied to a temporary file without a name, in the folder `temp_dir`. Throws
/// IoError (cannot open, no room for the copy), InputError (a device), Interrupted (in a pipe).
std::unique_ptr<ByteSource> openBytes(const std::string& path, const std::string& temp_dir = ".");

/// Bytes that are already there, for tests and fuzzing; `name` stands for the path.
std::unique_ptr<ByteSource> bytesInMemory(const std::string& name, std::vector<uint8_t> bytes);

}  // namespace pietra
