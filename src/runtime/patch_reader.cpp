#include "runtime/patch_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>

#include "base/check.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/stopwatch.h"

namespace pietra {

void requirePatches(const ModelReader& model) {
    if (!model.hasPatches())
        throw InputError(
            model.path(), "",
            fmt::format("models of the method {} cannot be drawn so", model.info().method));
}

std::vector<PageRun> pageRuns(std::span<const Node> table, std::span<const NodeIndex> nodes) {
    std::vector<PageRun> runs;
    for (size_t i = 0; i < nodes.size();) {
        const uint32_t page = table[nodes[i]].page;
        size_t end = i + 1;
        for (; end < nodes.size() && table[nodes[end]].page == page; ++end)
            CHECK(nodes[end] > nodes[end - 1]);
        runs.push_back({page, nodes.subspan(i, end - i)});
        i = end;
    }
    return runs;
}

void visitPatches(const ModelReader& model, std::span<const NodeIndex> nodes,
                  const std::function<void(NodeIndex, const Mesh&)>& visit) {
    const std::vector<PageRun> runs = pageRuns(model.nodes(), nodes);
    PerThread<std::vector<Mesh>> scratch;
    parallelFor(runs.size(), [&](size_t i) {
        std::vector<Mesh>& patches = scratch.local();
        model.decode(runs[i].page, patches);
        for (const NodeIndex node : runs[i].nodes) visit(node, patches[model.nodes()[node].patch]);
    });
}

ReadTimes visitInOrder(const ModelReader& model, std::span<const NodeIndex> nodes, size_t in_flight,
                       const RunVisitor& visit) {
    const std::vector<PageRun> runs = pageRuns(model.nodes(), nodes);
    std::atomic<int64_t> load_ns{0}, decode_ns{0};
    const auto read = [&](size_t i) {
        Stopwatch watch;
        std::vector<std::byte> bytes;
        model.readPage(runs[i].page, bytes);
        load_ns += int64_t(watch.lapMs() * 1e6);
        std::vector<Mesh> page;
        std::string fault;
        if (!model.tryDecode(runs[i].page, bytes, page, fault))
            throw InputError::atByte(model.path(), model.page(runs[i].page).offset, fault);
        DecodedRun run{runs[i].nodes, {}};
        for (const NodeIndex node : run.nodes)
            run.patches.push_back(std::move(page[model.nodes()[node].patch]));
        decode_ns += int64_t(watch.ms() * 1e6);
        return run;
    };
    orderedPipeline(runs.size(), in_flight, read, visit);
    return {double(load_ns) * 1e-6, double(decode_ns) * 1e-6};
}

std::vector<size_t> decodedPageBytes(const ModelReader& model) {
    const AttributeSchema& schema = model.info().schema;
    const size_t vertex_bytes = sizeof(Vec3i) + sizeof(OctNormal) +
                                (schema.colours ? sizeof(Rgba8) : 0) +
                                schema.scalars.size() * sizeof(float);
    std::vector<size_t> bytes(model.pageCount());
    for (const Node& node : model.nodes())
        bytes[node.page] += node.vertices * vertex_bytes + node.triangles * (sizeof(Triangle) + 1);
    return bytes;
}

size_t largestDecodedPageBytes(const ModelReader& model) {
    std::vector<size_t> bytes = decodedPageBytes(model);
    for (uint32_t page = 0; page < model.pageCount(); ++page) bytes[page] += model.page(page).bytes;
    return bytes.empty() ? 0 : *std::max_element(bytes.begin(), bytes.end());
}

}  // namespace pietra
