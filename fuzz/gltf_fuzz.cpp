// libFuzzer target: whatever the bytes, the glTF reader gives finite vertices and valid indices, or
// an InputError or IoError; it neither crashes, hangs nor takes memory that the bytes do not back.

#include "base/error.h"
#include "io/gltf_source.h"
#include "read_source.h"

using namespace pietra;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    try {
        auto bytes = bytesInMemory("fuzz", std::vector<uint8_t>(data, data + size));
        const auto source = openGltf(std::make_unique<ByteReader>(std::move(bytes)));
        readSource(*source);
        readSource(*source);
    } catch (const InputError&) {
    } catch (const IoError&) {  // a buffer beside the file, which is not there
    }
    return 0;
}
