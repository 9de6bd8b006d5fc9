#include "methods/pmesh/live_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/give_back.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "methods/pmesh/adaption.h"
#include "methods/pmesh/draw_chunks.h"
#include "methods/pmesh/model.h"
#include "methods/pmesh/node_codec.h"
#include "methods/pmesh/resident_nodes.h"

namespace pietra::pmesh {
namespace {

/// Of a pass: a millisecond or two, as time is looked at in between.
constexpr size_t kPassOperations = 2048;
/// Of a frame: more than any model needs, should a damaged one go back and forth.
constexpr int kMostPasses = 1 << 14;

struct NodePage : LivePage {
    OperationNode node;
};

/// Outside of the input's bounds the eye is outside of all closed parts, whatever is drawn of them.
Criterion criterionFor(const View& view, const ModelInfo& info, double pixels) {
    if (pixels <= 0) return criterionOf(-1.0, info.lattice);
    Criterion criterion = criterionOf(view, info.lattice, pixels);
    const Vec3d eye = view.eye();
    criterion.hides_backs = glm::any(glm::lessThan(eye, Vec3d(info.bounds.min))) ||
                            glm::any(glm::greaterThan(eye, Vec3d(info.bounds.max)));
    return criterion;
}

/// With its roots.
NodeForest openRoots(const ModelReader& reader) {
    NodeForest forest = openForest(reader);
    const auto damaged = [&](const std::string& what) {
        throw InputError(reader.path(), "", "the model is damaged: " + what);
    };
    const HalfEdges edges = findHalfEdges(forest.base_triangle, forest.base_vertex.size());
    for (size_t v = 0; v < forest.base_vertex.size(); ++v)
        if (forest.base_operation[v] != kNoOperation &&
            (edges.irregular[v] || edges.corner_of[v] == kNoCorner))
            damaged(fmt::format("base vertex {} splits, but its triangles are no fan", v));
    for (const Vertex& v : forest.base_vertex)
        if (std::max({v.x, v.y, v.z}) > kLatticeMax >> forest.lattice.shift)
            damaged("a base vertex is off the lattice");
    for (const Triangle& t : forest.base_triangle)
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) damaged("a base triangle has no area");
    forest.node.resize(forest.row.size());
    for (NodeIndex n = 0; n < forest.row.size(); ++n) {
        if (forest.row[n].parent != kNoNode) continue;
        if (const std::string fault = readNode(reader, forest, n, forest.node[n]); !fault.empty())
            throw InputError::atByte(reader.path(), reader.page(n).offset, fault);
    }
    return forest;
}

/// With the triangles that a mesh has beyond two a vertex, which it keeps.
size_t bytesOfBase(const ProgressiveMesh& mesh) {
    const size_t vertices = mesh.base_vertex.size(), triangles = mesh.base_triangle.size();
    return vertices * (sizeof(Vertex) + sizeof(OperationId)) + triangles * sizeof(Triangle) +
           2 * sizeof(ActiveFace) * (triangles - std::min(triangles, 2 * vertices));
}

class LiveMesh : public LiveModel {
public:
    explicit LiveMesh(const ModelReader& reader)
        : info_(reader.info()),
          rows_(rowsOf(reader.nodes(), reader.info().lattice.shift)),
          nodes_(openRoots(reader), uint32_t(rows_.size())),
          adaption_(nodes_.mesh(), &nodes_),
          base_bytes_(bytesOfBase(nodes_.mesh())),
          most_vertices_(adaption_.mesh().vertexCount()) {
        chunks_.update(adaption_.mesh());
    }

