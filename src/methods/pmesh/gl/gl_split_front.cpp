#include "methods/pmesh/gl/gl_split_front.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <string>

#include "base/check.h"
#include "base/error.h"
#include "methods/pmesh/gl/shader_text.h"

namespace pietra::pmesh {
namespace {

constexpr uint32_t kNone = ~0u;
// As in split_state.glsl and split_index.comp.glsl.
enum Column : uint32_t {
    kBirth = 0,
    kNext = 5,
    kFirst = 10,
    kSplit,
    kMade,
    kLast,
    kParent,
    kDrawn = 15,
    kMerged = 19,
    kLeaf = 23,
    kState = 29,
    kWords = 30
};
constexpr uint32_t kAlive = 1, kIsClosed = 4;
constexpr uint32_t kLists = 5, kPart = 1024;
constexpr uint32_t kCriterionWords = 5;
static_assert(sizeof(NestedCriterion) == 18);

void putCriterion(const NestedCriterion& c, uint32_t* word) {
    const auto pair = [](uint32_t low, uint32_t high) { return low | high << 16; };
    const uint32_t normals = c.normals.bits();
    word[0] = pair(c.min[0], c.min[1]);
    word[1] = pair(c.min[2], c.max[0]);
    word[2] = pair(c.max[1], c.max[2]);
    word[3] = pair(c.error, normals & 0xffff);
    word[4] = normals >> 16;
}

NestedCriterion criterionOf(const std::array<uint32_t, kCriterionWords>& w) {
    NestedCriterion c;
    c.min = {uint16_t(w[0]), uint16_t(w[0] >> 16), uint16_t(w[1])};
    c.max = {uint16_t(w[1] >> 16), uint16_t(w[2]), uint16_t(w[2] >> 16)};
    c.error = uint16_t(w[3]);
    c.normals = NormalBox::ofBits(w[3] >> 16 | w[4] << 16);
    return c;
}

GlBuffer makeBuffer(size_t bytes) {
    GLuint name = 0;
    glCreateBuffers(1, &name);
    GlBuffer buffer(name);
    while (glGetError() != GL_NO_ERROR) {
    }
    GLint64 most = 0;
    glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most);
    if (bytes <= size_t(most))
        glNamedBufferStorage(name, GLsizeiptr(std::max<size_t>(bytes, 16)), nullptr,
                             GL_DYNAMIC_STORAGE_BIT);
    if (bytes > size_t(most) || glGetError() == GL_OUT_OF_MEMORY)
        throw MemoryError(fmt::format("the GPU has no {} MiB in one piece", bytes >> 20));
    const GLuint zero = 0;
    glClearNamedBufferData(name, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
    return buffer;
}

void write(GLuint buffer, size_t word, const void* data, size_t words) {
    if (words > 0)
        glNamedBufferSubData(buffer, GLintptr(word * sizeof(uint32_t)),
                             GLsizeiptr(words * sizeof(uint32_t)), data);
}

std::vector<uint32_t> read(GLuint buffer, size_t word, size_t words) {
    std::vector<uint32_t> data(words);
    if (words > 0)
        glGetNamedBufferSubData(buffer, GLintptr(word * sizeof(uint32_t)),
                                GLsizeiptr(words * sizeof(uint32_t)), data.data());
    return data;
}

uint32_t rootsOf(const ResidentSplits& nodes) {
    return uint32_t(nodes.forest().base.root.size());
}

}  // namespace

/// As in split_state.glsl.
struct GlSplitFront::State {
    uint32_t slots, is_free, taken, dropped, queued[2], splits, merges;
    int32_t triangles;
};

/// As in split_state.glsl.
struct GlSplitFront::Frame {
    std::array<float, 4> eye;
    std::array<std::array<float, 4>, 4> side;
    uint32_t hides_backs, blockings, capacity, leaf_words, words, at_split_words;
    std::array<uint32_t, 2> unused{};
};

GlSplitFront::GlSplitFront(const ResidentSplits& nodes, uint32_t most_nodes, uint32_t groups)
    : nodes_(nodes),
      groups_(groups),
      most_nodes_(std::min(most_nodes, uint32_t(nodes.forest().row.size()))),
      leaf_words_((nodes.leaves() + 31) / 32),
      words_(nodes.forest().layout.words()),
      capacity_(std::min(nodes.leaves(), rootsOf(nodes) + most_nodes_ * kSplitSlots)),
      place_(nodes.forest().row.size(), kNone) {
    makePrograms();
    const size_t vertices = capacity_;
    state_ = makeBuffer(sizeof(State));
    vertex_ = makeBuffer(vertices * (kWords + 2 * words_) * sizeof(uint32_t));
    // A criterion's last half word is read with the one behind it.
    split_ = makeBuffer(size_t(most_nodes_) * kSplitSlots *
                            (sizeof(ResidentSplit) + 2 * words_ * sizeof(uint32_t)) +
                        sizeof(uint32_t));
    leaf_ = makeBuffer((2 * size_t(leaf_words_) + (leaf_words_ + kPart - 1) / kPart) *
                       sizeof(uint32_t));
    list_ = makeBuffer(vertices * kLists * sizeof(uint32_t));
    frame_ = makeBuffer(sizeof(Frame));
    std::vector<uint32_t> node;
    for (const SplitRow& row : nodes.forest().row)
        node.insert(node.end(), {kNone, row.child[0], row.child[1]});
    node_ = makeBuffer(node.size() * sizeof(uint32_t));
    write(node_, 0, node.data(), node.size());
    for (uint32_t p = most_nodes_; p-- > 0;) free_places_.push_back(p);
    uploadRoots();
}

void GlSplitFront::makePrograms() {
    const std::string defines = fmt::format("#define OUTSIDE {:.1f}\n#define HIDDEN {:.1f}\n",
                                            SplitView::kOutside, SplitView::kHidden);
    const auto make = [&](std::initializer_list<std::string_view> files) {
        return makeProgram(splitText, {{GL_COMPUTE_SHADER, files}}, defines);
    };
    books_ = make({"split_state.glsl", "split_books.comp.glsl"});
    decide_ = make({"split_state.glsl", "split_needs.glsl", "split_decide.comp.glsl"});
    merge_ = make({"split_state.glsl", "split_merge.comp.glsl"});
    clear_ = make({"split_state.glsl", "split_clear.comp.glsl"});
    apply_ = make({"split_state.glsl", "split_needs.glsl", "split_apply.comp.glsl"});
    index_ = make({"split_state.glsl", "split_index.comp.glsl"});
    arrive_ = make({"split_state.glsl", "split_needs.glsl", "split_arrive.comp.glsl"});
}

void GlSplitFront::uploadRoots() {
    const SplitBase& base = nodes_.forest().base;
    const size_t count = base.root.size();
    std::vector<uint32_t> column((kWords + words_) * count), bits(leaf_words_), order(count);
    const auto at = [&](uint32_t c, size_t r) -> uint32_t& { return column[c * count + r]; };
    Leaf first = 0;
    for (size_t r = 0; r < count; ++r) {
        const SplitBase::Root& root = base.root[r];
        NestedCriterion ever, next;
        ever.error = NestedCriterion::kEver;
        if (root.split != kNoSplit) next = nodes_.rootCriterion(root.split);
        std::array<uint32_t, kCriterionWords> birth_words, next_words;
        putCriterion(ever, birth_words.data());
        putCriterion(next, next_words.data());
        for (uint32_t k = 0; k < kCriterionWords; ++k)
            at(kBirth + k, r) = birth_words[k], at(kNext + k, r) = next_words[k];
        at(kFirst, r) = first;
        at(kSplit, r) = root.split;
        at(kMade, r) = kNoSplit;
        at(kLast, r) = at(kParent, r) = kNoLeaf;
        for (int k = 0; k < 3; ++k) at(kDrawn + uint32_t(k), r) = uint32_t(root.vertex.position[k]);
        at(kDrawn + 3, r) = root.vertex.normal;
        at(kState, r) = kAlive;
        for (uint32_t k = 0; k < words_; ++k) at(kWords + k, r) = base.word[r * words_ + k];
        bits[first / 32] |= 1u << first % 32;
        order[r] = uint32_t(r);
        first += root.leaves;
    }
    for (uint32_t c = 0; c < kWords + words_; ++c)
        write(vertex_, size_t(c) * capacity_, &column[c * count], count);
    std::vector<uint32_t> before(leaf_words_);
    for (size_t w = 1; w < before.size(); ++w)
        before[w] = before[w - 1] + uint32_t(std::popcount(bits[w - 1]));
    write(leaf_, 0, bits.data(), bits.size());
    write(leaf_, leaf_words_, before.data(), before.size());
    write(list_, 0, order.data(), order.size());
    State state{};
    state.slots = uint32_t(count);
    state.triangles = int32_t(base.triangle.size());
    write(state_, 0, &state, sizeof(State) / sizeof(uint32_t));
    vertices_ = count;
    triangles_ = base.triangle.size();
}

void GlSplitFront::uploadNode(NodeIndex n) {
    const size_t first = size_t(place_[n]) * kSplitSlots, count = nodes_.forest().row[n].splits;
    constexpr size_t kSplitWords = sizeof(ResidentSplit) / sizeof(uint32_t);
    if (count == 0) return;
    write(split_, first * kSplitWords, &nodes_.at(splitId(n, 0)), count * kSplitWords);
    if (words_ > 0)
        write(split_, size_t(most_nodes_) * kSplitSlots * kSplitWords + first * 2 * words_,
              nodes_.wordsOf(splitId(n, 0)), count * 2 * words_);
}

/// The GPU has the nodes that are loaded. One that arrives changes what its parent states.
void GlSplitFront::mirrorNodes() {
    const auto place = [&](NodeIndex n, uint32_t p) {
        place_[n] = p;
        write(node_, 3 * size_t(n), &p, 1);
    };
    std::erase_if(mirrored_, [&](NodeIndex n) {
        if (nodes_.isLoaded(n)) return false;
        free_places_.push_back(place_[n]);
        place(n, kNone);
        return true;
    });
    std::vector<NodeIndex> changed;
    for (const NodeIndex n : nodes_.loadedNodes()) {
        if (place_[n] != kNone) continue;
        CHECK(!free_places_.empty());
        place(n, free_places_.back());
        free_places_.pop_back();
        mirrored_.push_back(n);
        changed.push_back(n);
        if (const NodeIndex parent = nodes_.forest().row[n].parent; parent != kNoNode)
            changed.push_back(parent);
    }
    std::sort(changed.begin(), changed.end());
    changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
    for (const NodeIndex n : changed) uploadNode(n);
}

void GlSplitFront::bind(const SplitView& view) {
    const std::vector<NestedCriterion> blocking = nodes_.blocking();
    std::vector<uint32_t> words(blocking.size() * kCriterionWords);
    for (size_t i = 0; i < blocking.size(); ++i)
        putCriterion(blocking[i], &words[i * kCriterionWords]);
    blocking_ = makeBuffer(words.size() * sizeof(uint32_t));
    write(blocking_, 0, words.data(), words.size());
    Frame frame{};
    for (size_t k = 0; k < 3; ++k) frame.eye[k] = view.eye[k];
    frame.eye[3] = view.reach;
    for (size_t i = 0; i < 4; ++i)
        frame.side[i] = {view.side[i][0], view.side[i][1], view.side[i][2], view.at_eye[i]};
    frame.hides_backs = view.hides_backs;
    frame.blockings = uint32_t(blocking.size());
    frame.capacity = capacity_;
    frame.leaf_words = leaf_words_;
    frame.words = words_;
    frame.at_split_words =
        uint32_t(size_t(most_nodes_) * kSplitSlots * sizeof(ResidentSplit) / sizeof(uint32_t));
    write(frame_, 0, &frame, sizeof(Frame) / sizeof(uint32_t));
    const GLuint buffers[] = {state_, vertex_, split_, node_, leaf_, list_, blocking_};
    glBindBuffersBase(GL_SHADER_STORAGE_BUFFER, 0, GLsizei(std::size(buffers)), buffers);
    glBindBufferBase(GL_UNIFORM_BUFFER, 0, frame_);
}

void GlSplitFront::run(GLuint program, uint32_t argument, uint32_t groups) {
    glUseProgram(program);
    glUniform1ui(0, argument);
    glDispatchCompute(groups, 1, 1);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

GlSplitFront::State GlSplitFront::told() const {
    State state;
    glGetNamedBufferSubData(state_, 0, sizeof(State), &state);
    return state;
}

SplitCounts GlSplitFront::adapt(const SplitView& view) {
    CHECK(view.occlusion == nullptr);
    mirrorNodes();
    bind(view);
    run(books_, 0, 1);
    run(decide_, 0, groups_);
    run(merge_, 0, groups_);
    run(clear_, 0, groups_);
    run(books_, 3, 1);
    // An even number, so that the first queue is the next one again.
    constexpr uint32_t kRounds = 8;
    SplitCounts counts;
    do {
        for (uint32_t r = 0; r < kRounds; ++r) {
            run(apply_, r % 2, groups_);
            run(books_, 1 + r % 2, 1);
        }
        counts.rounds += kRounds;
    } while (told().queued[0] > 0);
    run(books_, 4, 1);
    for (uint32_t step = 0; step < 4; ++step) run(index_, step, step == 1 ? 1 : groups_);
    const State state = told();
    counts.splits = state.splits;
    counts.merges = state.merges;
    vertices_ = vertices_ + counts.splits - counts.merges;
    triangles_ = size_t(state.triangles);
    return counts;
}

void GlSplitFront::arrived(std::span<const ResidentSplits::Arrived> arrived) {
    constexpr size_t kEach = 2 + kCriterionWords;
    std::vector<uint32_t> words(arrived.size() * kEach);
    for (size_t i = 0; i < arrived.size(); ++i) {
        words[i * kEach] = arrived[i].first;
        words[i * kEach + 1] = arrived[i].split;
        putCriterion(arrived[i].criterion, &words[i * kEach + 2]);
    }
    if (words.empty()) return;
    bind(SplitView());
    blocking_ = makeBuffer(words.size() * sizeof(uint32_t));
    write(blocking_, 0, words.data(), words.size());
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 6, blocking_);
    run(arrive_, uint32_t(arrived.size()), groups_);
}

std::vector<ActiveVertex> GlSplitFront::download() const {
    const std::vector<uint32_t> all = read(vertex_, 0, size_t(capacity_) * kWords);
    const std::vector<uint32_t> order = read(list_, 0, vertices_);
    std::vector<ActiveVertex> vertices;
    for (const uint32_t slot : order) {
        const auto at = [&](uint32_t c) { return all[size_t(c) * capacity_ + slot]; };
        const auto criterion = [&](uint32_t c) {
            return criterionOf({at(c), at(c + 1), at(c + 2), at(c + 3), at(c + 4)});
        };
        const auto drawn = [&](uint32_t c) {
            return SplitVertex{{int32_t(at(c)), int32_t(at(c + 1)), int32_t(at(c + 2))},
                               uint16_t(at(c + 3))};
        };
        ActiveVertex& v = vertices.emplace_back();
        v.birth = criterion(kBirth), v.next = criterion(kNext);
        v.first = at(kFirst), v.last = at(kLast), v.parent = at(kParent);
        v.split = at(kSplit), v.made = at(kMade);
        v.vertex = drawn(kDrawn), v.merged = drawn(kMerged);
        for (uint32_t k = 0; k < 6; ++k) v.leaf[k] = at(kLeaf + k);
        v.closed = (at(kState) & kIsClosed) != 0;
    }
    return vertices;
}

std::vector<uint32_t> GlSplitFront::downloadWords() const {
    std::vector<uint32_t> words;
    const std::vector<uint32_t> order = read(list_, 0, vertices_);
    const std::vector<uint32_t> all =
        read(vertex_, size_t(capacity_) * kWords, size_t(capacity_) * words_);
    for (const uint32_t slot : order)
        for (uint32_t k = 0; k < words_; ++k) words.push_back(all[size_t(k) * capacity_ + slot]);
    return words;
}

}  // namespace pietra::pmesh
