#include "methods/tetra/levels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "base/check.h"
#include "base/parallel.h"
#include "coarsen/diamond.h"
#include "coarsen/level_items.h"
#include "geometry/enclosing_ball.h"
#include "store/page_codec.h"

namespace pietra::tetra {

namespace {

/// A page holds whole diamonds and leaves, at least this many triangles of them; fewer in the
/// coarse levels, so that all threads have work there, and a first picture needs little.
constexpr uint64_t kPageTriangles = 8192, kSmallestPageTriangles = 1024, kUnitsOfLevel = 16;

/// What a finished cell leaves to its parent.
struct CellState {
    CellBlob blob;
    NodeIndex position = kNoNode;  // in its level
    float error = 0;
    Sphere saturated;
};

struct SavedCell {
    CellId id;
    CellState state;
    bool is_leaf;
};

/// Items that share a page.
struct Unit {
    size_t first = 0, end = 0;
};

struct UnitResult {
    std::vector<std::byte> page;
    std::vector<Node> nodes;
    std::vector<std::pair<CellId, CellState>> states;
    uint64_t input_triangles = 0;
};

/// Scratch of one thread.
struct Worker {
    explicit Worker(const LevelSettings& settings)
        : diamond(settings.shift, settings.scalar_range) {}
    DiamondWorker diamond;
    DiamondInput input;
    std::vector<DiamondOutput> outputs;
    std::vector<CellMesh> leaves;
    std::vector<Vec3f> normals;
};

class LevelBuilder {
public:
    LevelBuilder(Construction& work, const LevelSettings& settings, Progress& progress)
        : work_(work),
          leaves_(work.input.leaves),
          settings_(settings),
          space_(work.space),
          writer_(work.writer),
          progress_(progress),
          workers_([this] { return Worker(settings_); }) {
        page_settings_.shift = settings.shift;
        page_settings_.colours = settings.schema.colours;
        page_settings_.scalar_count = int(settings.schema.scalars.size());
    }

    LevelCounts run() {
        // Levels store about 3 times the input together: only progress depends on this guess.
        progress_.beginStage("coarsen", leaves_.triangles * 3);
        int level = leaves_.tree->deepestLevel();
        if (auto state = work_.stateToResume()) level = restore(*state);
        for (; level >= 0; --level) {
            if (!buildLevel(level)) continue;
            counts_.levels = std::max(counts_.levels, uint32_t(level) + 1);
            work_.saveState(cellsOf(level), [&](StateWriter& state) { save(level, state); });
        }
        return counts_;
    }

private:
    bool buildLevel(int level);
    static std::string cellsOf(int level) { return fmt::format("cells-{}", level); }
    int scalars() const { return int(settings_.schema.scalars.size()); }
    void save(int level, StateWriter& state);
    int restore(StateReader& state);
    static std::vector<Unit> unitsOf(const std::vector<LevelItem>& items);
    UnitResult runUnit(std::span<const LevelItem> items, int level);
    void runLeaf(const LevelItem& item, const CellMesh& mesh, UnitResult& result,
                 Worker& worker) const;
    void runDiamond(const LevelItem& item, int level, DiamondOutput& output, UnitResult& result,
                    Worker& worker);
    static Node describe(const CellMesh& cell, Worker& worker);
    void write(UnitResult& result);

