#include "methods/pmesh/gl/gl_adaption.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <string>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "methods/pmesh/gl/shader_text.h"

namespace pietra::pmesh {
namespace {

constexpr uint32_t kBlockBits = 8192, kResults = 256;  // of adaption_block.glsl

/// The same as in adaption_block.glsl.
struct Places {
    uint32_t base_vertices, base_faces;
    uint32_t vertex_mask, face_mask;
    uint32_t marked, may_split, to_merge, is_released;
    uint32_t split_blocks, merge_blocks, blocks;
    uint32_t fresh, capacity;
    uint32_t may_merge, released;
    uint32_t splits, merges, result;
    uint32_t result_vertices, result_faces;
    uint32_t free_vertices, free_faces;
    uint32_t gone, gone_blocks_at, hole_blocks_at;
    uint32_t from, to, rank;
    uint32_t result_blocks, face_capacity, gone_blocks, hole_blocks;
};

/// The same as in criterion.glsl.
struct CriterionBlock {
    std::array<int32_t, 4> eye;
    std::array<std::array<int32_t, 4>, 4> side;
    std::array<int32_t, 256> reach;
    uint32_t hides_backs;
    std::array<uint32_t, 3> unused{};
};

/// An operation as the shaders have it.
struct PackedOperation {
    std::array<uint32_t, 2> child;
    uint16_t level, radius;
    uint8_t error, ranks, shift, unused = 0;
    std::array<std::array<int8_t, 3>, 2> delta;
    uint16_t radius_around_u;
    std::array<uint16_t, 2> normal;
    uint32_t box_of_normals;
};
static_assert(sizeof(PackedOperation) == 32);

PackedOperation packed(const Operation& o) {
    return {o.child, o.level, o.radius,         o.error,  o.ranks,         o.shift,
            0,       o.delta, radiusAroundU(o), o.normal, o.normals.word()};
}

GlBuffer makeBuffer(size_t bytes, const void* data = nullptr, GLbitfield flags = 0) {
    GLuint name = 0;
    glCreateBuffers(1, &name);
    GlBuffer buffer(name);
    while (glGetError() != GL_NO_ERROR) {
    }
    glNamedBufferStorage(name, GLsizeiptr(std::max<size_t>(bytes, 16)), data, flags);
    if (glGetError() == GL_OUT_OF_MEMORY)
        throw MemoryError(fmt::format("the GPU has no {} MiB", bytes >> 20));
    const GLuint zero = 0;
    if (data == nullptr)
        glClearNamedBufferData(name, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
    return buffer;
}

template <class T>
void write(GLuint buffer, const std::vector<T>& elements) {
    if (!elements.empty())
        glNamedBufferSubData(buffer, 0, GLsizeiptr(elements.size() * sizeof(T)), elements.data());
}

template <class T>
void read(GLuint buffer, std::vector<T>& elements) {
    if (!elements.empty())
        glGetNamedBufferSubData(buffer, 0, GLsizeiptr(elements.size() * sizeof(T)),
                                elements.data());
}

}  // namespace

/// The same as in adaption_block.glsl.
struct GlAdaption::State {
    uint32_t vertices, faces;
    uint32_t covered;
    uint32_t free_vertex_head, free_vertices, free_face_head, free_faces;
    std::array<uint32_t, 2> fresh;
    uint32_t may_merge, released;
    uint32_t splits, merges;
    uint32_t is_woken, is_evaluated;
    uint32_t freed_vertices, freed_faces;
    uint32_t all_splits, all_merges, passes;
    uint32_t kept_vertices, kept_faces;
    uint32_t to_vertices, to_faces;
    std::array<int32_t, 6> box;
};

GlAdaption::GlAdaption(const ProgressiveMesh& mesh, uint32_t groups) : groups_(groups) {
    makePrograms();
    makePlaces(mesh);
    upload(mesh);
}

void GlAdaption::makePrograms() {
    const auto make = [](const char* name, int group, std::initializer_list<std::string_view> files,
                         const char* access = "") {
        const std::string defines =
            fmt::format("#define GROUP {}\n#define WORK_ACCESS {}\n", group, access);
        return Step{name, makeProgram(adaptionText, {{GL_COMPUTE_SHADER, files}}, defines)};
    };
    scan_ = make("scan", 256, {"adaption_block.glsl", "criterion.glsl", "adaption_scan.comp.glsl"});
    look_ = make("look", 256,
                 {"adaption_block.glsl", "active_mesh.glsl", "criterion.glsl",
                  "adaption_force.glsl", "adaption_evaluate.glsl", "group_sums.glsl",
                  "adaption_free.glsl", "adaption_look.comp.glsl"});
    begin_ = make("begin", 1024,
                  {"adaption_block.glsl", "active_mesh.glsl", "adaption_force.glsl",
                   "adaption_books.glsl", "adaption_begin.comp.glsl"},
                  "coherent");
    evaluate_ = make("evaluate", 128,
                     {"adaption_block.glsl", "active_mesh.glsl", "criterion.glsl",
                      "adaption_evaluate.glsl", "adaption_evaluate.comp.glsl"});
    list_ =
        make("list", 256, {"adaption_block.glsl", "group_sums.glsl", "adaption_list.comp.glsl"});
    apply_ =
        make("apply", 64,
             {"adaption_block.glsl", "active_mesh.glsl", "active_star.glsl", "active_split.glsl",
              "active_merge.glsl", "criterion.glsl", "adaption_result.glsl", "adaption_split.glsl",
              "adaption_merge.glsl", "adaption_apply.comp.glsl"});
    sort_ = make(
        "sort", 256,
        {"adaption_block.glsl", "active_mesh.glsl", "group_sums.glsl", "adaption_sort.comp.glsl"});
    tidy_ = make("tidy", 256,
                 {"adaption_block.glsl", "active_mesh.glsl", "group_sums.glsl",
                  "adaption_books.glsl", "adaption_free.glsl", "adaption_tidy.comp.glsl"});
}

void GlAdaption::makePlaces(const ProgressiveMesh& mesh) {
    const auto roundUp = [](size_t x) { return (x + kBlockBits) / kBlockBits * kBlockBits; };
    const size_t vertices = roundUp(mesh.base_vertex.size() + mesh.operation.size());
    const size_t faces = roundUp(mesh.base_triangle.size() + 2 * mesh.operation.size());
    CHECK(faces < size_t(1) << 30);
    vertex_capacity_ = uint32_t(vertices);
    face_capacity_ = uint32_t(std::max(vertices, faces));

    Places p{};
    size_t end = 0;
    const auto room = [&](size_t words) {
        const size_t begin = end;
        end += (words + 63) / 64 * 64;
        return uint32_t(begin);
    };
    const uint32_t v = vertex_capacity_, f = face_capacity_;
    p.base_vertices = uint32_t(mesh.base_vertex.size());
    p.base_faces = uint32_t(mesh.base_triangle.size());
    p.vertex_mask = std::bit_ceil(v) - 1, p.face_mask = std::bit_ceil(f) - 1;
    for (uint32_t* set : {&p.marked, &p.may_split, &p.to_merge, &p.is_released})
        *set = room(v / 32);
    p.blocks = v / kBlockBits;
    p.split_blocks = room(4 * p.blocks);
    p.merge_blocks = p.split_blocks + 2 * p.blocks;
    p.fresh = room(2 * size_t(v)), p.capacity = v;
    for (uint32_t* list : {&p.may_merge, &p.released, &p.splits, &p.merges}) *list = room(v);
    p.result = room(3 * size_t(v));
    p.result_blocks = v / kResults;
    p.result_vertices = room(p.result_blocks), p.result_faces = room(p.result_blocks);
    p.free_vertices = room(p.vertex_mask + 1), p.free_faces = room(p.face_mask + 1);
    p.face_capacity = f, p.gone_blocks = f / kBlockBits, p.hole_blocks = f / kResults;
    p.gone = room(2 * size_t(f) / 32);
    p.gone_blocks_at = room(2 * p.gone_blocks), p.hole_blocks_at = room(2 * p.hole_blocks);
    p.from = room(2 * size_t(f)), p.to = room(2 * size_t(f)), p.rank = room(f);
    CHECK(end <= ~0u);
    places_ = makeBuffer(sizeof p, &p);
    work_ = makeBuffer(4 * end);
}

void GlAdaption::upload(const ProgressiveMesh& mesh) {
    const ActiveMesh base(mesh);
    const GLbitfield flags = GL_DYNAMIC_STORAGE_BIT;
    vertex_ = makeBuffer(vertex_capacity_ * sizeof(Vertex), nullptr, flags);
    pulse_ = makeBuffer(vertex_capacity_ * sizeof(VertexPulse), nullptr, flags);
    criteria_ = makeBuffer(vertex_capacity_ * sizeof(VertexCriteria), nullptr, flags);
    record_ = makeBuffer(vertex_capacity_ * sizeof(VertexRecord), nullptr, flags);
    face_ = makeBuffer(face_capacity_ * sizeof(ActiveFace), nullptr, flags);
    write(vertex_, base.vertex);
    write(pulse_, base.pulse);
    write(criteria_, base.criteria);
    write(record_, base.record);
    write(face_, base.face);
    std::vector<PackedOperation> operations;
    operations.reserve(mesh.operation.size());
    for (const Operation& o : mesh.operation) operations.push_back(packed(o));
    operation_ = makeBuffer(operations.size() * sizeof(PackedOperation), operations.data());
    State state{};
    state.vertices = uint32_t(base.vertexCount());
    state.faces = uint32_t(base.faceCount());
    state_ = makeBuffer(sizeof state, &state);
    criterion_ = makeBuffer(sizeof(CriterionBlock), nullptr, flags);
    const GLbitfield mapped = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    told_ = makeBuffer(sizeof state, nullptr, mapped | GL_CLIENT_STORAGE_BIT);
    told_memory_ = static_cast<const State*>(glMapNamedBufferRange(told_, 0, sizeof state, mapped));
    CHECK(told_memory_ != nullptr);
    tell();
}

void GlAdaption::bind() {
    GLuint binding = 0;
    for (const GlBuffer* buffer : {&vertex_, &pulse_, &criteria_, &record_, &face_, &operation_,
                                   &state_, &work_, &criterion_})
        glBindBufferBase(GL_SHADER_STORAGE_BUFFER, binding++, *buffer);
    glBindBufferBase(GL_UNIFORM_BUFFER, 0, places_);
}

void GlAdaption::run(const Step& step, uint32_t pass, uint32_t argument, uint32_t groups) {
    glUseProgram(step.program);
    glUniform1ui(0, pass);
    glUniform1ui(1, argument);
    glDispatchCompute(groups, 1, 1);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    if (after_step) after_step(step.name);
}

void GlAdaption::sortInSpace() {
    run(sort_, 0, 0, groups_);
    run(sort_, 0, 1, groups_);
    for (uint32_t digit = 0; digit < 3; ++digit)
        for (uint32_t i = 2; i < 6; ++i) run(sort_, digit, i, groups_);
    for (uint32_t i = 6; i < 13; ++i) run(sort_, 0, i, groups_);
    for (uint32_t kind = 0; kind < 6; ++kind)
        for (uint32_t i = 13; i < 15; ++i) run(sort_, kind, i, groups_);
}

void GlAdaption::begin(const Criterion& criterion) {
    CHECK(!criterion.occlusion);  // it has not learnt that
    bind();
    wear_.add(lastCounts().operations());
    if (wear_.takeIfOver(size().vertices)) sortInSpace();
    CriterionBlock block{};
    block.reach = criterion.reach;
    block.hides_backs = criterion.hides_backs;
    for (int k = 0; k < 3; ++k) {
        block.eye[size_t(k)] = criterion.eye[k];
        for (size_t i = 0; i < 4; ++i) block.side[i][size_t(k)] = criterion.side[i][k];
    }
    glNamedBufferSubData(criterion_, 0, sizeof block, &block);
    run(scan_, 0, 0, groups_);
}

void GlAdaption::pass(uint32_t index, bool is_last) {
    run(look_, index, 0, groups_);
    run(begin_, index, 0, 1);
    if (is_last) run(evaluate_, index, 1, groups_);
    run(list_, index, is_last, groups_);
    run(apply_, index, 0, groups_);
    if (is_last) run(apply_, index, 1, groups_);
}

void GlAdaption::finish() {
    for (uint32_t i = 0; i < 6; ++i) run(tidy_, 0, i, i == 1 ? 1 : groups_);
    tell();
}

void GlAdaption::frame(const Criterion& criterion, int most_passes) {
    begin(criterion);
    for (int i = 0; i < most_passes; ++i) pass(uint32_t(i), i + 1 == most_passes);
    finish();
}

PassCounts GlAdaption::settle(const Criterion& criterion) {
    constexpr uint32_t kTogether = 8;
    begin(criterion);
    for (uint32_t i = 0;; ++i) {
        pass(i, false);
        if ((i + 1) % kTogether != 0) continue;
        tell();
        if (told().splits + told().merges == 0) break;
    }
    finish();
    return lastCounts();
}

/// Asks for the books as they are now.
void GlAdaption::tell() {
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
    glCopyNamedBufferSubData(state_, told_, 0, 0, sizeof(State));
    fence_ = GlFence(glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0));
}

/// What was asked for last.
const GlAdaption::State& GlAdaption::told() {
    while (glClientWaitSync(fence_, GL_SYNC_FLUSH_COMMANDS_BIT, GLuint64(1e9)) ==
           GL_TIMEOUT_EXPIRED) {
    }
    return *told_memory_;
}

PassCounts GlAdaption::lastCounts() {
    return {told().all_splits, told().all_merges, told().passes};
}

GlAdaption::Size GlAdaption::size() {
    return {told().vertices, told().faces};
}

void GlAdaption::download(ActiveMesh& mesh) {
    const Size count = size();
    mesh.resize(count.vertices, count.faces);
    read(vertex_, mesh.vertex);
    read(pulse_, mesh.pulse);
    read(criteria_, mesh.criteria);
    read(record_, mesh.record);
    read(face_, mesh.face);
}

}  // namespace pietra::pmesh
