#include "render/gl/renderer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>

#include "base/check.h"
#include "base/error.h"
#include "base/text.h"
#include "gpu/program.h"
#include "render/gl/draw_programs.h"
#include "render/gl/frame_block.h"
#include "render/gl/occlusion.h"
#include "render/gl/seen_depths.h"
#include "render/gl/page_store.h"
#include "render/gl/targets.h"
#include "render/gl/upload_ring.h"
#include "render/raster/projection.h"

namespace pietra {
namespace {

/// The depth buffer is 1 at a depth of kNearDepth / kDepthRoom: other models of the scene may be on
/// finer lattices than the first one, by as much.
constexpr float kDepthRoom = 65536;
constexpr size_t kLargestRing = size_t(1) << 24;

size_t ringBytes(size_t vram_bytes) {
    return std::min(vram_bytes / 8, kLargestRing) / 2048 * 2048;
}

/// What is left beside the ring and what the culler keeps: two words a slot, two commands a draw.
size_t pageBytes(size_t vram_bytes) {
    const size_t ring = ringBytes(vram_bytes), rest = vram_bytes - ring;
    return rest - rest / (OcclusionCuller::kSlotBytes / 8) - ring / 16;
}

bool isLlvmpipe() {
    const auto* name = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
    return name != nullptr && std::string_view(name).find("llvmpipe") != std::string_view::npos;
}

/// Vertex attributes, as patch_draw.vert.glsl numbers them; each has a binding of its own, but the
/// normal, which lies beside the position.
enum Attribute : GLuint { kPosition = 0, kNormal = 1, kColour = 2, kScalar = 3 };

GlVertexArray makeVertexArray(GLuint indices) {
    GLuint name = 0;
    glCreateVertexArrays(1, &name);
    GlVertexArray array(name);
    glVertexArrayAttribIFormat(array, kPosition, 2, GL_UNSIGNED_INT, 0);
    glVertexArrayAttribIFormat(array, kNormal, 2, GL_SHORT, 8);
    glVertexArrayAttribFormat(array, kColour, 4, GL_UNSIGNED_BYTE, GL_TRUE, 0);
    glVertexArrayAttribFormat(array, kScalar, 1, GL_FLOAT, GL_FALSE, 0);
    for (const GLuint attribute : {kPosition, kNormal, kColour, kScalar})
        glVertexArrayAttribBinding(array, attribute, attribute == kNormal ? kPosition : attribute);
    for (const GLuint attribute : {kPosition, kNormal}) glEnableVertexArrayAttrib(array, attribute);
    glVertexArrayElementBuffer(array, indices);
    return array;
}

/// What draws of one call have in common. Kept as one number, to sort by.
struct DrawGroup {
    bool culled, wide;
    VertexLayout layout;

    uint32_t key() const {
        return uint32_t(culled) | uint32_t(wide) << 1 | uint32_t(layout.colours) << 2 |
               layout.scalars << 3;
    }
};

struct QueuedDraw {
    uint32_t group;  // DrawGroup::key()
    uint32_t item;
    const StoredPage* page;
    const StoredPatch& patch(const DrawPatch& i) const { return page->patches[i.patch]; }
};

}  // namespace

struct GlRenderer::State {
    ShadeSettings settings;
    UploadRing ring;
    PageStore pages;
    Targets targets;
    std::array<GlProgram, kLooks> programs[2];  // with 1 and 4 samples
    int samples;
    GlTexture scalar_colours;
    GlVertexArray vertex_array;
    OcclusionCuller culler;
    SeenDepths seen;
    /// Times of a picture's begin and end, of two pictures in turn.
    struct Timer {
        GlQuery begin, end;
        bool running = false;
    };
    Timer timer[2];
    int current_timer = 0;

    std::optional<Projection> projection;
    FrameBlock frame{};
    float reference = 0;  // of depth, see Targets::finish()
    double focal_px = 0;
    bool drawing = false;  // between begin() and finish()
    uint64_t uploaded_before = 0;
    std::vector<uint32_t>* hidden = nullptr;  // takes the ids of those left out
    GlStatistics statistics;
    std::vector<QueuedDraw> queue;  // of one draw(), kept for its memory

