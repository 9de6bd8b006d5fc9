#pragma once
// Files packed by gzip (RFC 1952), xz or zstd (RFC 8878) as byte sources, through their own
// libraries, several members or frames one after the other included. Check sums are verified by the
// libraries; a fault is an InputError with the offset in the packed file.
//
// Memory: a window of the packed file (256 KiB) and what the library needs: some 64 KiB for gzip;
// the dictionary for xz (64 MiB for `xz -9`) and the window for zstd (8 MiB for `zstd -19`), of
// which those above 128 MiB are refused by name.

#include <memory>

#include "io/byte_source.h"
#include "io/input_file.h"

namespace pietra {

/// The source of a file that begins with the magic bytes of a packer, else null.
std::unique_ptr<ByteSource> openPacked(InputFile& file);

/// The source of a file that is not packed; `stored_bytes` stand for it on disk.
std::unique_ptr<ByteSource> openPlain(InputFile file, uint64_t stored_bytes);

}  // namespace pietra
