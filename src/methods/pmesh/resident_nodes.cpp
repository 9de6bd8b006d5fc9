#include "methods/pmesh/resident_nodes.h"

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "base/give_back.h"
#include "base/parallel.h"

namespace pietra::pmesh {

ResidentNodes::ResidentNodes(NodeForest forest, uint32_t most)
    : row_(std::move(forest.row)),
      state_(row_.size()),
      most_(std::min(most, uint32_t(row_.size()))) {
    mesh_.lattice = forest.lattice;
    mesh_.base_vertex = std::move(forest.base_vertex);
    mesh_.base_triangle = std::move(forest.base_triangle);
    mesh_.base_closed = std::move(forest.base_closed);
    mesh_.base_operation = std::move(forest.base_operation);
    mesh_.layout = forest.layout;
    mesh_.base_word = std::move(forest.base_word);
    // Memory that is not touched yet costs nothing, and nothing has to move later.
    mesh_.operation.reserve(size_t(most_) * kNodeSlots);
    mesh_.word.reserve(mesh_.operation.capacity() * wordsOfOne());
    mesh_.place_of_node.assign(row_.size(), ProgressiveMesh::kNotLoaded);
    for (NodeIndex n = 0; n < row_.size(); ++n)
        if (row_[n].parent == kNoNode) {
            state_[n].is_pinned = true;
            CHECK(arrive(n, forest.node[n]));
        }
}

Reference ResidentNodes::referenceTo(OperationId id) const {
    const NodeIndex n = nodeOf(id), parent = row_[n].parent;
    const auto& levels = reference_level_[mesh_.place_of_node[parent]];
    const size_t side = row_[parent].child[0] == n ? 0 : 1;
    return {levels[side][slotIn(id)], row_[n].radius, row_[n].error, row_[n].centre};
}

/// Nodes whose operations are applied: of each vertex the one that made it, and its last one. Done
/// only when it matters.
void ResidentNodes::pin() {
    if (unpinned_ == nullptr) return;
    const ActiveMesh& mesh = *std::exchange(unpinned_, nullptr);
    for (NodeIndex n = 0; n < row_.size(); ++n) state_[n].is_pinned = row_[n].parent == kNoNode;
    const auto base = uint32_t(mesh_.base_vertex.size());
    const auto pinNodeOf = [&](OperationId o) {
        const std::atomic_ref pinned(state_[nodeOf(o)].is_pinned);
        if (!pinned.load(std::memory_order_relaxed)) pinned.store(true, std::memory_order_relaxed);
    };
    parallelForSlices(mesh.vertexCount(), 4096, [&](size_t begin, size_t end) {
        for (size_t v = begin; v < end; ++v) {
            if (mesh.pulse[v].name >= base) pinNodeOf(mesh.pulse[v].name - base);
            if (mesh.record[v].last != kNoOperation) pinNodeOf(mesh.record[v].last);
        }
    });
    // Rows lie parents before children.
    for (NodeIndex n = NodeIndex(row_.size()); n-- > 0;)
        if (state_[n].is_pinned) {
            state_[n].last_used = frame_;
            if (row_[n].parent != kNoNode) state_[row_[n].parent].is_pinned = true;
        }
}

void ResidentNodes::note(const Adaption& adaption) {
    ++frame_;
    victims_.reset();
    unpinned_ = &adaption.mesh();
    std::vector<NodeIndex> asked;
    for (const Adaption::Waiting& w : adaption.waiting()) {
        const NodeIndex n = nodeOf(w.operation);
        if (isLoaded(n)) {
            state_[n].last_used = frame_;
        } else if (!state_[n].is_bad) {
            asked.push_back(n);
        }
    }
    std::sort(asked.begin(), asked.end());
    asked.erase(std::unique(asked.begin(), asked.end()), asked.end());
    for (const NodeIndex n : asked_)
        if (!std::binary_search(asked.begin(), asked.end(), n)) state_[n].asked = 0;
    for (const NodeIndex n : asked) ++state_[n].asked;
    asked_ = std::move(asked);
    constexpr uint32_t kFramesUnpinned = 16;  // else what is in use looks as if it were not
    if (frame_ % kFramesUnpinned == 0) pin();
}

size_t ResidentNodes::required() {
    pin();
    size_t required = 0;
    for (NodeIndex n = 0; n < row_.size(); ++n) required += state_[n].last_used == frame_;
    for (const NodeIndex n : asked_) required += state_[n].last_used != frame_;
    return required;
}

std::vector<NodeIndex> ResidentNodes::requests(size_t most) const {
    std::vector<NodeIndex> nodes;
    for (const NodeIndex n : asked_)
        if (!isLoaded(n) && !state_[n].is_bad) nodes.push_back(n);
    std::stable_sort(nodes.begin(), nodes.end(),
                     [&](NodeIndex a, NodeIndex b) { return state_[a].asked > state_[b].asked; });
    nodes.resize(std::min(most, nodes.size()));
    return nodes;
}

std::vector<NodeIndex> ResidentNodes::prefetch(const Criterion& criterion, size_t most) {
    std::vector<NodeIndex> nodes;
    size_t room = most_ - std::min<size_t>(most_, loaded());
    for (NodeIndex n = 0; n < row_.size(); ++n)
        room += isLoaded(n) && state_[n].last_used + kFramesKept < frame_;
    std::vector<uint8_t> is_there(row_.size());
    for (NodeIndex n = 0; n < row_.size() && nodes.size() < std::min(most, room); ++n) {
        const NodeRow& row = row_[n];
        is_there[n] = isLoaded(n);
        if (is_there[n] || state_[n].is_bad || !is_there[row.parent] ||
            !criterion.needs(row.centre, row.error, row.radius, NormalBox().word()))
            continue;
        is_there[n] = 1;
        nodes.push_back(n);
    }
    return nodes;
}

bool ResidentNodes::evictOldest() {
    if (!victims_) {
        pin();
        victims_.emplace();
        for (NodeIndex n = 0; n < row_.size(); ++n)
            if (mayLeave(n)) victims_->push_back(n);
        std::stable_sort(victims_->begin(), victims_->end(), [&](NodeIndex a, NodeIndex b) {
            return state_[a].last_used > state_[b].last_used;
        });
    }
    while (!victims_->empty()) {
        const NodeIndex n = victims_->back();
        victims_->pop_back();
        if (mayLeave(n) && evict(n)) return true;
    }
    return false;
}

bool ResidentNodes::makeRoom() {
    while (loaded() >= most_)
        if (!evictOldest()) return false;
    return true;
}

bool ResidentNodes::arrive(NodeIndex index, const OperationNode& node) {
    const NodeIndex parent = row_[index].parent;
    if (isLoaded(index) || (parent != kNoNode && !isLoaded(parent))) return false;
    if (parent != kNoNode) {
        const size_t side = row_[parent].child[0] == index ? 0 : 1;
        const auto& levels = reference_level_[mesh_.place_of_node[parent]][side];
        if (levels.size() != node.frontier) return giveUp(index), false;
    }
    if (!makeRoom()) return false;
    const auto place = uint32_t(loaded());
    mesh_.place_of_node[index] = place;
    mesh_.operation.resize(size_t(place + 1) * kNodeSlots);
    for (size_t s = 0; s < node.operation.size(); ++s)
        mesh_.operation[size_t(place) * kNodeSlots + s] =
            toOperation(index, row_[index], node.operation[s]);
    mesh_.word.resize(mesh_.operation.size() * wordsOfOne());
    std::ranges::copy(node.word, mesh_.word.end() - ptrdiff_t(kNodeSlots * wordsOfOne()));
    reference_level_.push_back(node.reference_level);
    node_at_.push_back(index);
    most_at_a_time_ = std::max(most_at_a_time_, loaded());
    if (parent != kNoNode) ++state_[parent].loaded_children;
    state_[index].asked = 0;
    state_[index].last_used = frame_;
    return true;
}

bool ResidentNodes::evict(NodeIndex index) {
    pin();
    State& s = state_[index];
    if (!isLoaded(index) || s.is_pinned || s.loaded_children > 0) return false;
    const uint32_t place = mesh_.place_of_node[index];
    if (const size_t last = loaded() - 1; place != last) {
        std::copy_n(&mesh_.operation[last * kNodeSlots], kNodeSlots,
                    &mesh_.operation[size_t(place) * kNodeSlots]);
        const size_t words = kNodeSlots * wordsOfOne();
        std::copy_n(mesh_.word.begin() + ptrdiff_t(last * words), words,
                    mesh_.word.begin() + ptrdiff_t(place * words));
        std::swap(reference_level_[place], reference_level_[last]);
        node_at_[place] = node_at_[last];
        mesh_.place_of_node[node_at_[place]] = place;
    }
    node_at_.pop_back();
    reference_level_.pop_back();
    mesh_.operation.resize(loaded() * kNodeSlots);
    mesh_.word.resize(mesh_.operation.size() * wordsOfOne());
    mesh_.place_of_node[index] = ProgressiveMesh::kNotLoaded;
    --state_[row_[index].parent].loaded_children;
    return true;
}

void ResidentNodes::giveBack() {
    giveBackBehind(mesh_.operation);
    giveBackBehind(mesh_.word);
    most_at_a_time_ = loaded();
}

}  // namespace pietra::pmesh