    State(const PictureSize& size, int samples, size_t vram_bytes);
    void resize(const PictureSize& size, int with_samples);
    void beginTimer();
    void readTimer(Timer& timer);
    void setModel(const View& view, const Lattice& lattice);
    void setState() const;
    static void leaveState();
    void enqueue(std::span<const DrawPatch> items);
    size_t drawsAtATime() const;
    void drawInChunks(std::span<const DrawPatch> items, bool cull);
    void submit(std::span<const DrawPatch> items, std::span<const QueuedDraw> chunk, bool cull);
    void drawCommands(std::span<const DrawPatch> items, std::span<const QueuedDraw> chunk,
                      GLuint buffer, GLintptr offset);
    void provideBoxes(std::span<const DrawPatch> items, std::span<const QueuedDraw> chunk);
    CullRecord boxOf(const StoredPatch& patch) const;
    void bindGroup(const DrawGroup& group);
    DrawRecord recordOf(const DrawPatch& item, const QueuedDraw& draw) const;
    void finish();
};

GlRenderer::State::State(const PictureSize& size, int with_samples, size_t vram_bytes)
    : ring(ringBytes(vram_bytes)),
      pages(pageBytes(vram_bytes), ring),
      targets(size, with_samples),
      samples(with_samples),
      scalar_colours(makeScalarColours()),
      vertex_array(makeVertexArray(pages.buffer())),
      culler(drawsAtATime(), pages.capacity(), isLlvmpipe()) {
    resize(size, samples);
    GLuint names[4];
    glCreateQueries(GL_TIMESTAMP, 4, names);
    for (int i = 0; i < 2; ++i)
        timer[i] = {GlQuery(names[2 * i]), GlQuery(names[2 * i + 1]), false};
    if (glGetError() == GL_OUT_OF_MEMORY)
        throw MemoryError(
            fmt::format("there are no {} of graphics memory", formatBytes(vram_bytes)));
}

void GlRenderer::State::resize(const PictureSize& size, int with_samples) {
    CHECK(!drawing);
    if (size.width != targets.size().width || size.height != targets.size().height ||
        with_samples != samples)
        targets.resize(size, with_samples);
    samples = with_samples;
    if (programs[samples == 4][0] == 0) programs[samples == 4] = makeDrawPrograms(samples);
}

void GlRenderer::State::readTimer(Timer& t) {
    if (!t.running) return;
    GLint done = 0;
    glGetQueryObjectiv(t.end, GL_QUERY_RESULT_AVAILABLE, &done);
    if (done == 0) return;
    GLuint64 begin_ns = 0, end_ns = 0;
    glGetQueryObjectui64v(t.begin, GL_QUERY_RESULT, &begin_ns);
    glGetQueryObjectui64v(t.end, GL_QUERY_RESULT, &end_ns);
    statistics.gpu_ms = double(end_ns - begin_ns) * 1e-6;
    t.running = false;
}

void GlRenderer::State::beginTimer() {
    readTimer(timer[current_timer]);
    current_timer ^= 1;
    readTimer(timer[current_timer]);
    timer[current_timer].running = false;
    glQueryCounter(timer[current_timer].begin, GL_TIMESTAMP);
}

void GlRenderer::State::setModel(const View& view, const Lattice& lattice) {
    CHECK(view.size().width == targets.size().width && view.size().height == targets.size().height);
    const Projection& p = projection.emplace(view, lattice);
    frame.right = {p.right, p.offset.x};
    frame.up = {p.up, p.offset.y};
    frame.forward = {p.forward, p.offset.z};
    frame.near_depth = kNearDepth;
    frame.clip_from_view = {p.scale / p.centre_x, -p.scale / p.centre_y};
    frame.depth_scale = reference * p.inv_step;
    frame.inv_focal = float(1 / view.focal_px());
    frame.light = Vec3f(glm::normalize(settings.light_direction));
    const float range = settings.scalar_max - settings.scalar_min;
    frame.scalar_range = {settings.scalar_min, range > 0 ? 1 / range : 0};
    frame.centre = 0.5f * glm::vec2(float(view.size().width), float(view.size().height));
}

/// All that is drawn needs and that others may have changed.
void GlRenderer::State::setState() const {
    targets.bind();
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    glEnable(GL_CLIP_DISTANCE0);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_GREATER);
    glDepthMask(GL_TRUE);
    glDepthRangef(0, 1);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    for (const GLenum off : {GL_BLEND, GL_SCISSOR_TEST, GL_STENCIL_TEST, GL_PRIMITIVE_RESTART,
                             GL_PRIMITIVE_RESTART_FIXED_INDEX, GL_RASTERIZER_DISCARD,
                             GL_SAMPLE_ALPHA_TO_COVERAGE, GL_SAMPLE_MASK, GL_DEPTH_CLAMP})
        glDisable(off);
    glEnable(GL_MULTISAMPLE);
    glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    glFrontFace(GL_CW);  // y is turned down
    glCullFace(GL_BACK);
    glBindTextureUnit(kScalarColoursUnit, scalar_colours);
    glBindSampler(kScalarColoursUnit, 0);
}

