// Packed inputs: the same bytes as unpacked, in any order of reading, and every fault is named.

#include "io/packed_source.h"

#include <gtest/gtest.h>
#include <lzma.h>
#include <zlib.h>
#include <zstd.h>

#include "base/hash.h"
#include "io/byte_source.h"
#include "io/test_files.h"

namespace pietra {
namespace {

std::string xz(const std::string& text) {
    std::string out(text.size() + 1000, '\0');
    size_t size = 0;
    EXPECT_EQ(lzma_easy_buffer_encode(0, LZMA_CHECK_CRC64, nullptr,
                                      reinterpret_cast<const uint8_t*>(text.data()), text.size(),
                                      reinterpret_cast<uint8_t*>(out.data()), &size, out.size()),
              LZMA_OK);
    out.resize(size);
    return out;
}

std::string zstd(const std::string& text) {
    std::string out(ZSTD_compressBound(text.size()), '\0');
    ZSTD_CCtx* const context = ZSTD_createCCtx();
    ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, 1);
    out.resize(ZSTD_compress2(context, out.data(), out.size(), text.data(), text.size()));
    ZSTD_freeCCtx(context);
    return out;
}

struct Packer {
    const char* name;
    std::string (*pack)(const std::string& text);
};
constexpr Packer kPackers[] = {{"gzip", gzipped}, {"xz", xz}, {"zstd", zstd}};

std::string someText(size_t bytes) {
    std::string text;
    for (uint64_t i = 0; text.size() < bytes; ++i) text += std::to_string(mixBits(i) % 9999) + "\n";
    return text;
}

std::string readAll(ByteSource& source) {
    std::string text, part(70001, '\0');
    while (const size_t n = source.read(text.size(), part.data(), part.size()))
        text.append(part, 0, n);
    return text;
}

TEST(PackedSource, givesThePlainBytes) {
    const ScratchDirectory dir;
    const std::string text = someText(3 << 20);
    for (const Packer& packer : kPackers) {
        SCOPED_TRACE(packer.name);
        const std::string packed = packer.pack(text);
        const auto source = openBytes(dir.write("a", packed));
        EXPECT_TRUE(source->isCompressed());
        EXPECT_EQ(source->storedBytes(), packed.size());
        EXPECT_GE(source->lengthBound(), text.size());
        EXPECT_TRUE(readAll(*source) == text);
        EXPECT_TRUE(readAll(*source) == text);
        const auto again = source->again();
        for (const uint64_t offset : {2000000, 1999999, 5, 3000000, 0}) {
            std::string part(100, '\0'), other(100, '\0');
            EXPECT_EQ(source->read(offset, part.data(), 100), 100u);
            EXPECT_EQ(part, text.substr(offset, 100));
            EXPECT_EQ(again->read(offset / 2, other.data(), 100), 100u);
            EXPECT_EQ(other, text.substr(offset / 2, 100));
        }
        char byte;
        EXPECT_EQ(source->read(text.size() + 1000, &byte, 1), 0u);
    }
}

TEST(PackedSource, takesMembersOneAfterTheOther) {
    const ScratchDirectory dir;
    const std::string a = someText(400000), b = someText(70000);
    for (const Packer& packer : kPackers)
        EXPECT_TRUE(readAll(*openBytes(dir.write("a", packer.pack(a) + packer.pack(b)))) == a + b)
            << packer.name;
    const std::string skippable("\x50\x2a\x4d\x18\x03\0\0\0abc", 11);
    EXPECT_TRUE(readAll(*openBytes(dir.write("a", skippable + zstd(a) + skippable + zstd(b)))) ==
                a + b);
    EXPECT_TRUE(readAll(*openBytes(dir.write("a", gzipped(a) + std::string(512, '\0')))) == a);
    EXPECT_TRUE(readAll(*openBytes(dir.write("a", xz(a) + std::string(512, '\0')))) == a);
}

TEST(PackedSource, boundsWhatComesOutByWhatIsThere) {
    const ScratchDirectory dir;
    const std::string zeros(50 << 20, '\0');
    for (const Packer& packer : kPackers) {
        const auto source = openBytes(dir.write("a", packer.pack(zeros)));
        EXPECT_GE(source->lengthBound(), zeros.size()) << packer.name;
    }
}

TEST(PackedSource, noticesATruncationAtEveryByte) {
    const ScratchDirectory dir;
    const std::string text = someText(3000);
    for (const Packer& packer : kPackers) {
        const std::string packed = packer.pack(text);
        for (size_t size = 6; size < packed.size(); ++size) {
            const std::string path = dir.write("a", packed.substr(0, size));
            try {
                readAll(*openBytes(path));
                ADD_FAILURE() << packer.name << " " << size;
            } catch (const InputError& e) {
                ASSERT_EQ(std::string(e.what()), path + ": byte " + std::to_string(size) +
                                                     ": the " + packer.name + " data ends early");
            }
        }
    }
}

TEST(PackedSource, namesDamage) {
    const ScratchDirectory dir;
    const std::string text = someText(3000);
    for (const Packer& packer : kPackers) {
        const std::string good = packer.pack(text);
        for (size_t at = 6; at < good.size(); ++at) {
            std::string bad = good;
            bad[at] = char(bad[at] ^ 0x10);
            const std::string path = dir.write("a", bad);
            try {
                // What only describes the file (a name, a time) may be damaged.
                EXPECT_TRUE(readAll(*openBytes(path)) == text) << packer.name << " " << at;
            } catch (const InputError& e) {
                EXPECT_TRUE(std::string(e.what()).starts_with(path + ": byte "));
            } catch (const MemoryError&) {
            }
        }
        std::string bad = good;
        bad[good.size() / 2] = char(bad[good.size() / 2] ^ 0x55);
        const std::string fault = faultOf(dir.write("a.obj", bad));
        EXPECT_TRUE(fault.ends_with(std::string(": the ") + packer.name + " data is damaged"))
            << fault;
    }
}

TEST(PackedSource, refusesHugeWindows) {
    const ScratchDirectory dir;
    // A frame header with a window of 2^31 bytes.
    const std::string frame("\x28\xb5\x2f\xfd\x00\xa8\x01\0\0", 9);
    const std::string path = dir.write("a.obj", frame);
    EXPECT_EQ(faultOf(path).substr(0, path.size() + 7), path + ": byte ");
    EXPECT_TRUE(faultOf(path).ends_with(
        ": the zstd data needs more than 128 MiB of memory: unpack it first"));
}

TEST(PackedSource, namesAnEmptyFile) {
    const ScratchDirectory dir;
    EXPECT_EQ(faultOf(dir.write("a.obj.zst", zstd(""))),
              dir.file("a.obj.zst") + ": the file is empty");
}

}  // namespace
}  // namespace pietra
