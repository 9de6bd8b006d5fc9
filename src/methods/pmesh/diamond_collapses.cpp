#include "methods/pmesh/diamond_collapses.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <unordered_map>

#include "base/check.h"
#include "base/parallel.h"
#include "coarsen/diamond.h"
#include "coarsen/key_map.h"
#include "coarsen/level_items.h"
#include "methods/pmesh/twins.h"
#include "simplify/simplify.h"

namespace pietra::pmesh {
namespace {

/// Records of a diamond before they have their final numbers.
constexpr uint32_t kLocal = 1u << 31;
/// That a diamond adds. Some would add 80, where collapses run along; those wait for the next
/// level.
constexpr uint32_t kMostHeights = 18;

/// What a vertex carries from diamond to diamond, in the place of scalars.
struct VertexState {
    std::array<uint32_t, 2> key{};  ///< of its place in the input
    uint32_t number = kNoVertex;    ///< given in its first diamond
    uint32_t is_shared = 0;         ///< has other numbers, too
    VertexHistory history;

    uint64_t place() const { return key[0] | uint64_t(key[1]) << 32; }
    VertexId id() const { return is_shared ? kShared | place() : number; }
    static VertexState at(const Vec3i& position) {
        VertexState state;
        const uint64_t place = latticeKey(position);
        state.key = {uint32_t(place), uint32_t(place >> 32)};
        return state;
    }
};
constexpr size_t kStateFloats = sizeof(VertexState) / sizeof(float);
static_assert(sizeof(VertexState) % sizeof(float) == 0);

/// The first of a vertex's scalars; the input's own come after it.
const float* stateIn(const Mesh& mesh, size_t v) {
    return &mesh.scalar[mesh.scalar.size() / mesh.vertexCount() * v];
}
VertexState stateOf(const Mesh& mesh, size_t v) {
    VertexState state;
    std::memcpy(static_cast<void*>(&state), stateIn(mesh, v), sizeof state);
    return state;
}
void setState(Mesh& mesh, size_t v, const VertexState& state) {
    std::memcpy(const_cast<float*>(stateIn(mesh, v)), &state, sizeof state);
}

struct Cell {
    CellBlob blob;
    float error = 0;  ///< largest of its faces' bounds
    int height = 0;   ///< 0: a leaf
};

struct SavedCell {
    CellId id;
    Cell cell;
    bool is_leaf;
};

struct DiamondResult {
    std::vector<CellId> ids;
    std::vector<CellMesh> cells;  ///< states as scalars, with local records
    std::vector<float> errors;
    std::vector<CollapseLink> link;
    std::vector<CollapseRecord> record;
    std::vector<uint32_t> words;
    // One a vertex that records mean:
    std::vector<VertexState> vertex;
    std::vector<uint8_t> inside;  ///< Recorder::isInside()
    int height = 0;               ///< of the cells
    uint32_t largest_height = 0;
    uint64_t input_triangles = 0;
    Recorder::Refused refused;
};

/// What one triangle of a component knows all of it do.
void spreadOverEdges(const Mesh& mesh, std::vector<uint8_t>& known) {
    const HalfEdges edges = findHalfEdges(mesh.triangle, mesh.vertexCount());
    std::vector<uint32_t> waiting;
    for (uint32_t t = 0; t < known.size(); ++t)
        if (known[t]) waiting.push_back(t);
    while (!waiting.empty()) {
        const uint32_t t = waiting.back();
        waiting.pop_back();
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t twin = edges.twin[3 * t + k];
            if (twin == kNoCorner || known[twin >> 2]) continue;
            known[twin >> 2] = 1;
            waiting.push_back(twin >> 2);
        }
    }
}

/// Merges cells by the names of their vertices and collapses what may be.
class Collapser {
public:
    explicit Collapser(const VertexTable& vertices)
        : shift_(vertices.lattice().shift), scalar_range_(vertices.scalarRanges()) {}