void GlRenderer::State::leaveState() {
    glClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
    glDisable(GL_CLIP_DISTANCE0);
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_CULL_FACE);
    glDisable(GL_FRAMEBUFFER_SRGB);
    glDepthFunc(GL_LESS);
    glFrontFace(GL_CCW);
    glBindVertexArray(0);
    glUseProgram(0);
}

void GlRenderer::State::enqueue(std::span<const DrawPatch> items) {
    queue.clear();
    const StoredPage* page = nullptr;
    for (uint32_t i = 0; i < items.size(); ++i) {
        const DrawPatch& item = items[i];
        if (page == nullptr || !(items[i - 1].page == item.page)) page = pages.find(item.page);
        CHECK(page != nullptr);
        CHECK_LT(size_t(item.patch), page->patches.size());
        if (settings.show == Show::kScalar && page->layout.scalars > 0) {
            CHECK_EQ(page->layout.scalars, uint32_t(settings.scalar_count));
            CHECK_LT(settings.scalar_index, settings.scalar_count);
        }
        const StoredPatch& patch = page->patches[item.patch];
        if (patch.indices == 0) continue;
        const bool culled = item.one_sided && !settings.two_sided;
        queue.push_back({DrawGroup{culled, patch.wide, page->layout}.key(), i, page});
        statistics.triangles += patch.indices / 3;
    }
    statistics.patches += queue.size();
    std::sort(queue.begin(), queue.end(), [](const QueuedDraw& a, const QueuedDraw& b) {
        return a.group != b.group ? a.group < b.group : a.item < b.item;
    });
}

DrawRecord GlRenderer::State::recordOf(const DrawPatch& item, const QueuedDraw& draw) const {
    const bool both_sides = settings.two_sided || !item.one_sided;
    return {draw.patch(item).corner - projection->origin, both_sides ? DrawRecord::kBothSides : 0,
            patchColour(settings, item.id, item.tint, item.value, draw.page->layout.colours),
            item.id};
}

void GlRenderer::State::bindGroup(const DrawGroup& group) {
    const Look look = lookOf(settings.show, group.layout);
    glUseProgram(programs[samples == 4][size_t(look)]);
    (group.culled ? glEnable : glDisable)(GL_CULL_FACE);
    const auto bind = [&](GLuint attribute, uint32_t offset) {
        glVertexArrayVertexBuffer(vertex_array, attribute, pages.buffer(), GLintptr(offset),
                                  GLsizei(group.layout.stride()));
    };
    const auto bindOptional = [&](GLuint attribute, bool used, uint32_t offset) {
        if (used) bind(attribute, offset);
        (used ? glEnableVertexArrayAttrib : glDisableVertexArrayAttrib)(vertex_array, attribute);
    };
    bind(kPosition, 0);
    bindOptional(kColour, usesColours(look), VertexLayout::kColourOffset);
    bindOptional(kScalar, look == Look::kLitScalar,
                 group.layout.scalarOffset() + 4 * uint32_t(settings.scalar_index));
}

/// The patch's box with room around it for what rounding moves: 1/64 pixel, and a lattice unit.
CullRecord GlRenderer::State::boxOf(const StoredPatch& patch) const {
    const Vec3f low(patch.corner - projection->origin), size(patch.extent);
    const Vec3f& forward = projection->forward;
    float nearest = 0, farthest = 0;
    for (int k = 0; k < 3; ++k) {
        const float a = low[k] * forward[k], b = (low[k] + size[k]) * forward[k];
        nearest += std::min(a, b);
        farthest += std::max(a, b);
    }
    const auto room = int32_t(std::max(farthest, 0.0f) * frame.inv_focal / 64) + 2;
    // Near the eye, which may be inside, the faces are cut away: no test. What is behind it is not
    // in sight.
    const bool always = nearest < 4.0f * float(room) && farthest > -4.0f * float(room);
    return {patch.corner - projection->origin - room,
            uint32_t(patch.indexBegin() / OcclusionCuller::kSlotBytes), patch.extent + 2 * room,
            always};
}

