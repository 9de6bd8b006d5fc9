#include "render/raster/rasteriser.h"

#include <tbb/enumerable_thread_specific.h>

#include <atomic>
#include <limits>

#include "base/check.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "render/raster/batch.h"
#include "render/raster/clip.h"
#include "render/raster/coverage.h"
#include "render/raster/farthest_depths.h"
#include "render/raster/finish_picture.h"
#include "render/raster/pixel_shader.h"
#include "render/raster/resolve.h"
#include "render/raster/tiling.h"
#include "render/raster/transform.h"
#include "render/raster/triangle_kernel.h"

namespace pietra {
namespace {

/// A larger mesh is drawn in several chunks.
constexpr size_t kChunkTriangles = 4096;
/// A batch takes vertices up to so many and one patch more: 16 MB.
constexpr size_t kBatchVertices = size_t(1) << 20;
/// More tiles than threads, so that none waits long for the last one.
constexpr size_t kTilesPerThread = 8;
constexpr size_t kRowGrain = 16;

size_t threadCount() {
    return tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
}

}  // namespace

struct Rasteriser::State {
    BatchModel model;  // of what is drawn now
    ShadeSettings settings;
    int samples;
    /// Samples of a rectangle, all zero before and after it is drawn.
    struct Samples {
        std::vector<VisibilityKey> key;
        std::vector<Rgba8> colour;
    };
    Samples whole;  // of the picture; the colours of single samples are in the picture
    tbb::enumerable_thread_specific<Samples> own;  // of the tile that a thread draws
    bool is_begun = false;                         // something is in `whole`
    bool finished = false;
    Picture picture;
    Batch batch;
    std::vector<uint8_t> drawn;  // a patch of the batch: not left out, set by any thread
    std::vector<uint32_t>* hidden = nullptr;  // takes the ids of those left out
    RasterStatistics statistics;

