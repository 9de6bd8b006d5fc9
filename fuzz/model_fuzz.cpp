// Fuzzes everything that reads a .pietra file. The first byte of the input picks the entry: the
// whole file, one page, or one node block (which a file's checksums would otherwise shield).
// FUZZ_SEEDS=DIR writes a small valid input of each kind to DIR and stops: start from those.

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>

#include "base/check.h"
#include "base/error.h"
#include "base/hash.h"
#include "store/model_reader.h"
#include "store/model_writer.h"
#include "store/node_block.h"
#include "store/test_meshes.h"
#include "store/verify.h"

namespace pietra {
namespace {

using Bytes = std::vector<std::byte>;
enum Entry : uint8_t { kFile, kPage, kBlock, kEntries };

void checkMesh(const Mesh& mesh, const PageSettings& settings) {
    const size_t n = mesh.vertexCount();
    CHECK_EQ(mesh.normal.size(), n);
    CHECK_EQ(mesh.colour.size(), settings.colours ? n : 0);
    CHECK_EQ(mesh.scalar.size(), n * size_t(settings.scalar_count));
    CHECK_EQ(mesh.edge_class.size(), mesh.triangleCount());
    for (const Triangle& t : mesh.triangle)
        for (const uint32_t v : t) CHECK_LT(v, n);
}

void fuzzPage(std::span<const std::byte> bytes) {
    if (bytes.empty()) return;
    const auto choice = unsigned(bytes[0]);
    const PageSettings settings{0, (choice & 1) != 0, int(choice >> 1 & 3), 10};
    PageCounts counts;
    std::string fault;
    bytes = bytes.subspan(1);
    // Large counts are legal and only make the fuzzer slow.
    if (!peekPage(bytes, counts, fault) || counts.vertices + counts.triangles > 100000) return;
    std::vector<Mesh> patches;
    if (!decodePage(bytes, settings, patches, fault)) {
        CHECK(!fault.empty());
        return;
    }
    CHECK_EQ(patches.size(), size_t(counts.patches));
    for (const Mesh& mesh : patches) checkMesh(mesh, settings);
}

void fuzzBlock(std::span<const std::byte> bytes) {
    if (bytes.size() < 3) return;
    const BlockEntry entry{0, 0, 0, 0, 0, 0, 0, uint32_t(bytes[0]), 0, uint32_t(bytes[1])};
    std::vector<Node> nodes;
    std::vector<PageRecord> pages;
    std::string fault;
    const bool face_sizes = (bytes[2] & std::byte(1)) != std::byte(0);
    if (decodeNodeBlock(bytes.subspan(3), entry, face_sizes, nodes, pages, fault))
        CHECK_EQ(nodes.size(), size_t(entry.node_count));
}

/// Sets every checksum that can be found, so that damage reaches what lies behind.
void repairChecksums(Bytes& bytes) {
    FileHeader header;
    if (bytes.size() < sizeof header) return;
    std::memcpy(&header, bytes.data(), sizeof header);
    header.file_bytes = bytes.size();
    const auto inside = [&](uint64_t offset, uint64_t size) {
        return offset <= bytes.size() && size <= bytes.size() - offset;
    };
    for (SectionEntry& section : header.sections) {
        if (!inside(section.offset, section.bytes) || section.offset < sizeof header) continue;
        if (section.kind == uint32_t(SectionKind::kDirectory))
            for (size_t i = 0; (i + 1) * sizeof(BlockEntry) <= section.bytes; ++i) {
                BlockEntry entry;
                std::byte* at = &bytes[section.offset + i * sizeof entry];
                std::memcpy(&entry, at, sizeof entry);
                if (inside(entry.offset, entry.bytes))
                    entry.checksum = hashBytes(bytes.data() + entry.offset, entry.bytes);
                std::memcpy(at, &entry, sizeof entry);
            }
        section.checksum = hashBytes(bytes.data() + section.offset, section.bytes);
    }
    header.checksum = hashBytes(&header, offsetof(FileHeader, checksum));
    std::memcpy(bytes.data(), &header, sizeof header);
}

void fuzzFile(std::span<const std::byte> input) {
    Bytes bytes(input.begin(), input.end());
    repairChecksums(bytes);
    const int descriptor = memfd_create("model", 0);
    CHECK(descriptor >= 0);
    CHECK_EQ(size_t(::write(descriptor, bytes.data(), bytes.size())), bytes.size());
    try {
        const ModelReader model(fmt::format("/proc/self/fd/{}", descriptor));
        Progress progress;
        const VerifyReport report = verifyModel(model, progress);
        CHECK_EQ(report.ok(), report.faults.empty());
    } catch (const InputError&) {
    }
    ::close(descriptor);
}

void writeSeeds(const std::string& directory) {
    const auto save = [&](const std::string& name, Bytes head, std::span<const std::byte> bytes) {
        head.insert(head.end(), bytes.begin(), bytes.end());
        std::ofstream(directory + "/" + name, std::ios::binary)
            .write(reinterpret_cast<const char*>(head.data()), std::streamsize(head.size()));
    };
    testing::Random random(1);
    for (const int choice : {0, 1, 4}) {
        const PageSettings settings{0, (choice & 1) != 0, choice >> 1, 10};
        const Mesh sheet = testing::makeSheet(4, 5, settings, random);
        const Mesh soup = testing::makeSoup(9, 12, settings, random);
        const Mesh sphere = testing::makeSphere(1, settings, random);
        const Mesh* patches[] = {&sheet, &soup, &sphere};
        for (const PageCodec codec : {PageCodec::kPlain, PageCodec::kBest})
            save(fmt::format("page-{}-{}", choice, int(codec)),
                 {std::byte(kPage), std::byte(choice)}, encodePage(patches, settings, codec));
    }
    const std::vector<Node> nodes(6);
    const std::vector<PageRecord> pages(3, PageRecord{1, 2, 2});
    for (const bool face_sizes : {false, true})
        save(fmt::format("block-{}", int(face_sizes)),
             {std::byte(kBlock), std::byte(6), std::byte(3), std::byte(face_sizes)},
             encodeNodeBlock(nodes, pages, face_sizes));

    Budget budget(64 << 20);
    ModelWriter writer(directory + "/model.tmp", true, directory, budget);
    const Mesh patch = testing::makeSheet(2, 2, {}, random);
    const Mesh* patches[] = {&patch, &patch};
    for (const uint32_t level : {1u, 0u}) {
        std::vector<Node> pair(level + 1);
        for (Node& node : pair) {
            node.bounds = node.saturated = {Vec3f(300000, 200000, 100000), 400000};
            node.triangles = uint32_t(patch.triangleCount());
            node.vertices = uint32_t(patch.vertexCount());
            if (level == 0) node.child[0] = 0, node.child[1] = 1;
        }
        writer.beginLevel(level);
        writer.addPage(encodePage(std::span(patches).first(level + 1), {}), pair);
    }
    ModelInfo info;
    info.method = "tetra";
    writer.finish(info);
    std::ifstream file(directory + "/model.tmp", std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(file)), {});
    save("file", {std::byte(kFile)}, std::as_bytes(std::span(text)));
    std::remove((directory + "/model.tmp").c_str());
}

}  // namespace
}  // namespace pietra

extern "C" int LLVMFuzzerInitialize(int*, char***) {
    if (const char* directory = std::getenv("FUZZ_SEEDS")) {
        pietra::writeSeeds(directory);
        std::exit(0);
    }
    return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    if (size == 0) return 0;
    const auto bytes = std::as_bytes(std::span(data, size)).subspan(1);
    switch (data[0] % pietra::kEntries) {
        case pietra::kFile:
            pietra::fuzzFile(bytes);
            break;
        case pietra::kPage:
            pietra::fuzzPage(bytes);
            break;
        default:
            pietra::fuzzBlock(bytes);
    }
    return 0;
}