void GlRenderer::State::provideBoxes(std::span<const DrawPatch> items,
                                     std::span<const QueuedDraw> chunk) {
    const RingSpace space = ring.take(chunk.size() * sizeof(CullRecord), 256);
    for (size_t i = 0; i < chunk.size(); ++i) {
        const CullRecord record = boxOf(chunk[i].patch(items[chunk[i].item]));
        std::memcpy(space.memory + i * sizeof(record), &record, sizeof(record));
    }
    glBindBufferRange(GL_SHADER_STORAGE_BUFFER, kCullBinding, ring.buffer(), space.offset,
                      GLsizeiptr(chunk.size() * sizeof(CullRecord)));
}

/// A call for each group of draws.
void GlRenderer::State::drawCommands(std::span<const DrawPatch> items,
                                     std::span<const QueuedDraw> chunk, GLuint buffer,
                                     GLintptr offset) {
    glBindVertexArray(vertex_array);
    glBindBuffer(GL_DRAW_INDIRECT_BUFFER, buffer);
    for (size_t begin = 0, end = 0; begin < chunk.size(); begin = end) {
        const QueuedDraw& first = chunk[begin];
        while (end < chunk.size() && chunk[end].group == first.group) ++end;
        const bool wide = first.patch(items[first.item]).wide;
        const bool culled = items[first.item].one_sided && !settings.two_sided;
        bindGroup({culled, wide, first.page->layout});
        glMultiDrawElementsIndirect(
            GL_TRIANGLES, wide ? GL_UNSIGNED_INT : GL_UNSIGNED_SHORT,
            reinterpret_cast<const void*>(offset + GLintptr(begin * sizeof(DrawCommand))),
            GLsizei(end - begin), 0);
    }
}

/// The lists of `chunk` through the ring, and the calls that draw by them.
void GlRenderer::State::submit(std::span<const DrawPatch> items, std::span<const QueuedDraw> chunk,
                               bool cull) {
    const RingSpace block = ring.take(sizeof(FrameBlock), 256);
    const RingSpace records = ring.take(chunk.size() * sizeof(DrawRecord), 256);
    const RingSpace commands = ring.take(chunk.size() * sizeof(DrawCommand), 256);
    std::memcpy(block.memory, &frame, sizeof(frame));
    for (size_t i = 0; i < chunk.size(); ++i) {
        const DrawPatch& item = items[chunk[i].item];
        const StoredPatch& patch = chunk[i].patch(item);
        const DrawRecord record = recordOf(item, chunk[i]);
        const DrawCommand command{patch.indices, 1, patch.first_index, patch.base_vertex,
                                  uint32_t(i)};
        std::memcpy(records.memory + i * sizeof(record), &record, sizeof(record));
        std::memcpy(commands.memory + i * sizeof(command), &command, sizeof(command));
    }
    glBindBufferRange(GL_UNIFORM_BUFFER, kFrameBinding, ring.buffer(), block.offset,
                      sizeof(FrameBlock));
    glBindBufferRange(GL_SHADER_STORAGE_BUFFER, kDrawsBinding, ring.buffer(), records.offset,
                      GLsizeiptr(chunk.size() * sizeof(DrawRecord)));
    if (cull) {
        glBindBufferRange(GL_SHADER_STORAGE_BUFFER, kCommandsBinding, ring.buffer(),
                          commands.offset, GLsizeiptr(chunk.size() * sizeof(DrawCommand)));
        provideBoxes(items, chunk);
        culler.begin(chunk.size());
        drawCommands(items, chunk, culler.seen(), 0);
        culler.end(chunk.size(), hidden != nullptr);
        drawCommands(items, chunk, culler.found(), 0);
        if (hidden != nullptr) {
            const std::vector<uint8_t> drawn = culler.drawn(chunk.size());
            for (size_t i = 0; i < chunk.size(); ++i)
                if (!drawn[i]) hidden->push_back(items[chunk[i].item].id);
        }
    } else {
        drawCommands(items, chunk, ring.buffer(), commands.offset);
    }
    ring.used();
}