    std::unique_ptr<LivePage> decode(uint32_t page, std::span<const std::byte> bytes,
                                     std::string& fault) const override {
        auto decoded = std::make_unique<NodePage>();
        if (!decodeNode(bytes, page, rows_[page], nodes_.mesh().layout, decoded->node, fault))
            return nullptr;
        return decoded;
    }
    bool arrive(uint32_t page, const LivePage* decoded) override;
    const LiveFrame& adapt(const LiveTask& task) override;
    std::span<const LiveChunk> chunks() const override { return chunks_.chunks(); }
    std::vector<uint32_t> requests(size_t most) const override { return nodes_.requests(most); }
    std::vector<uint32_t> prefetch(const View& view, double pixels, size_t most) override {
        return nodes_.prefetch(criterionFor(view, info_, pixels), most);
    }
    size_t bytes() const override { return nodes_.bytes() + meshBytes(); }
    size_t pageBytes() const override { return nodes_.nodeBytes(); }
    size_t release(size_t bytes) override;
    std::span<const std::string> faults() const override { return faults_; }

private:
    const Lattice& lattice() const { return nodes_.mesh().lattice; }
    size_t meshBytes() const {
        return base_bytes_ + most_vertices_ * (kActiveBytes + kSortingBytes) + chunks_.bytes();
    }
    /// Of a vertex, in chunks, of which some have it, too.
    size_t wordBytes() const { return 6 * nodes_.mesh().layout.words(); }
    size_t roomFor(size_t bytes);
    uint64_t drawable(uint64_t triangles) const;
    void describe(const LiveTask& task, const PassCounts& counts, bool drawn_limits);
    void giveBack();
    double largestError(const View& view) const;
    void tell(const std::string& what);

