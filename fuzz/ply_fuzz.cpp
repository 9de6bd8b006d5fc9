// libFuzzer target: whatever the bytes, the PLY reader gives finite vertices and valid indices, or an
// InputError; it neither crashes, hangs nor takes memory that the bytes do not back.

#include "base/error.h"
#include "io/ply_source.h"
#include "read_source.h"

using namespace pietra;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    try {
        auto bytes = bytesInMemory("fuzz", std::vector<uint8_t>(data, data + size));
        const auto source = openPly(std::make_unique<ByteReader>(std::move(bytes)));
        readSource(*source);
        readSource(*source);
    } catch (const InputError&) {
    }
    return 0;
}