    State(const View& v, const Lattice& lattice, int sample_count, const ShadeSettings& s)
        : model{v, Projection(v, lattice)}, settings(s), samples(sample_count) {
        CHECK(samples == 1 || samples == 4);
    }
    void begin();
    void setModel(const View& view, const Lattice& lattice);
    PixelBox screen() const { return {0, 0, picture.size.width, picture.size.height}; }
    void checkScalars(const Mesh& mesh) const;
    void beginBatch();
    void draw(std::span<const DrawPatch> patches, bool leave_out_hidden);
    void draw(std::span<const ModelPatches> models, bool leave_out_hidden);
    void drawBatch(bool leave_out_hidden, bool is_all = false);
    void layOutVertices();
    void transform(BatchPatch& patch) const;
    std::vector<DrawChunk> makeChunks() const;
    void fit(DrawChunk& chunk) const;
    ScreenPolygon clipped(const DrawChunk& chunk, uint32_t i) const;
    void drawChunk(const DrawChunk& chunk, const VisibilityTile& tile) const;
    void drawUnhidden(const std::vector<DrawChunk>& chunks, const VisibilityTile& tile,
                      std::vector<uint32_t>& list);
    void beginWhole();
    void finishWhole();
    void complete(uint64_t pixels_covered);
    VisibilityTile tileOfWhole(const PixelBox& box);
    VisibilityTile ownTile(const PixelBox& box);
    void drawTiles(const std::vector<DrawChunk>& chunks, bool leave_out_hidden, bool is_all);
};

void Rasteriser::State::begin() {
    picture.size = model.view.size();
    CHECK_LE(std::max(picture.size.width, picture.size.height), kMaxPictureSide);
    picture.focal_px = model.view.focal_px();
    const size_t pixels = picture.pixelCount();
    picture.colour.resize(pixels);
    picture.depth.resize(pixels);
    if (is_begun && !finished) whole = {};
    is_begun = finished = false;
    statistics = {};
}

void Rasteriser::State::setModel(const View& view, const Lattice& lattice) {
    CHECK(view.size().width == picture.size.width && view.size().height == picture.size.height);
    model = {view, Projection(view, lattice)};
}

void Rasteriser::State::checkScalars(const Mesh& mesh) const {
    if (settings.show != Show::kScalar || mesh.scalar.empty()) return;
    CHECK_EQ(mesh.scalar.size(), mesh.vertexCount() * size_t(settings.scalar_count));
    CHECK_LT(settings.scalar_index, settings.scalar_count);
}

void Rasteriser::State::beginBatch() {
    CHECK(!finished);
    batch.model.clear();
    batch.patch.clear();
    batch.triangles = batch.vertices = 0;
}

/// Adds patches of the model to the batch, and draws what is more than it should hold.
void Rasteriser::State::draw(std::span<const DrawPatch> patches, bool leave_out_hidden) {
    batch.model.push_back(model);
    for (const DrawPatch& patch : patches) {
        if (batch.vertices > kBatchVertices) {
            drawBatch(leave_out_hidden);
            beginBatch();
            batch.model.push_back(model);
        }
        checkScalars(*patch.mesh);
        BatchPatch entry;
        entry.patch = &patch;
        entry.model = uint32_t(batch.model.size() - 1);
        entry.first_number = uint32_t(batch.triangles);
        entry.both_sides = settings.two_sided || !patch.one_sided;
        entry.colour = patchColour(settings, patch);
        batch.patch.push_back(entry);
        batch.triangles += patch.mesh->triangleCount();
        batch.vertices += patch.mesh->vertexCount();
        CHECK_LT(batch.triangles, size_t(kMaxTriangleNumber));
    }
}

void Rasteriser::State::layOutVertices() {
    batch.vertex.resize(batch.vertices);
    ScreenVertex* vertex = batch.vertex.data();
    for (BatchPatch& patch : batch.patch) {
        patch.vertex = vertex;
        vertex += patch.mesh().vertexCount();
    }
}

void Rasteriser::State::draw(std::span<const ModelPatches> models, bool leave_out_hidden) {
    beginBatch();
    for (const ModelPatches& m : models) {
        setModel(m.view, *m.lattice);
        draw(m.patches, leave_out_hidden);
    }
}

/// `is_all`: of the picture.
void Rasteriser::State::drawBatch(bool leave_out_hidden, bool is_all) {
    Stopwatch watch;
    layOutVertices();
    parallelFor(batch.patch.size(), [&](size_t i) { transform(batch.patch[i]); });
    const std::vector<DrawChunk> chunks = makeChunks();
    drawn.assign(batch.patch.size(), !leave_out_hidden);
    statistics.transform_ms += watch.lapMs();
    drawTiles(chunks, leave_out_hidden, is_all);
    statistics.triangles += batch.triangles;
    statistics.patches += batch.patch.size();
    for (size_t i = 0; i < drawn.size(); ++i)
        if (!drawn[i]) {
            statistics.triangles_hidden += batch.patch[i].mesh().triangleCount();
            if (hidden != nullptr && !batch.patch[i].box.empty())
                hidden->push_back(batch.patch[i].patch->id);
        }
}

void Rasteriser::State::transform(BatchPatch& entry) const {
    const Mesh& mesh = entry.mesh();
    CHECK_EQ(mesh.normal.size(), mesh.position.size());
    const ImageBounds bounds = transformVertices(batch.model[entry.model].projection, mesh.position,
                                                 mesh.normal, entry.vertex);
    entry.whole = bounds.whole;
    entry.nearest = bounds.whole ? bounds.nearest : std::numeric_limits<float>::infinity();
    entry.box = bounds.behind ? PixelBox{} : screen();
    if (entry.whole)
        entry.box = entry.box.intersected(
            {bounds.min_x >> kSubpixelBits, bounds.min_y >> kSubpixelBits,
             (bounds.max_x >> kSubpixelBits) + 1, (bounds.max_y >> kSubpixelBits) + 1});
}

/// To the images of its own vertices, and of what is left of triangles that have to be clipped:
/// near the eye these may be few, and every tile draws what might be anywhere.
void Rasteriser::State::fit(DrawChunk& chunk) const {
    int32_t min_x = std::numeric_limits<int32_t>::max(),
            max_x = std::numeric_limits<int32_t>::lowest();
    int32_t min_y = min_x, max_y = max_x;
    float nearest = 0;
    const auto add = [&](const auto& point) {
        min_x = std::min(min_x, point.x);
        max_x = std::max(max_x, point.x);
        min_y = std::min(min_y, point.y);
        max_y = std::max(max_y, point.y);
        nearest = std::max(nearest, point.inv_depth);
    };
    for (uint32_t i = 0; i < chunk.count; ++i) {
        const Triangle& triangle = chunk.patch->triangle()[chunk.first + i];
        bool whole = true;
        for (const uint32_t index : triangle) whole &= chunk.patch->vertex[index].x != kNoImage;
        if (whole) {
            for (const uint32_t index : triangle) add(chunk.patch->vertex[index]);
            continue;
        }
        const ScreenPolygon left = clipped(chunk, i);
        for (int k = 0; k < left.count; ++k) add(left.point[size_t(k)]);
    }
    chunk.box = screen().intersected({min_x >> kSubpixelBits, min_y >> kSubpixelBits,
                                      (max_x >> kSubpixelBits) + 1, (max_y >> kSubpixelBits) + 1});
    chunk.nearest = nearest;
}

std::vector<DrawChunk> Rasteriser::State::makeChunks() const {
    std::vector<DrawChunk> chunks;
    for (const BatchPatch& patch : batch.patch) {
        const size_t triangles = patch.mesh().triangleCount();
        if (patch.box.empty()) continue;
        const size_t step = triangles <= 2 * kChunkTriangles ? triangles : kChunkTriangles;
        for (size_t first = 0; first < triangles; first += step)
            chunks.push_back({&patch, uint32_t(first), uint32_t(std::min(step, triangles - first)),
                              patch.box, patch.nearest});
    }
    parallelForSlices(chunks.size(), 16, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i)
            if (!chunks[i].patch->whole ||
                chunks[i].count < chunks[i].patch->mesh().triangleCount())
                fit(chunks[i]);
    });
    std::erase_if(chunks, [](const DrawChunk& chunk) { return chunk.box.empty(); });
    return chunks;
}