    Construction& work_;
    Leaves& leaves_;
    const LevelSettings& settings_;
    TempSpace& space_;
    ModelWriter& writer_;
    Progress& progress_;
    PageSettings page_settings_;
    PerThread<Worker> workers_;
    // Of the level below, and of the one being built.
    std::unordered_map<CellId, CellState> below_, states_;
    std::unique_ptr<CellStore> store_below_, store_;
    NodeIndex nodes_in_level_ = 0;
    uint32_t groups_ = 0;
    LevelCounts counts_;
};

std::vector<Unit> LevelBuilder::unitsOf(const std::vector<LevelItem>& items) {
    uint64_t of_level = 0;
    for (const LevelItem& item : items) of_level += item.triangles;
    const uint64_t enough =
        std::clamp(of_level / kUnitsOfLevel, kSmallestPageTriangles, kPageTriangles);
    std::vector<Unit> units;
    uint64_t triangles = enough;
    for (size_t i = 0; i < items.size(); ++i) {
        if (triangles >= enough) {
            units.push_back({i, i});
            triangles = 0;
        }
        triangles += items[i].triangles;
        units.back().end = i + 1;
    }
    return units;
}

bool LevelBuilder::buildLevel(int level) {
    const std::vector<LevelItem> items = itemsOfLevel(leaves_, level, [&](CellId cell) {
        const auto state = below_.find(cell);
        return state == below_.end() ? nullptr : &state->second.blob;
    });
    if (items.empty()) return false;
    const std::vector<Unit> units = unitsOf(items);
    store_ = std::make_unique<CellStore>(space_, scalars(), cellsOf(level));
    states_.clear();
    nodes_in_level_ = 0;
    writer_.beginLevel(uint32_t(level));
    orderedPipeline(
        units.size(), size_t(settings_.jobs) * 2,
        [&](size_t u) {
            return runUnit(std::span(items).subspan(units[u].first, units[u].end - units[u].first),
                           level);
        },
        [&](UnitResult& result) { write(result); });
    below_ = std::move(states_);
    store_below_ = std::move(store_);
    return true;
}

/// What finished levels leave.
void LevelBuilder::save(int level, StateWriter& state) {
    state.put(level);
    writer_.save(state);
    store_below_->save(state);
    std::vector<SavedCell> cells;
    for (const auto& [id, cell] : below_)
        cells.push_back({id, cell, cell.blob.store != store_below_.get()});
    state.put(cells);
    state.put(groups_);
    state.put(counts_);
}

/// The level that is next.
int LevelBuilder::restore(StateReader& state) {
    const int level = state.get<int>();
    writer_.restore(state);
    store_below_ = std::make_unique<CellStore>(space_, scalars(), cellsOf(level));
    store_below_->restore(state);
    std::vector<SavedCell> cells;
    state.get(cells);
    for (SavedCell& saved : cells) {
        saved.state.blob.store =
            saved.is_leaf ? leaves_.blobs.at(saved.id).store : store_below_.get();
        below_.emplace(saved.id, saved.state);
    }
    state.get(groups_);
    state.get(counts_);
    return level - 1;
}

UnitResult LevelBuilder::runUnit(std::span<const LevelItem> items, int level) {
    UnitResult result;
    Worker& worker = workers_.local();
    worker.outputs.resize(std::max(worker.outputs.size(), items.size()));
    worker.leaves.resize(std::max(worker.leaves.size(), items.size()));
    std::vector<const Mesh*> patches;
    for (size_t i = 0; i < items.size(); ++i) {
        if (items[i].is_leaf) {
            const CellBlob& blob = leaves_.blobs.at(items[i].cells[0]);
            blob.store->get(blob, worker.leaves[i]);
            runLeaf(items[i], worker.leaves[i], result, worker);
            patches.push_back(&worker.leaves[i].mesh);
        } else {
            runDiamond(items[i], level, worker.outputs[i], result, worker);
            for (const CellMesh& cell : worker.outputs[i].cells) patches.push_back(&cell.mesh);
        }
    }
    result.page = encodePage(patches, page_settings_);
    progress_.tick(result.input_triangles);
    return result;
}

Node LevelBuilder::describe(const CellMesh& cell, Worker& worker) {
    const Mesh& mesh = cell.mesh;
    Node node;
    node.triangles = uint32_t(mesh.triangleCount());
    node.vertices = uint32_t(mesh.vertexCount());
    node.closed = cell.closed;
    node.bounds = enclosingBall(std::span<const Vec3i>(mesh.position));
    worker.normals.clear();
    for (const Triangle& t : mesh.triangle) {
        const Vec3i& a = mesh.position[t[0]];
        const Vec3d n(crossInteger(mesh.position[t[1]] - a, mesh.position[t[2]] - a));
        const double length = glm::length(n);
        if (length > 0) worker.normals.push_back(Vec3f(n / length));
    }
    node.cone = enclosingCone(worker.normals);
    return node;
}

void LevelBuilder::runLeaf(const LevelItem& item, const CellMesh& mesh, UnitResult& result,
                           Worker& worker) const {
    Node node = describe(mesh, worker);
    node.saturated = node.bounds;
    node.error = settings_.quantisation_error;
    result.nodes.push_back(node);
    result.states.push_back(
        {item.cells[0], {leaves_.blobs.at(item.cells[0]), kNoNode, node.error, node.saturated}});
    result.input_triangles += node.triangles;
}

void LevelBuilder::runDiamond(const LevelItem& item, int level, DiamondOutput& output,
                              UnitResult& result, Worker& worker) {
    DiamondInput& input = worker.input;
    input.children.assign(item.cells.size(), {});
    input.quota.clear();
    input.child_error = 0;
    std::vector<Sphere> spheres;
    for (size_t c = 0; c < item.cells.size(); ++c) {
        uint64_t triangles = 0;
        for (int bit : {0, 1}) {
            const auto child = below_.find(cellChild(item.cells[c], bit));
            if (child == below_.end()) continue;
            const CellState& state = child->second;
            input.children[c].push_back(state.blob);
            triangles += state.blob.triangles;
            input.child_error = std::max(input.child_error, state.error);
            spheres.push_back(state.saturated);
        }
        input.quota.push_back(cellQuota(triangles, settings_.patch_triangles, level));
    }
    worker.diamond.run(input, output);

    const size_t first = result.nodes.size();
    for (size_t c = 0; c < item.cells.size(); ++c) {
        Node node = describe(output.cells[c], worker);
        for (int bit : {0, 1})
            if (const auto child = below_.find(cellChild(item.cells[c], bit));
                child != below_.end())
                node.child[bit] = child->second.position;
        spheres.push_back(node.bounds);
        result.nodes.push_back(node);
    }
    const Sphere saturated = enclosingBall(spheres);
    const float error = std::max(output.error, input.child_error);
    for (size_t c = 0; c < item.cells.size(); ++c) {
        Node& node = result.nodes[first + c];
        node.saturated = saturated;
        node.error = error;
        node.group = uint32_t(first);  // the first node of the diamond in this page, until written
        if (node.triangles == 0) node.bounds = {saturated.centre, 0};
        result.states.push_back(
            {item.cells[c], {store_->put(output.cells[c]), kNoNode, error, saturated}});
    }
    result.input_triangles += output.input_triangles;
}

void LevelBuilder::write(UnitResult& result) {
    for (size_t i = 0; i < result.nodes.size(); ++i) {
        Node& node = result.nodes[i];
        const bool joins =
            !node.isLeaf() && i > 0 && !result.nodes[i - 1].isLeaf() && node.group != uint32_t(i);
        counts_.triangles += node.triangles;
        node.group = joins ? groups_ - 1 : groups_++;
        result.states[i].second.position = nodes_in_level_++;
    }
    writer_.addPage(result.page, result.nodes);
    for (auto& [cell, state] : result.states) states_.emplace(cell, state);
}

}  // namespace

LevelCounts buildLevels(Construction& work, const LevelSettings& settings, Progress& progress) {
    return LevelBuilder(work, settings, progress).run();
}

}  // namespace pietra::tetra