/// Their lists, and what aligning them may cost, fit the ring.
size_t GlRenderer::State::drawsAtATime() const {
    return (ring.largest() - 2048) /
           (sizeof(DrawRecord) + sizeof(DrawCommand) + sizeof(CullRecord));
}

void GlRenderer::State::drawInChunks(std::span<const DrawPatch> items, bool cull) {
    CHECK(drawing);
    enqueue(items);
    setState();
    const size_t chunk = drawsAtATime();
    const std::span<const QueuedDraw> all(queue);
    for (size_t begin = 0; begin < all.size(); begin += chunk)
        submit(items, all.subspan(begin, std::min(chunk, all.size() - begin)), cull);
}

void GlRenderer::State::finish() {
    if (!drawing) return;
    targets.finish(reference, settings.show == Show::kDepth, ring);
    glQueryCounter(timer[current_timer].end, GL_TIMESTAMP);
    timer[current_timer].running = true;
    leaveState();
    drawing = false;
}

GlRenderer::GlRenderer(const PictureSize& size, int samples, size_t vram_bytes) {
    if (vram_bytes < kLeastVramBytes)
        throw MemoryError(
            fmt::format("OpenGL needs {} of graphics memory", formatBytes(kLeastVramBytes)));
    while (glGetError() != GL_NO_ERROR) {  // of others
    }
    state_ = std::make_unique<State>(size, samples, vram_bytes);
}

GlRenderer::~GlRenderer() = default;

bool GlRenderer::upload(PageKey key, std::span<const Mesh> patches) {
    State& s = *state_;
    const bool done = s.pages.upload(key, patches);
    s.statistics.upload_bytes = s.pages.uploadedBytes() - s.uploaded_before;
    return done;
}

void GlRenderer::release(PageKey key) {
    state_->pages.release(key);
}

bool GlRenderer::holds(PageKey key) const {
    return state_->pages.find(key) != nullptr;
}

/// note: what is larger than half of the ring may have to wait for itself.
bool GlRenderer::mayUpload(size_t bytes) {
    return state_->ring.room() >= std::min(bytes, 4 * state_->ring.largest());
}

size_t GlRenderer::usedBytes() const {
    return state_->pages.used();
}

size_t GlRenderer::capacityBytes() const {
    return state_->pages.capacity();
}

void GlRenderer::resize(const PictureSize& size, int samples) {
    state_->resize(size, samples);
}

void GlRenderer::begin(const View& view, const Lattice& lattice, const ShadeSettings& settings) {
    State& s = *state_;
    s.settings = settings;
    s.reference = kNearDepth / kDepthRoom * float(lattice.step);
    s.focal_px = view.focal_px();
    s.statistics.triangles = s.statistics.patches = s.statistics.upload_bytes = 0;
    s.uploaded_before = s.pages.uploadedBytes();
    s.setModel(view, lattice);
    s.beginTimer();
    s.targets.clear(settings);
    s.culler.nextPicture();
    s.drawing = true;
}

void GlRenderer::setModel(const View& view, const Lattice& lattice) {
    state_->setModel(view, lattice);
}

void GlRenderer::draw(std::span<const DrawPatch> patches) {
    state_->drawInChunks(patches, false);
}

void GlRenderer::drawUnhidden(std::span<const DrawPatch> patches, std::vector<uint32_t>* hidden) {
    state_->hidden = hidden;
    state_->drawInChunks(patches, true);
    state_->hidden = nullptr;
}

void GlRenderer::finish() {
    state_->finish();
}

void GlRenderer::wait() {
    state_->finish();
    glFinish();
    state_->readTimer(state_->timer[state_->current_timer]);
}

float GlRenderer::depthAt(int x, int y) {
    state_->finish();
    return state_->targets.depthAt(x, y);
}

void GlRenderer::lookBack(const Camera& camera) {
    State& s = *state_;
    CHECK_EQ(s.samples, 1);
    s.finish();
    s.seen.begin(camera, s.targets.size(), s.targets.finishedDepth());
}

const SeenDepth* GlRenderer::seen() {
    return state_->seen.latest();
}

Picture GlRenderer::readPicture() {
    State& s = *state_;
    s.finish();
    Picture picture;
    s.targets.read(picture);
    picture.focal_px = s.focal_px;
    return picture;
}

void GlRenderer::present() {
    state_->finish();
    state_->targets.present();
}

const GlStatistics& GlRenderer::statistics() const {
    return state_->statistics;
}

}  // namespace pietra