/// Its `i`-th triangle.
ScreenPolygon Rasteriser::State::clipped(const DrawChunk& chunk, uint32_t i) const {
    const Triangle& t = chunk.patch->triangle()[chunk.first + i];
    const std::vector<Vec3i>& position = chunk.patch->mesh().position;
    return clipTriangle(batch.model[chunk.patch->model].projection,
                        {position[t[0]], position[t[1]], position[t[2]]});
}

void Rasteriser::State::drawChunk(const DrawChunk& chunk, const VisibilityTile& tile) const {
    const BatchPatch& patch = *chunk.patch;
    thread_local std::vector<uint32_t> to_clip;
    to_clip.clear();
    prefetchBytes(patch.vertex, patch.mesh().vertexCount() * sizeof(ScreenVertex));
    const PixelBox box = chunk.box.intersected(tile.box);
    for (int32_t y = box.y0; y < box.y1; ++y)
        prefetchBytes(tile.key + tile.at(box.x0, y) * size_t(tile.samples),
                      size_t(box.x1 - box.x0) * size_t(tile.samples) * sizeof(VisibilityKey));
    drawTriangles(tile,
                  {patch.triangle() + chunk.first, chunk.count, chunk.firstNumber(), patch.vertex,
                   patch.both_sides},
                  to_clip);
    for (const uint32_t i : to_clip) {
        const ScreenPolygon p = clipped(chunk, i);
        for (int k = 2; k < p.count; ++k)
            drawTriangle(tile, {p.point[0], p.point[k - 1], p.point[k]}, patch.both_sides,
                         chunk.firstNumber() + i);
    }
}

/// The nearest first, those that are not hidden by then. What is left out is taken from `list`.
void Rasteriser::State::drawUnhidden(const std::vector<DrawChunk>& chunks,
                                     const VisibilityTile& tile, std::vector<uint32_t>& list) {
    std::sort(list.begin(), list.end(),
              [&](uint32_t a, uint32_t b) { return chunks[a].nearest > chunks[b].nearest; });
    FarthestDepths farthest(tile);
    auto kept = list.begin();
    for (const uint32_t i : list) {
        const DrawChunk& chunk = chunks[i];
        const PixelBox box = chunk.box.intersected(tile.box);
        if (farthest.hide(box, chunk.nearest)) continue;
        drawChunk(chunk, tile);
        farthest.changed(box);
        const auto patch = size_t(chunk.patch - batch.patch.data());
        std::atomic_ref(drawn[patch]).store(1, std::memory_order_relaxed);
        *kept++ = i;
    }
    list.erase(kept, list.end());
}

VisibilityTile Rasteriser::State::tileOfWhole(const PixelBox& box) {
    return {whole.key.data(), picture.size.width, samples, box,
            samples == 1 ? picture.colour.data() : whole.colour.data()};
}

VisibilityTile Rasteriser::State::ownTile(const PixelBox& box) {
    Samples& s = own.local();
    const int32_t width = box.x1 - box.x0;
    const size_t count = size_t(width) * size_t(box.y1 - box.y0) * size_t(samples);
    if (s.key.size() < count) {
        s.key.resize(count);
        s.colour.resize(count);
    }
    return {s.key.data(), width, samples, box, s.colour.data(), box.y0 * width + box.x0};
}