    void begin() {
        mesh_.clear();
        label_.clear();
        bound_.clear();
        closed_.clear();
        leaves_.clear();
        state_.clear();
        ids_.reserve(0);
    }
    void add(const CellMesh& cell, bool is_leaf, uint8_t label);
    void run(std::span<const uint32_t> quota, float child_error, const SurfaceMap::Effort& effort,
             DiamondResult& result);
    size_t triangleCount() const { return mesh_.triangleCount(); }

    CellMesh scratch;

private:
    void takeApart(const Recorder& recorder, size_t cells, DiamondResult& result);

    int shift_;
    const std::vector<float>& scalar_range_;  // one a scalar of the input
    Simplifier simplifier_;
    SimplifyOutput simplified_;
    Mesh mesh_;
    std::vector<uint8_t> label_;
    std::vector<float> bound_;     // one a triangle
    std::vector<uint8_t> closed_;  // likewise: of a closed component (coarsen/components.h)
    std::vector<FaceLeaves> leaves_;
    std::vector<VertexState> state_;
    KeyMap ids_;
    std::vector<uint32_t> local_;
};

void Collapser::add(const CellMesh& cell, bool is_leaf, uint8_t label) {
    const Mesh& child = cell.mesh;
    local_.resize(child.vertexCount());
    for (size_t v = 0; v < child.vertexCount(); ++v) {
        const VertexState state = is_leaf ? VertexState::at(child.position[v]) : stateOf(child, v);
        const auto [id, is_new] = ids_.insert(state.place(), uint32_t(mesh_.vertexCount()));
        local_[v] = id;
        if (!is_new) {
            CHECK(mesh_.position[id] == child.position[v]);
            if (state.number != kNoVertex) state_[id] = state;
            continue;
        }
        mesh_.position.push_back(child.position[v]);
        mesh_.normal.push_back(child.normal[v]);
        if (!child.colour.empty()) mesh_.colour.push_back(child.colour[v]);
        const size_t scalars = child.scalar.size() / child.vertexCount(),
                     own = scalar_range_.size();
        const auto end = child.scalar.begin() + ptrdiff_t(scalars * (v + 1));
        mesh_.scalar.insert(mesh_.scalar.end(), end - ptrdiff_t(own), end);
        state_.push_back(state);
    }
    for (size_t t = 0; t < child.triangleCount(); ++t) {
        const Triangle& f = child.triangle[t];
        mesh_.triangle.push_back({local_[f[0]], local_[f[1]], local_[f[2]]});
        mesh_.edge_class.push_back(child.edge_class[t]);
        label_.push_back(label);
        // What the lattice took is no part of it.
        bound_.push_back(is_leaf ? 0 : cell.bounds.to_original[t]);
        closed_.push_back(is_leaf ? cell.closed : cell.bounds.from_original[t] != 0);
        leaves_.push_back(is_leaf ? FaceLeaves{} : cell.corner[t]);
    }
}

void Collapser::run(std::span<const uint32_t> quota, float child_error,
                    const SurfaceMap::Effort& effort, DiamondResult& result) {
    result.input_triangles = mesh_.triangleCount();
    if (mesh_.triangle.empty()) {
        result.cells.resize(quota.size());
        result.errors.assign(quota.size(), 0);
        return;
    }
    std::vector<VertexHistory> history;
    for (const VertexState& state : state_) history.push_back(state.history);
    Recorder recorder(mesh_, std::move(history), bound_, leaves_, closed_, effort, kLocal, shift_);
    if (std::any_of(quota.begin(), quota.end(), [](uint32_t q) { return q > 0; }))
        recorder.limitHeights(kMostHeights);
    SimplifyInput input;
    input.mesh = &mesh_;
    input.cell = label_;
    input.quota = quota;
    input.shift = shift_;
    input.free_error = child_error;
    input.sink = &recorder;
    input.scalar_count = int(scalar_range_.size());
    input.scalar_range = scalar_range_;
    simplifier_.run(input, simplified_);
    takeApart(recorder, quota.size(), result);
    result.link = std::move(recorder.links());
    result.record = std::move(recorder.records());
    result.words = std::move(recorder.words());
    result.vertex = state_;
    for (uint32_t v = 0; v < state_.size(); ++v) result.inside.push_back(recorder.isInside(v));
    result.largest_height = recorder.largestHeight();
    result.refused = recorder.refused();
}

void Collapser::takeApart(const Recorder& recorder, size_t cells, DiamondResult& result) {
    const Mesh& mesh = simplified_.mesh;
    std::vector<uint32_t> survivor(mesh.vertexCount(), kNoVertex);
    std::vector<uint8_t> gone(state_.size(), 0);
    std::vector<uint32_t> slot(mesh.triangleCount());
    for (uint32_t t = 0; t < mesh_.triangleCount(); ++t)
        if (simplified_.triangle_map[t] != kNone) slot[simplified_.triangle_map[t]] = t;
    for (const CollapseLink& link : recorder.links()) gone[link.u] = 1;
    for (uint32_t v = 0; v < state_.size(); ++v)
        if (!gone[v] && simplified_.vertex_map[v] != kNone) {
            CHECK_EQ(survivor[simplified_.vertex_map[v]], kNoVertex);
            survivor[simplified_.vertex_map[v]] = v;
        }
    result.cells.resize(cells);
    result.errors.assign(cells, 0);
    for (size_t c = 0; c < cells; ++c) {
        Mesh& cell = result.cells[c].mesh;
        local_.assign(mesh.vertexCount(), kNoVertex);
        for (size_t t = 0; t < mesh.triangleCount(); ++t) {
            if (simplified_.cell[t] != c) continue;
            Triangle triangle;
            for (size_t k = 0; k < 3; ++k) {
                const uint32_t at = mesh.triangle[t][k], v = survivor[at];
                if (local_[at] == kNoVertex) {
                    local_[at] = uint32_t(cell.vertexCount());
                    cell.position.push_back(mesh.position[at]);
                    cell.normal.push_back(recorder.normalOf(v));
                    VertexState state = state_[v];
                    state.history = recorder.historyOf(v);
                    state.number = v;  // of this diamond, until take()
                    if (!mesh.colour.empty()) cell.colour.push_back(mesh.colour[at]);
                    const size_t own = scalar_range_.size();
                    cell.scalar.resize(cell.scalar.size() + kStateFloats);
                    for (size_t i = 0; i < own; ++i)
                        cell.scalar.push_back(mesh.scalar[own * at + i]);
                    setState(cell, cell.vertexCount() - 1, state);
                }
                triangle[k] = local_[at];
            }
            cell.triangle.push_back(triangle);
            cell.edge_class.push_back(mesh.edge_class[t]);
            const float bound = recorder.boundOf(slot[t]);
            result.cells[c].bounds.to_original.push_back(bound);
            // One number is for both directions (surface_map.h): the other one's place is free.
            result.cells[c].bounds.from_original.push_back(recorder.isClosed(slot[t]));
            result.cells[c].corner.push_back(recorder.leavesOf(slot[t]));
            result.errors[c] = std::max(result.errors[c], bound);
        }
    }
}

class LevelCollapser {
public:
    LevelCollapser(Construction& work, const BuildSettings& settings, Progress& progress,
                   Collapses& out)
        : work_(work),
          input_(work.input),
          patch_triangles_(settings.patch_triangles),
          jobs_(settings.jobs),
          space_(work.space),
          progress_(progress),
          out_(out),
          workers_([this] { return Collapser(input_.vertices); }) {}

