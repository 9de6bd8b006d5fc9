// Fuzzes the pages of splits (methods/pmesh/split_codec.h). The first byte picks a node's or a
// base mesh's; the next ones the row that the file's table would give.
// FUZZ_SEEDS=DIR writes valid pages to DIR and stops: start from those.

#include <cstdlib>
#include <fstream>

#include "base/check.h"
#include "methods/pmesh/in_core_builder.h"
#include "methods/pmesh/split_codec.h"
#include "simplify/test_meshes.h"

namespace pietra::pmesh {
namespace {

constexpr size_t kHead = 6;

/// Children 1 and 2, or only the first; a parent or none. Its criterion encloses all.
SplitRow rowFrom(const uint8_t* head) {
    SplitRow row;
    if (head[1] & 1) row.child[0] = 1;
    if (head[1] & 2) row.child[1] = 2;
    if (head[1] & 4) row.parent = 0;
    row.splits = uint32_t(head[2] | head[3] << 8);
    row.criterion.max.fill(0xffff);
    row.criterion.error = NestedCriterion::kEver - 1;
    return row;
}

void fuzzNode(const uint8_t* head, std::span<const std::byte> bytes) {
    SplitNode node;
    std::string fault;
    if (!decodeSplitNode(bytes, rowFrom(head), {}, node, fault)) {
        CHECK(!fault.empty());
        return;
    }
    // What was accepted survives.
    SplitNode again;
    CHECK(decodeSplitNode(encodeSplitNode(node), rowFrom(head), {}, again, fault));
    CHECK(again == node);
}

void fuzzBase(std::span<const std::byte> bytes) {
    SplitForest forest;
    forest.row.resize(3);
    forest.row[0].splits = 600;
    std::string fault;
    if (!decodeSplitBase(bytes, forest, fault)) CHECK(!fault.empty());
}

void writeSeeds(const std::string& directory) {
    Budget budget(size_t(1) << 30);
    const SplitForest forest = buildInCore(test::toLattice(test::sphereShape(20), 900), {}, budget);
    const auto save = [&](const std::string& name, std::vector<char> head,
                          const std::vector<std::byte>& bytes) {
        std::ofstream out(directory + "/" + name, std::ios::binary);
        out.write(head.data(), std::streamsize(head.size()));
        out.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    };
    for (NodeIndex n = 0; n < forest.node.size(); ++n) {
        const SplitRow& row = forest.row[n];
        const int links = int(row.child[0] != kNoNode) + 2 * int(row.child[1] != kNoNode) +
                          4 * int(row.parent != kNoNode);
        save("node-" + std::to_string(n),
             {0, char(links), char(row.splits & 255), char(row.splits >> 8), 0, 0},
             encodeSplitNode(forest.node[n]));
    }
    save("base", {1, 0, 0, 0, 0, 0}, encodeSplitBase(forest));
}

}  // namespace
}  // namespace pietra::pmesh

extern "C" int LLVMFuzzerInitialize(int*, char***) {
    if (const char* directory = std::getenv("FUZZ_SEEDS")) {
        pietra::pmesh::writeSeeds(directory);
        std::exit(0);
    }
    return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace pietra::pmesh;
    if (size < kHead) return 0;
    const auto bytes = std::as_bytes(std::span(data, size)).subspan(kHead);
    if (data[0] % 2 == 0)
        fuzzNode(data, bytes);
    else
        fuzzBase(bytes);
    return 0;
}