    const ModelInfo info_;
    const std::vector<NodeRow> rows_;
    ResidentNodes nodes_;
    Adaption adaption_;
    DrawChunks chunks_;
    const size_t base_bytes_;
    size_t most_vertices_;  // at a time, since giveBack()
    double chunks_ms_ = 0;  // of the last frame
    LiveFrame frame_;
    std::vector<std::string> faults_;
};

bool LiveMesh::arrive(uint32_t page, const LivePage* decoded) {
    if (!decoded) return nodes_.giveUp(page), true;
    if (nodes_.arrive(page, static_cast<const NodePage*>(decoded)->node)) return true;
    if (nodes_.isGivenUp(page)) tell(fmt::format("page {} does not fit its parent", page));
    return false;
}

/// How many vertices memory has room for. What vertices that have left still hold beyond that has
/// no place beside these: it goes back first.
size_t LiveMesh::roomFor(size_t bytes) {
    const auto room = [&] {
        const size_t vertices = adaption_.mesh().vertexCount();
        const size_t chunks = chunks_.bytes();
        const size_t others = nodes_.bytes() + base_bytes_ + chunks -
                              std::min(chunks, vertices * (kChunkBytes + wordBytes()));
        return (bytes - std::min(bytes, others)) / (kVertexBytes + wordBytes());
    };
    if (most_vertices_ > std::max(room(), adaption_.mesh().vertexCount())) giveBack();
    return room();
}

/// A vertex more is two triangles more, at most.
uint64_t LiveMesh::drawable(uint64_t triangles) const {
    const ProgressiveMesh& mesh = nodes_.mesh();
    const uint64_t base = mesh.base_triangle.size();
    return mesh.base_vertex.size() + (std::max(triangles, base) - base) / 2;
}

const LiveFrame& LiveMesh::adapt(const LiveTask& task) {
    Criterion criterion = criterionFor(*task.view, info_, task.pixels);
    if (task.seen != nullptr && task.pixels > 0)
        criterion.occlusion = std::make_shared<Occlusion>(*task.seen, lattice());
    FrameLimits limits;
    // Where much changes, chunks take a part of the time.
    limits.milliseconds = std::max(task.milliseconds - chunks_ms_, task.milliseconds / 4);
    limits.operations = task.only_look ? 0 : kPassOperations;
    limits.passes = task.only_look ? 1 : kMostPasses;
    const size_t in_memory = roomFor(task.most_bytes), in_picture = drawable(task.most_triangles);
    limits.vertices = std::min(in_memory, in_picture);
    const size_t vertices = adaption_.mesh().vertexCount();
    const PassCounts counts = adaption_.frame(criterion, limits);
    most_vertices_ = std::max({most_vertices_, adaption_.mesh().vertexCount(),
                               std::min<size_t>(limits.vertices, vertices + counts.splits)});
    nodes_.note(adaption_);
    const size_t node_room = task.most_bytes - std::min(task.most_bytes, meshBytes());
    nodes_.setMost((node_room + task.arriving_bytes) / nodes_.nodeBytes());
    const Stopwatch watch;
    chunks_.update(adaption_.mesh());
    chunks_ms_ = watch.ms();

    describe(task, counts, in_picture <= in_memory);
    if (frame_.short_of_memory) nodes_.evictOldest();
    const size_t left = nodes_.bytes() - nodes_.loaded() * nodes_.nodeBytes() +
                        (most_vertices_ - adaption_.mesh().vertexCount()) * kActiveBytes;
    if (frame_.short_of_memory || left > bytes() / 4) giveBack();
    return frame_;
}

void LiveMesh::describe(const LiveTask& task, const PassCounts& counts, bool drawn_limits) {
    frame_.operations = counts.operations();
    const bool is_done = counts.finished && !counts.short_of_room && adaption_.waiting().empty();
    frame_.busy = !counts.finished || (task.only_look && !is_done);
    frame_.missing = nodes_.missing();
    // What is needed is counted only where it may be too much.
    frame_.needed_bytes = bytes() + frame_.missing * nodes_.nodeBytes();
    if (frame_.needed_bytes > task.most_bytes / 2)
        frame_.needed_bytes = nodes_.required() * nodes_.nodeBytes() + meshBytes();
    frame_.triangles = adaption_.mesh().faceCount();
    const bool is_short = counts.finished && counts.short_of_room;
    frame_.short_of_triangles = is_short && drawn_limits;
    frame_.short_of_memory =
        (is_short && !drawn_limits) || (counts.finished && frame_.needed_bytes > task.most_bytes);
    frame_.largest_px = is_done ? task.pixels : largestError(*task.view);
    if (adaption_.refused() > 0) tell("operations do not fit their places");
}

/// What nodes and vertices took that are no more.
void LiveMesh::giveBack() {
    ActiveMesh& mesh = adaption_.mesh();
    nodes_.giveBack();
    giveBackBehind(mesh.vertex);
    giveBackBehind(mesh.pulse);
    giveBackBehind(mesh.criteria);
    giveBackBehind(mesh.record);
    giveBackBehind(mesh.face);
    most_vertices_ = mesh.vertexCount();
}

/// Once.
void LiveMesh::tell(const std::string& what) {
    const std::string fault = "the model is damaged: " + what;
    if (std::find(faults_.begin(), faults_.end(), fault) == faults_.end()) faults_.push_back(fault);
}

/// Of what could be refined in the picture.
double LiveMesh::largestError(const View& view) const {
    const ActiveMesh& mesh = adaption_.mesh();
    const double step = double(1 << lattice().shift);
    PerThread<double> largest(0.0);
    parallelForSlices(mesh.vertexCount(), 4096, [&](size_t begin, size_t end) {
        double& most = largest.local();
        for (size_t v = begin; v < end; ++v) {
            const VertexCriteria& c = mesh.criteria[v];
            if (c.split_error == 0) continue;
            const Sphere sphere{Vec3f(Vec3d(mesh.vertex[v].position()) * step),
                                float(decodeRadius(c.split_radius) * step)};
            const auto error = float(double(decodeError(c.split_error)) * kErrorUnit * step);
            const double pixels = view.errorInPixels(error, sphere);
            if (pixels > most && !view.outside(sphere)) most = pixels;
        }
    });
    double most = 0;
    for (const double m : largest) most = std::max(most, m);
    return most;
}

size_t LiveMesh::release(size_t bytes) {
    const size_t before = this->bytes();
    giveBack();
    while (this->bytes() + bytes > before && nodes_.evictOldest()) nodes_.giveBack();
    return before - this->bytes();
}

}  // namespace

std::unique_ptr<LiveModel> openLive(const ModelReader& reader) {
    return std::make_unique<LiveMesh>(reader);
}

}  // namespace pietra::pmesh