    void run() {
        progress_.beginStage("collapse", input_.leaves.triangles * 3);
        int level = input_.leaves.tree->deepestLevel();
        if (auto state = work_.stateToResume()) level = restore(*state);
        for (; level >= 0; --level) {
            runLevel(level);
            work_.saveState(cellsOf(level), [&](StateWriter& state) { save(level, state); });
        }
        runRoot();
    }

private:
    void runLevel(int level);
    DiamondResult runDiamond(const LevelItem& item, int level);
    void runRoot();
    int cellScalars() const { return int(kStateFloats + input_.vertices.scalarRanges().size()); }
    static std::string cellsOf(int level) { return fmt::format("cells-{}", level); }
    void save(int level, StateWriter& state);
    int restore(StateReader& state);
    void addCell(const Cell& cell, uint8_t label, Collapser& worker) const {
        cell.blob.store->get(cell.blob, worker.scratch);
        worker.add(worker.scratch, cell.blob.store == &input_.store, label);
    }
    /// Most collapses are of the finest diamonds, so there pieces are dear; what is lost there
    /// stays, but matters less the coarser it gets.
    static SurfaceMap::Effort effortAt(int height) {
        if (height > 5) return {12, 0.3f};
        if (height > 3) return {8, 0.5f};
        return height > 1 ? SurfaceMap::Effort{4, 0.8f} : SurfaceMap::Effort{2, 0.9f};
    }
    void take(DiamondResult& result);
    static uint32_t globalRecord(uint32_t record, uint32_t first) {
        return record == kNoSplit || record < kLocal ? record : first + (record - kLocal);
    }