/// `is_all`: of the picture, which is finished then.
void Rasteriser::State::drawTiles(const std::vector<DrawChunk>& chunks, bool leave_out_hidden,
                                  bool is_all) {
    Tiling tiling = makeTiles(chunks, screen(), kTilesPerThread * threadCount());
    std::vector<DrawTile>& tiles = tiling.tiles;
    std::vector<PixelShader> shader;
    for (const BatchModel& m : batch.model) shader.emplace_back(m.view, m.projection, settings);
    if (!is_all && !is_begun) beginWhole();
    std::atomic<int64_t> raster_ns{0}, shade_ns{0}, finish_ns{0};
    std::atomic<uint64_t> covered{0};
    Stopwatch watch;
    const auto drawTile = [&](DrawTile& piece) {
        Stopwatch tile_watch;
        const VisibilityTile tile = is_all ? ownTile(piece.box) : tileOfWhole(piece.box);
        if (leave_out_hidden)
            drawUnhidden(chunks, tile, piece.chunk);
        else
            for (const uint32_t chunk : piece.chunk) drawChunk(chunks[chunk], tile);
        raster_ns += int64_t(tile_watch.lapMs() * 1e6);
        for (const uint32_t chunk : piece.chunk)
            resolveChunk(tile, chunks[chunk], shader[chunks[chunk].patch->model]);
        shade_ns += int64_t(tile_watch.lapMs() * 1e6);
        if (is_all) covered += finishTile(settings, tile, picture);
        finish_ns += int64_t(tile_watch.lapMs() * 1e6);
    };
    parallelFor(tiles.size() + (is_all ? tiling.empty.size() : 0), [&](size_t i) {
        if (i < tiles.size())
            drawTile(tiles[i]);
        else
            finishEmpty(settings, tiling.empty[i - tiles.size()], picture);
    });
    if (is_all) complete(covered);
    const double wall = watch.lapMs(), busy = double(raster_ns + shade_ns + finish_ns);
    const auto share = [&](int64_t ns) { return busy > 0 ? wall * double(ns) / busy : 0; };
    statistics.raster_ms += share(raster_ns);
    statistics.shade_ms += share(shade_ns);
    statistics.finish_ms += share(finish_ns);
}

void Rasteriser::State::beginWhole() {
    const size_t count = picture.pixelCount() * size_t(samples);
    if (whole.key.size() != count) whole.key.assign(count, 0);
    if (samples > 1) whole.colour.resize(count);
    is_begun = true;
}

void Rasteriser::State::finishWhole() {
    if (!is_begun) beginWhole();
    Stopwatch watch;
    std::atomic<uint64_t> covered{0};
    parallelForSlices(size_t(picture.size.height), kRowGrain, [&](size_t begin, size_t end) {
        const PixelBox rows{0, int32_t(begin), picture.size.width, int32_t(end)};
        covered += finishTile(settings, tileOfWhole(rows), picture);
    });
    complete(covered);
    statistics.finish_ms += watch.lapMs();
}

void Rasteriser::State::complete(uint64_t pixels_covered) {
    if (settings.show == Show::kDepth) paintDepth(picture);
    statistics.pixels_covered = pixels_covered;
    finished = true;
}

Rasteriser::Rasteriser(const View& view, const Lattice& lattice, int samples,
                       const ShadeSettings& settings)
    : state_(std::make_unique<State>(view, lattice, samples, settings)) {
    state_->begin();
}

Rasteriser::~Rasteriser() = default;

void Rasteriser::restart(const View& view, const Lattice& lattice, const ShadeSettings& settings) {
    state_->model = {view, Projection(view, lattice)};
    state_->settings = settings;
    state_->begin();
}

void Rasteriser::setModel(const View& view, const Lattice& lattice) {
    state_->setModel(view, lattice);
}

void Rasteriser::draw(std::span<const DrawPatch> patches) {
    state_->beginBatch();
    state_->draw(patches, false);
    state_->drawBatch(false);
}

void Rasteriser::draw(std::span<const ModelPatches> models, bool leave_out_hidden) {
    state_->draw(models, leave_out_hidden);
    state_->drawBatch(leave_out_hidden);
}

const Picture& Rasteriser::drawAll(std::span<const ModelPatches> models, bool leave_out_hidden,
                                   std::vector<uint32_t>* hidden) {
    State& s = *state_;
    CHECK(!s.is_begun);
    s.hidden = hidden;
    s.draw(models, leave_out_hidden);
    s.drawBatch(leave_out_hidden, !s.is_begun);
    s.hidden = nullptr;
    return finish();
}

const Picture& Rasteriser::finish() {
    State& s = *state_;
    if (!s.finished) s.finishWhole();
    return s.picture;
}

const RasterStatistics& Rasteriser::statistics() const {
    return state_->statistics;
}

}  // namespace pietra
