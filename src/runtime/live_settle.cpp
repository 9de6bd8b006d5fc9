#include "runtime/live_settle.h"

#include <fmt/format.h>

#include <limits>

#include "base/check.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "base/text.h"
#include "runtime/eye_side.h"
#include "runtime/patch_reader.h"

namespace pietra {
namespace {

constexpr size_t kReadTogether = 256;
constexpr double kRaise = 1.1;

/// False if none of them could arrive.
bool readPages(const ModelReader& reader, LiveModel& model, const std::vector<uint32_t>& pages) {
    std::vector<std::unique_ptr<LivePage>> decoded(pages.size());
    parallelFor(pages.size(), [&](size_t i) {
        std::vector<std::byte> bytes;
        std::string fault;
        reader.readPage(pages[i], bytes);
        decoded[i] = model.decode(pages[i], bytes, fault);
        if (!decoded[i])
            throw InputError::atByte(reader.path(), reader.page(pages[i]).offset, fault);
    });
    bool any = false;
    for (size_t i = 0; i < pages.size(); ++i) any |= model.arrive(pages[i], decoded[i].get());
    return any;
}

}  // namespace

std::unique_ptr<LiveModel> openLive(const ModelReader& reader, OpenLive open) {
    if (open == nullptr) requirePatches(reader);
    return open(reader);
}

namespace {

/// False if memory is too small for it.
bool refine(const ModelReader& reader, LiveModel& model, const LiveTask& task) {
    for (;;) {
        if (Progress::cancelRequested()) throw Interrupted();
        const LiveFrame& frame = model.adapt(task);
        const std::vector<uint32_t> pages = model.requests(kReadTogether);
        const bool arrived = !pages.empty() && readPages(reader, model, pages);
        if (arrived || frame.busy) continue;
        if (!frame.short_of_memory) return true;
        if (model.release(task.most_bytes) == 0) return false;
    }
}

void checkRoom(const LiveModel& model, size_t most_bytes) {
    if (model.bytes() > most_bytes)
        throw MemoryError(fmt::format("the coarsest level needs {}", formatBytes(model.bytes())));
}

}  // namespace

double settle(const ModelReader& reader, LiveModel& model, const View& view, double pixels,
              size_t most_bytes) {
    CHECK_LT(0, pixels);
    checkRoom(model, most_bytes);
    while (!refine(reader, model, {.view = &view, .pixels = pixels, .most_bytes = most_bytes}))
        pixels *= kRaise;
    return pixels;
}

void visitColumns(const ModelReader& reader, LiveModel& model, const View& view, size_t most_bytes,
                  const std::function<void(const LiveColumn&)>& visit) {
    checkRoom(model, most_bytes);
    const Box3i& bounds = reader.info().bounds;
    const Vec3i size = bounds.max - bounds.min;
    const int thin = size.x < size.y ? (size.x < size.z ? 0 : 2) : (size.y < size.z ? 1 : 2);
    LiveColumn whole;
    whole.axis = {(thin + 1) % 3, (thin + 2) % 3};
    for (size_t i = 0; i < 2; ++i) {
        whole.low[i] = bounds.min[whole.axis[i]];
        whole.high[i] = bounds.max[whole.axis[i]] + 1;
    }
    std::vector<LiveColumn> left{whole};
    double most_area = std::numeric_limits<double>::infinity();  // that is tried
    while (!left.empty()) {
        const LiveColumn column = left.back();
        left.pop_back();
        const std::array<int32_t, 2> wide = {column.high[0] - column.low[0],
                                             column.high[1] - column.low[1]};
        const double area = double(wide[0]) * wide[1];
        if (area <= most_area) {
            if (refine(reader, model,
                       {.view = &view, .pixels = 0, .column = &column, .most_bytes = most_bytes})) {
                visit(column);
                most_area = 2.5 * area;
                continue;
            }
            most_area = area / 2;
        }
        const size_t along = wide[1] > wide[0];
        if (wide[along] < 2)
            throw MemoryError(fmt::format("parts of {} need more than {}", reader.path(),
                                          formatBytes(most_bytes)));
        LiveColumn first = column, second = column;
        first.high[along] = second.low[along] = column.low[along] + wide[along] / 2;
        left.push_back(second);
        left.push_back(first);
    }
}

bool eyeMayBeInside(const LiveModel& model, const View& view) {
    Box3i closed;
    for (const LiveChunk& chunk : model.chunks())
        if (chunk.version != 0 && chunk.closed) closed.add(chunk.box);
    return !closed.empty() && holds({Vec3d(closed.min), Vec3d(closed.max)}, view.eye());
}

void listChunks(const LiveModel& model, uint32_t number, const View& view, const Culling& culling,
                bool two_sided, bool show_error, std::vector<DrawPatch>& list) {
    list.clear();
    const std::span<const LiveChunk> chunks = model.chunks();
    for (uint32_t c = 0; c < chunks.size(); ++c) {
        const LiveChunk& chunk = chunks[c];
        const bool one_sided = chunk.closed && !two_sided;
        if (chunk.version == 0 || (culling.frustum && view.outside(chunk.bounds))) continue;
        if (culling.cone && one_sided && view.facesAway(chunk.cone, chunk.bounds)) continue;
        DrawPatch patch;
        patch.mesh = &chunk.mesh;
        patch.page = {number, c};
        patch.one_sided = one_sided;
        patch.id = c + number * 0x9e3779b9u;
        patch.value = show_error ? float(view.errorInPixels(chunk.error, chunk.saturated))
                                 : float(chunk.level);
        list.push_back(patch);
    }
}

void refineEvenly(const ModelReader& reader, LiveModel& model, uint64_t triangles) {
    const ModelInfo& info = reader.info();
    const Vec3d low = info.lattice.toInput(info.bounds.min);
    const Vec3d size = info.lattice.toInput(info.bounds.max) - low;
    Camera camera;
    camera.target = low + 0.5 * size;
    // From so far that the error is all that counts.
    camera.eye = camera.target + 4.0 * glm::length(size) * glm::normalize(Vec3d(0.5, -0.7, 0.6));
    const View view(camera, {1024, 1024}, info.lattice);
    for (double pixels = 64; pixels > 1e-3; pixels /= 2) {
        settle(reader, model, view, pixels, ~size_t(0) / 2);
        uint64_t count = 0;
        for (const LiveChunk& chunk : model.chunks()) count += chunk.mesh.triangleCount();
        if (count > triangles / 2) return;
    }
}

}  // namespace pietra
