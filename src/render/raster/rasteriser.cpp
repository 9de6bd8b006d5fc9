#include "render/raster/rasteriser.h"

#include <chrono>
#include <limits>
#include <optional>

#include "base/check.h"
#include "base/parallel.h"
#include "render/raster/batch.h"
#include "render/raster/clip.h"
#include "render/raster/coverage.h"
#include "render/raster/pixel_shader.h"
#include "render/raster/transform.h"
#include "render/raster/triangle_kernel.h"

namespace pietra {
namespace {

constexpr int kTileRows = 64;

class Stopwatch {
public:
    double ms() {
        const auto now = std::chrono::steady_clock::now();
        const double ms = std::chrono::duration<double, std::milli>(now - began_).count();
        began_ = now;
        return ms;
    }

private:
    std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

}  // namespace

struct Rasteriser::State {
    View view;
    Projection projection;
    ShadeSettings settings;
    int samples;
    std::vector<VisibilityKey> key;
    std::vector<Rgba8> sample_colour;  // with 4 samples; with 1 it is the picture's
    Picture picture;
    Batch batch;
    RasterStatistics statistics;

    State(const View& v, const Lattice& lattice, int sample_count, const ShadeSettings& s)
        : view(v), projection(v, lattice), settings(s), samples(sample_count) {
        CHECK(samples == 1 || samples == 4);
    }
    void begin();
    PixelBox screen() const { return {0, 0, picture.size.width, picture.size.height}; }
    void layOut(std::span<const DrawPatch> patches);
    void transform(BatchPatch& patch);
    void drawPatch(const BatchPatch& patch, const VisibilityTile& tile);
    void resolve(const PixelShader& shader, const PixelBox& box);
    void finishRow(int y);
    Rgba8 averagedColour(size_t pixel, const Vec3f& background) const;
};

void Rasteriser::State::begin() {
    picture.size = view.size();
    picture.focal_px = view.focal_px();
    const size_t pixels = picture.pixelCount();
    picture.colour.resize(pixels);
    picture.depth.resize(pixels);
    key.assign(pixels * size_t(samples), 0);
    if (samples > 1) sample_colour.resize(pixels * size_t(samples));
    statistics = {};
}

void Rasteriser::State::layOut(std::span<const DrawPatch> patches) {
    batch.patch.clear();
    batch.patch_of_block.clear();
    size_t vertices = 0;
    for (const DrawPatch& patch : patches) {
        BatchPatch entry;
        entry.patch = &patch;
        entry.both_sides = settings.two_sided || !patch.one_sided;
        entry.first_vertex = uint32_t(vertices);
        entry.first_number = uint32_t(batch.patch_of_block.size() << kNumberBlockBits);
        entry.colour = patchColour(settings, patch);
        vertices += patch.mesh->vertexCount();
        const size_t blocks =
            (patch.mesh->triangleCount() + (1 << kNumberBlockBits) - 1) >> kNumberBlockBits;
        batch.patch_of_block.insert(batch.patch_of_block.end(), blocks,
                                    uint32_t(batch.patch.size()));
        batch.patch.push_back(entry);
        statistics.triangles += patch.mesh->triangleCount();
    }
    statistics.patches += patches.size();
    batch.vertex.resize(vertices);
}

void Rasteriser::State::transform(BatchPatch& entry) {
    const Mesh& mesh = *entry.patch->mesh;
    CHECK_EQ(mesh.normal.size(), mesh.position.size());
    const ImageBounds bounds = transformVertices(projection, mesh.position, mesh.normal,
                                                 batch.vertex.data() + entry.first_vertex);
    entry.whole = bounds.whole;
    entry.box = screen();
    if (entry.whole)
        entry.box = entry.box.intersected(
            {bounds.min_x >> kSubpixelBits, bounds.min_y >> kSubpixelBits,
             (bounds.max_x >> kSubpixelBits) + 1, (bounds.max_y >> kSubpixelBits) + 1});
}

void Rasteriser::State::drawPatch(const BatchPatch& entry, const VisibilityTile& tile) {
    const Mesh& mesh = *entry.patch->mesh;
    thread_local std::vector<uint32_t> clipped;
    clipped.clear();
    drawTriangles(tile,
                  {mesh.triangle.data(), mesh.triangle.size(), entry.first_number,
                   batch.vertex.data() + entry.first_vertex, entry.both_sides},
                  clipped);
    for (const uint32_t i : clipped) {
        const Triangle& t = mesh.triangle[i];
        const ScreenPolygon p = clipTriangle(
            projection, {mesh.position[t[0]], mesh.position[t[1]], mesh.position[t[2]]});
        for (int k = 2; k < p.count; ++k)
            drawTriangle(tile, {p.point[0], p.point[k - 1], p.point[k]}, entry.both_sides,
                         entry.first_number + i);
    }
}

void Rasteriser::State::resolve(const PixelShader& shader, const PixelBox& box) {
    ShadeItem item[kShadeLanes];
    Rgba8 colour[kShadeLanes];
    size_t items = 0;
    Rgba8* target = samples == 1 ? picture.colour.data() : sample_colour.data();
    const auto flush = [&] {
        if (items == 0) return;
        shader.shade(batch, {item, items}, colour);
        for (size_t i = 0; i < items; ++i) {
            const uint32_t first = item[i].target >> 4;
            for (uint32_t mask = item[i].target & 15, s = 0; mask != 0; mask >>= 1, ++s)
                if (mask & 1) target[size_t(first) * size_t(samples) + s] = colour[i];
        }
        items = 0;
    };
    for (int y = box.y0; y < box.y1; ++y)
        for (int x = box.x0; x < box.x1; ++x) {
            const size_t pixel = picture.index(x, y);
            VisibilityKey* sample = &key[pixel * size_t(samples)];
            for (int s = 0; s < samples; ++s) {
                if (sample[s] == 0 || uint32_t(sample[s]) == kResolved) continue;
                const uint32_t low = uint32_t(sample[s]);
                uint32_t mask = 0;
                for (int t = s; t < samples; ++t)
                    if (uint32_t(sample[t]) == low && sample[t] != 0) {
                        mask |= 1u << t;
                        sample[t] |= kResolved;
                    }
                item[items++] = {0xfffffffe - low, uint16_t(x), uint16_t(y),
                                 uint32_t(pixel << 4 | mask)};
                if (items == size_t(kShadeLanes)) flush();
            }
        }
    flush();
}

Rgba8 Rasteriser::State::averagedColour(size_t pixel, const Vec3f& background) const {
    const Rgba8* colour = &sample_colour[4 * pixel];
    Vec3f sum(0, 0, 0);
    bool same = true;
    for (int s = 0; s < 4; ++s) {
        const bool covered = key[4 * pixel + size_t(s)] != 0;
        same = same && covered && colour[s] == colour[0];
        sum += covered ? linearFromSrgb(colour[s]) : background;
    }
    return same ? colour[0] : srgbFromLinear(sum * 0.25f);
}

void Rasteriser::State::finishRow(int y) {
    const Vec3f background = backgroundColour(settings, y, picture.size.height);
    const Rgba8 background_byte = srgbFromLinear(background);
    for (int x = 0; x < picture.size.width; ++x) {
        const size_t pixel = picture.index(x, y);
        VisibilityKey nearest = 0;
        for (int s = 0; s < samples; ++s)
            nearest = std::max(nearest, key[pixel * size_t(samples) + size_t(s)]);
        picture.depth[pixel] = nearest == 0 ? std::numeric_limits<float>::infinity()
                                            : 1 / std::bit_cast<float>(uint32_t(nearest >> 32));
        if (nearest == 0)
            picture.colour[pixel] = background_byte;
        else if (samples == 4)
            picture.colour[pixel] = averagedColour(pixel, background);
    }
}

Rasteriser::Rasteriser(const View& view, const Lattice& lattice, int samples,
                       const ShadeSettings& settings)
    : state_(std::make_unique<State>(view, lattice, samples, settings)) {
    state_->begin();
}

Rasteriser::~Rasteriser() = default;

void Rasteriser::restart(const View& view, const Lattice& lattice, const ShadeSettings& settings) {
    state_->view = view;
    state_->projection = Projection(view, lattice);
    state_->settings = settings;
    state_->begin();
}

void Rasteriser::setModel(const View& view, const Lattice& lattice) {
    CHECK(view.size().width == state_->view.size().width &&
          view.size().height == state_->view.size().height);
    state_->view = view;
    state_->projection = Projection(view, lattice);
}

void Rasteriser::draw(std::span<const DrawPatch> patches) {
    State& s = *state_;
    Stopwatch watch;
    s.layOut(patches);
    parallelFor(s.batch.patch.size(), [&](size_t i) { s.transform(s.batch.patch[i]); });
    s.statistics.transform_ms += watch.ms();
    const PixelShader shader(s.view, s.projection, s.settings);
    const size_t tiles = size_t(s.picture.size.height + kTileRows - 1) / kTileRows;
    parallelFor(tiles, [&](size_t i) {
        const int y = int(i) * kTileRows;
        const PixelBox box = s.screen().intersected({0, y, s.picture.size.width, y + kTileRows});
        const VisibilityTile tile{s.key.data(), s.picture.size.width, s.samples, box};
        for (const BatchPatch& patch : s.batch.patch)
            if (!patch.box.intersected(box).empty()) s.drawPatch(patch, tile);
        s.resolve(shader, box);
    });
    s.statistics.raster_ms += watch.ms();
}

const Picture& Rasteriser::finish() {
    State& s = *state_;
    Stopwatch watch;
    parallelFor(size_t(s.picture.size.height), [&](size_t y) { s.finishRow(int(y)); });
    uint64_t covered = 0;
    for (const float depth : s.picture.depth)
        covered += depth != std::numeric_limits<float>::infinity();
    s.statistics.pixels_covered = covered;
    s.statistics.finish_ms += watch.ms();
    return s.picture;
}

const RasterStatistics& Rasteriser::statistics() const {
    return state_->statistics;
}

}  // namespace pietra