    static constexpr uint64_t kTrimEvery = 32;  // diamonds

    Construction& work_;
    InputLeaves& input_;
    uint32_t patch_triangles_;
    int jobs_;
    TempSpace& space_;
    Progress& progress_;
    Collapses& out_;
    uint64_t taken_ = 0;  // diamonds
    PerThread<Collapser> workers_;
    std::unordered_map<CellId, Cell> below_, cells_;
    std::unique_ptr<CellStore> store_below_, store_;
};

void LevelCollapser::runLevel(int level) {
    const auto items = itemsOfLevel(input_.leaves, level, [&](CellId cell) {
        const auto found = below_.find(cell);
        return found == below_.end() ? nullptr : &found->second.blob;
    });
    store_ = std::make_unique<CellStore>(space_, cellScalars(), cellsOf(level));
    cells_.clear();
    std::vector<LevelItem> diamonds;
    for (const LevelItem& item : items) {
        if (item.is_leaf)
            cells_[item.cells[0]] = {input_.leaves.blobs.at(item.cells[0]), 0};
        else
            diamonds.push_back(item);
    }
    orderedPipeline(
        diamonds.size(), size_t(jobs_) * 2,
        [&](size_t i) { return runDiamond(diamonds[i], level); },
        [&](DiamondResult& result) { take(result); });
    below_ = std::move(cells_);
    store_below_ = std::move(store_);
}

/// What finished levels leave.
void LevelCollapser::save(int level, StateWriter& state) {
    state.put(level);
    store_below_->save(state);
    std::vector<SavedCell> cells;
    for (const auto& [id, cell] : below_)
        cells.push_back({id, cell, cell.blob.store == &input_.store});
    state.put(cells);
    out_.store.save(state);
    state.put(out_.numbers);
    state.put(out_.largest_height);
    state.put(out_.refused);
}

/// The level that is next.
int LevelCollapser::restore(StateReader& state) {
    const int level = state.get<int>();
    store_below_ = std::make_unique<CellStore>(space_, cellScalars(), cellsOf(level));
    store_below_->restore(state);
    std::vector<SavedCell> cells;
    state.get(cells);
    for (SavedCell& saved : cells) {
        saved.cell.blob.store = saved.is_leaf ? &input_.store : store_below_.get();
        below_.emplace(saved.id, saved.cell);
    }
    out_.store.restore(state);
    state.get(out_.numbers);
    state.get(out_.largest_height);
    state.get(out_.refused);
    return level - 1;
}

DiamondResult LevelCollapser::runDiamond(const LevelItem& item, int level) {
    Collapser& worker = workers_.local();
    DiamondResult result;
    result.ids = item.cells;
    worker.begin();
    std::vector<uint32_t> quota;
    float error = 0;
    for (size_t c = 0; c < item.cells.size(); ++c) {
        const size_t before = worker.triangleCount();
        for (const int bit : {0, 1}) {
            const auto child = below_.find(cellChild(item.cells[c], bit));
            if (child == below_.end()) continue;
            addCell(child->second, uint8_t(c), worker);
            error = std::max(error, child->second.error);
            result.height = std::max(result.height, child->second.height + 1);
        }
        quota.push_back(cellQuota(worker.triangleCount() - before, patch_triangles_, level));
    }
    worker.run(quota, error, effortAt(result.height), result);
    progress_.tick(result.input_triangles);
    return result;
}

/// Gives records and vertices their numbers.
void LevelCollapser::take(DiamondResult& result) {
    if (++taken_ % kTrimEvery == 0) trimHeap();
    const uint32_t first = out_.store.size();
    CHECK_LT(first + result.record.size(), size_t(kLocal));
    std::vector<uint32_t> number;
    std::vector<VertexAlias> aliases;
    for (size_t v = 0; v < result.vertex.size(); ++v) {
        VertexState& state = result.vertex[v];
        if (state.number == kNoVertex) {
            state.number = out_.numbers++;
            state.is_shared = !result.inside[v];
            if (state.is_shared) aliases.push_back({state.id(), state.number});
        }
        number.push_back(state.number);
    }
    for (CollapseLink& link : result.link) {
        link.u = result.vertex[link.u].id();
        for (uint32_t& child : link.child) child = globalRecord(child, first);
    }
    out_.store.append(result.link, result.record, number, result.words);
    out_.store.append(aliases);
    for (size_t c = 0; c < result.ids.size(); ++c) {
        Mesh& mesh = result.cells[c].mesh;
        for (size_t v = 0; v < mesh.vertexCount(); ++v) {
            VertexState state = stateOf(mesh, v);
            state.history.last = globalRecord(state.history.last, first);
            state.is_shared = result.vertex[state.number].is_shared;
            state.number = number[state.number];
            setState(mesh, v, state);
        }
        cells_[result.ids[c]] = {store_->put(result.cells[c]), result.errors[c], result.height};
    }
    out_.largest_height = std::max(out_.largest_height, result.largest_height);
    out_.refused.irregular += result.refused.irregular;
    out_.refused.valence += result.refused.valence;
    out_.refused.level += result.refused.level;
    out_.refused.unseen += result.refused.unseen;
}

/// What the cells of level 0 have left, down to the base.
void LevelCollapser::runRoot() {
    store_ = std::make_unique<CellStore>(space_, cellScalars());
    Collapser& worker = workers_.local();
    DiamondResult result;
    std::vector<CellId> cells;
    for (const auto& [id, cell] : below_) cells.push_back(id);
    std::sort(cells.begin(), cells.end());
    worker.begin();
    float error = 0;
    for (const CellId id : cells) {
        addCell(below_[id], 0, worker);
        error = std::max(error, below_[id].error);
        result.height = std::max(result.height, below_[id].height + 1);
    }
    const uint32_t nothing = 0;
    worker.run({&nothing, 1}, error, effortAt(result.height), result);
    result.ids = {cells.front()};
    take(result);
    const std::vector<float>& closed = result.cells[0].bounds.from_original;
    out_.base_closed.assign(closed.begin(), closed.end());
    out_.base_leaves = std::move(result.cells[0].corner);
    out_.base = std::move(result.cells[0].mesh);
    spreadOverEdges(out_.base, out_.base_closed);
    std::vector<float> scalars;
    for (size_t v = 0; v < out_.base.vertexCount(); ++v) {
        const VertexState state = stateOf(out_.base, v);
        out_.base_vertex.push_back(state.id());
        out_.base_last.push_back(state.history.last);
        const float* row = stateIn(out_.base, v);
        scalars.insert(scalars.end(), row + kStateFloats, row + cellScalars());
    }
    out_.base.scalar = std::move(scalars);
}

}  // namespace

void collapseByDiamonds(Construction& work, const BuildSettings& settings, Progress& progress,
                        Collapses& out) {
    LevelCollapser(work, settings, progress, out).run();
    work.input.store.clear();
}

}  // namespace pietra::pmesh
