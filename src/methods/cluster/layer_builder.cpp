#include "methods/cluster/layer_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>

#include "base/check.h"
#include "base/parallel.h"
#include "coarsen/mesh_joiner.h"
#include "geometry/enclosing_ball.h"
#include "methods/cluster/cell_layer.h"
#include "methods/cluster/fallback.h"
#include "methods/cluster/free_points.h"
#include "methods/cluster/layer_step.h"
#include "store/page_codec.h"

namespace pietra::cluster {

namespace {

/// A page holds the children of whole nodes, at least this many triangles of them; fewer in the
/// coarse levels, so that all threads have work there, and a first picture needs little.
constexpr uint64_t kPageTriangles = 8192, kSmallestPageTriangles = 1024, kUnitsOfLevel = 16;

/// What a finished cell waits with for the next layer.
struct CellState {
    Node node;
    uint64_t position = 0;  // in the layers' spill
    size_t bytes = 0;
};

struct SavedCell {
    SavedCell() = default;
    SavedCell(const std::pair<const CellId, CellState>& cell)
        : id(cell.first), state(cell.second) {}
    CellId id;
    CellState state;
};

struct Unit {
    size_t first = 0, end = 0;  // steps
};

/// A cell's new layer. Its node's children are counted from the first node of the page.
struct Finished {
    CellId cell;
    CellState state;
};

struct UnitResult {
    std::vector<std::byte> page;
    std::vector<Node> nodes;
    std::vector<Finished> finished;
    uint64_t triangles = 0;
};

/// Scratch of one thread.
struct Worker {
    Deviation deviation;
    CellMesh leaf;
    std::vector<Vec3f> normals;
};

Node describe(const Mesh& mesh, bool closed, Worker& worker) {
    Node node;
    node.triangles = uint32_t(mesh.triangleCount());
    node.vertices = uint32_t(mesh.vertexCount());
    node.closed = closed;
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

/// The square root of a face's mean area.
float faceSize(const PolygonMesh& polygons) {
    double area = 0;
    for (const FaceShape& shape : polygons.shape) area += shape.area;
    return polygons.faceCount() == 0 ? 0 : float(std::sqrt(area / polygons.faceCount()));
}

class Builder {
public:
    Builder(Construction& work, const BuilderSettings& settings, Progress& progress)
        : work_(work),
          leaves_(work.input.leaves),
          settings_(settings),
          space_(work.space),
          writer_(work.writer),
          progress_(progress),
          octree_(octreeOf(leaves_)),
          groups_(uint32_t(octree_.leaves().size())) {
        page_settings_.shift = settings.shift;
        page_settings_.colours = settings.schema.colours;
        page_settings_.scalar_count = int(settings.schema.scalars.size());
    }

    BuilderCounts run() {
        progress_.beginStage("interfaces", 0);
        table_ = std::make_unique<InterfaceTable>(octree_, leaves_, *space_.budget, progress_);
        // How many triangles layers begin with: only progress depends on these guesses.
        progress_.beginStage("local trees", leaves_.triangles * 3 / 2);
        if (auto state = work_.stateToResume()) restore(*state);
        while (layer_ < octree_.topLayer()) {
            if (++layer_ == kLocalLayers + 1)
                progress_.beginStage("global tree", leaves_.triangles / 16);
            buildLayer();
            work_.saveState(layersOf(layer_), [&](StateWriter& state) { save(state); });
        }
        writeTop();
        return counts_;
    }

private:
    static Octree octreeOf(const Leaves& leaves) {
        std::vector<CellId> cells;
        for (const CellId leaf : leaves.tree->leaves())
            if (leaves.blobs.contains(leaf)) cells.push_back(leaf);
        return Octree(std::move(cells));
    }

    void buildLayer();
    static std::string layersOf(int layer) { return fmt::format("layers-{}", layer); }
    void save(StateWriter& state);
    void restore(StateReader& state);
    std::vector<Unit> unitsOf() const;
    uint64_t trianglesOf(const CellStep& step) const;
    bool isFirst(const CellStep& step) const {
        return step.cell == step.below[0] && octree_.firstLayer(step.cell) == layer_ - 1;
    }
    void readLeaf(CellId cell, Worker& worker) const {
        const CellBlob& blob = leaves_.blobs.at(cell);
        blob.store->get(blob, worker.leaf);
    }
    /// What the step begins with, and if that is more than one layer, these, unless null.
    CellLayer load(const CellStep& step, Worker& worker, std::vector<CellLayer>* below) const;
    /// Of that what the choice of what leaves needs.
    CellLayer loadInterfaces(const CellStep& step, Worker& worker) const;
    UnitResult runUnit(const Unit& unit);
    void runStep(size_t index, UnitResult& result, std::vector<Mesh>& patches,
                 std::vector<Mesh>& joints);
    /// The strips' triangles: before, removed, after in the cell's outline, or turned.
    Mesh stripsOf(CellId cell, std::span<const uint32_t> removed, bool turned) const;
    /// Of what is removed, that whose strips the cell gives, or takes. Only leaves do: in larger
    /// cells the outline's way within the surface is little beside the rest.
    std::vector<uint32_t> removedBy(CellId cell, bool given) const;
    void boundStripsOf(const CellStep& step);
    /// Of a finished layer, when all cells have told what they gave.
    void takeStripsOf(CellId cell);
    LayerStep makeLayer(const CellStep& step, const CellLayer& base) const;
    void addJoints(const CellStep& step, const CellLayer& base, UnitResult& result,
                   std::vector<Mesh>& joints, std::vector<Sphere>& balls, Worker& worker) const;
    Node leafNode(const CellStep& step, const CellLayer& layer, Worker& worker) const;
    void write(UnitResult& result);
    void writeTop();

    Construction& work_;
    Leaves& leaves_;
    const BuilderSettings& settings_;
    TempSpace& space_;
    ModelWriter& writer_;
    Progress& progress_;
    PageSettings page_settings_;
    PerThread<Worker> workers_;
    const Octree octree_;
    uint32_t groups_;  // of the steps of this layer: from here on
    std::unique_ptr<InterfaceTable> table_;
    int layer_ = 0;  // the last one begun
    std::vector<CellStep> steps_;
    std::unique_ptr<Removals> removals_;
    std::unordered_map<CellId, CellState> below_, states_;
    std::unique_ptr<Spill> layers_below_, layers_;
    NodeIndex nodes_in_level_ = 0;
    BuilderCounts counts_;
};

uint64_t Builder::trianglesOf(const CellStep& step) const {
    if (isFirst(step)) return leaves_.blobs.at(step.cell).triangles;
    uint64_t triangles = 0;
    for (const CellId cell : step.below) triangles += below_.at(cell).node.triangles;
    return triangles;
}

std::vector<Unit> Builder::unitsOf() const {
    uint64_t of_level = 0;
    for (const CellStep& step : steps_) of_level += trianglesOf(step);
    const uint64_t enough =
        std::clamp(of_level / kUnitsOfLevel, kSmallestPageTriangles, kPageTriangles);
    std::vector<Unit> units;
    uint64_t triangles = enough;
    for (size_t i = 0; i < steps_.size(); ++i) {
        if (triangles >= enough) {
            units.push_back({i, i});
            triangles = 0;
        }
        triangles += trianglesOf(steps_[i]);
        units.back().end = i + 1;
    }
    return units;
}

void Builder::buildLayer() {
    steps_ = octree_.stepsOf(layer_);
    removals_.reset();  // before the next takes as much
    removals_ = std::make_unique<Removals>(*table_, layer_, *space_.budget);
    parallelFor(steps_.size(), [&](size_t i) {
        const CellLayer base = loadInterfaces(steps_[i], workers_.local());
        removals_->report(steps_[i].cell, base.polygons, base.joined);
        progress_.tick(0);
    });
    removals_->choose();
    parallelFor(steps_.size(), [&](size_t i) { boundStripsOf(steps_[i]); });

    layers_ = std::make_unique<Spill>(space_, layersOf(layer_));
    states_.clear();
    nodes_in_level_ = 0;
    writer_.beginLevel(uint32_t(octree_.topLayer() - layer_ + 1));
    const std::vector<Unit> units = unitsOf();
    orderedPipeline(
        units.size(), size_t(settings_.jobs) * 2, [&](size_t u) { return runUnit(units[u]); },
        [&](UnitResult& result) { write(result); });
    parallelFor(steps_.size(), [&](size_t i) { takeStripsOf(steps_[i].cell); });
    groups_ += uint32_t(steps_.size());
    below_ = std::move(states_);
    layers_below_ = std::move(layers_);
}

/// What finished layers leave.
void Builder::save(StateWriter& state) {
    state.put(layer_);
    writer_.save(state);
    layers_below_->save();
    state.put(layers_below_->bytes());
    state.put(std::vector<SavedCell>(below_.begin(), below_.end()));
    state.put(groups_);
    state.put(counts_);
}

void Builder::restore(StateReader& state) {
    state.get(layer_);
    writer_.restore(state);
    layers_below_ = std::make_unique<Spill>(space_, layersOf(layer_));
    layers_below_->restore(state.get<uint64_t>());
    std::vector<SavedCell> cells;
    state.get(cells);
    for (const auto& [id, cell] : cells) below_.emplace(id, cell);
    state.get(groups_);
    state.get(counts_);
}

CellLayer Builder::load(const CellStep& step, Worker& worker, std::vector<CellLayer>* below) const {
    std::vector<CellLayer> layers;
    if (isFirst(step)) {
        readLeaf(step.cell, worker);
        layers.push_back(
            firstLayer(worker.leaf, settings_.quantisation_error, step.cell, octree_, *table_));
    } else {
        for (const CellId cell : step.below) {
            const CellState& state = below_.at(cell);
            std::vector<std::byte> bytes(state.bytes);
            layers_below_->read(state.position, bytes);
            layers.push_back(unpackLayer(std::move(bytes)));
        }
    }
    if (layers.size() == 1) {
        continueLayer(layers[0], layer_, *table_);
        return std::move(layers[0]);
    }
    CellLayer base = joinLayers(layers, layer_, *table_);
    if (below) *below = std::move(layers);
    return base;
}

CellLayer Builder::loadInterfaces(const CellStep& step, Worker& worker) const {
    if (!isFirst(step)) return load(step, worker, nullptr);
    readLeaf(step.cell, worker);
    CellLayer base = interfacesOfLeaf(worker.leaf, step.cell, octree_, *table_);
    continueLayer(base, layer_, *table_);
    return base;
}

Node Builder::leafNode(const CellStep& step, const CellLayer& layer, Worker& worker) const {
    Node node = describe(layer.triangles.mesh, layer.closed, worker);
    node.saturated = node.bounds;
    node.error = layer.error;
    node.face_size = faceSize(layer.polygons);
    node.group = uint32_t(octree_.leafNumber(step.cell));
    return node;
}

LayerStep Builder::makeLayer(const CellStep& step, const CellLayer& base) const {
    std::vector<uint8_t> removed(base.polygons.vertexCount(), 0);
    for (uint32_t v = 0; v < removed.size(); ++v)
        if (base.polygons.interface_[v])
            removed[v] = removals_->isRemoved(table_->find(base.polygons.position[v]));
    const bool first = isFirst(step);
    const Box3i cube = cubeOf(step.cell);
    LayerStep next =
        nextLayer(base.polygons, base.triangles, removed,
                  first ? settings_.first_faces : settings_.faces, cube, settings_.clustering);
    FreePoints points(cube, settings_.shift,
                      [&](const Vec3i& p) { return table_->find(p) != kNone; });
    points.occupy(base.triangles.mesh.position);
    points.occupy(base.inner.position);
    points.settle(next);
    // Above the leaves, cells are to be about as large as theirs are in their last layer.
    const bool is_leaf = step.cell == step.below[0];
    size_t target = base.triangles.mesh.triangleCount() / 4;
    if (!is_leaf) target = std::min<size_t>(target, settings_.leaf_triangles / 8);
    if (next.triangles.mesh.triangleCount() > target + target / 2) dropComponents(next, target);
    points.placeStars(next.triangles);
    return next;
}

Mesh Builder::stripsOf(CellId cell, std::span<const uint32_t> removed, bool turned) const {
    Mesh strips;
    for (const uint32_t v : removed) {
        const auto [before, after] = removals_->neighbours(v, cell);
        const uint32_t base = uint32_t(strips.position.size());
        for (const uint32_t corner : {turned ? after : before, v, turned ? before : after})
            strips.position.push_back(table_->positionOf(corner));
        strips.triangle.push_back({base, base + 1, base + 2});
    }
    return strips;
}

std::vector<uint32_t> Builder::removedBy(CellId cell, bool given) const {
    std::vector<uint32_t> removed = removals_->removedFrom(cell);
    std::erase_if(removed, [&](uint32_t v) {
        return removals_->gives(v, cell) != given || !octree_.isLeaf(cell) ||
               !octree_.isLeaf(removals_->otherCell(v, cell));
    });
    return removed;
}

void Builder::boundStripsOf(const CellStep& step) {
    const std::vector<uint32_t> removed = removals_->removedFrom(step.cell);
    if (removed.empty()) return;
    Worker& worker = workers_.local();
    const Mesh strips = stripsOf(step.cell, removed, false);
    std::vector<float> bounds;
    if (isFirst(step)) {  // without its polygons
        readLeaf(step.cell, worker);
        bounds =
            boundStrips(strips, worker.leaf.mesh, settings_.quantisation_error, worker.leaf.bounds);
    } else {
        const CellLayer base = load(step, worker, nullptr);
        bounds = boundStrips(strips, base.triangles.mesh, base.error, base.bounds);
    }
    for (size_t i = 0; i < removed.size(); ++i)
        removals_->boundsOf(removed[i]).by[removals_->sideOf(removed[i], step.cell)] = bounds[i];
    progress_.tick(0);
}

void Builder::takeStripsOf(CellId cell) {
    const std::vector<uint32_t> removed = removedBy(cell, false);
    if (removed.empty()) return;
    CellState& state = states_.at(cell);
    std::vector<std::byte> bytes(state.bytes);
    layers_->read(state.position, bytes);
    CellLayer layer = unpackLayer(std::move(bytes));
    std::vector<float> given;
    for (const uint32_t v : removed) given.push_back(removals_->boundsOf(v).given);
    layer.error = takeStrips(stripsOf(cell, removed, true), given, layer.triangles.mesh,
                             layer.error, layer.bounds);
    for (const float bound : given) layer.error = std::max(layer.error, bound);
    state.node.error = layer.error;
    bytes = packLayer(layer);
    CHECK_EQ(bytes.size(), state.bytes);
    layers_->write(state.position, bytes);
}

/// The strips of this cell, for where it is below the layer and the other cell is not: a joint for
/// each other cell.
void Builder::addJoints(const CellStep& step, const CellLayer& base, UnitResult& result,
                        std::vector<Mesh>& joints, std::vector<Sphere>& balls,
                        Worker& worker) const {
    const PolygonMesh& polygons = base.polygons;
    std::unordered_map<uint32_t, uint32_t> vertex_of;  // by number in the table
    std::map<CellId, std::vector<uint32_t>> removed;   // by the other cell
    for (uint32_t v = 0; v < polygons.vertexCount(); ++v) {
        if (!polygons.interface_[v]) continue;
        const uint32_t number = table_->find(polygons.position[v]);
        vertex_of.emplace(number, v);
        if (removals_->isRemoved(number))
            removed[removals_->otherCell(number, step.cell)].push_back(number);
    }
    for (auto& [other, numbers] : removed) {
        std::sort(numbers.begin(), numbers.end());
        Mesh joint;
        MeshJoiner joiner;
        joiner.begin(joint, numbers.size() * 2);
        std::vector<Vec3i> points;
        for (const uint32_t number : numbers) {
            const auto [before, after] = removals_->neighbours(number, step.cell);
            Triangle triangle;
            for (size_t k = 0; k < 3; ++k) {
                const uint32_t v = vertex_of.at(k == 0 ? before : k == 1 ? after : number);
                triangle[k] = joiner.addVertex(base.triangles.mesh, v);
                points.push_back(polygons.position[v]);
            }
            joint.triangle.push_back(triangle);
            joint.edge_class.push_back(0);
        }
        Node node = describe(joint, base.closed, worker);
        // The same for both sides.
        std::sort(points.begin(), points.end(),
                  [](const Vec3i& a, const Vec3i& b) { return latticeKey(a) < latticeKey(b); });
        points.erase(std::unique(points.begin(), points.end()), points.end());
        node.bounds = enclosingBall(std::span<const Vec3i>(points));
        node.is_joint = true;
        const auto at = std::lower_bound(
            steps_.begin(), steps_.end(), other, [](const CellStep& s, CellId cell) {
                return cell != 1 && (s.cell == 1 || firstPath(s.cell) < firstPath(cell));
            });
        CHECK(at != steps_.end() && at->cell == other);
        node.group = groups_ + uint32_t(at - steps_.begin());
        balls.push_back(node.bounds);
        result.nodes.push_back(node);
        joints.push_back(std::move(joint));
    }
}

void Builder::runStep(size_t index, UnitResult& result, std::vector<Mesh>& patches,
                      std::vector<Mesh>& joints) {
    const CellStep& step = steps_[index];
    Worker& worker = workers_.local();
    std::vector<CellLayer> below;
    CellLayer base = load(step, worker, &below);
    const NodeIndex first = NodeIndex(result.nodes.size());
    std::vector<Sphere> spheres;
    float face_size = 0;
    for (const CellId cell : step.below) {
        result.nodes.push_back(isFirst(step) ? leafNode(step, base, worker) : below_.at(cell).node);
        spheres.push_back(result.nodes.back().saturated);
        face_size = std::max(face_size, result.nodes.back().face_size);
    }
    const float error = base.error;
    addJoints(step, base, result, joints, spheres, worker);
    LayerStep next = makeLayer(step, base);
    StripsOfCell strips;
    const std::vector<uint32_t> given = removedBy(step.cell, true);
    const std::vector<uint32_t> taken = removedBy(step.cell, false);
    strips.given = stripsOf(step.cell, given, false);
    strips.taken = stripsOf(step.cell, taken, true);
    for (const uint32_t v : taken) strips.taken_bound.push_back(removals_->boundsOf(v).strip());
    FaceBounds bounds = base.bounds;
    std::vector<float> given_bound;
    float bound = boundLayer(base.triangles.mesh, error, next.triangles.mesh, next.triangle_map,
                             strips, worker.deviation, bounds, given_bound);
    for (const uint32_t v : removals_->removedFrom(step.cell))
        bound = std::max(bound, removals_->boundsOf(v).strip());
    for (size_t i = 0; i < given.size(); ++i) {
        Removals::StripBounds& told = removals_->boundsOf(given[i]);
        told.given = given_bound[i];
        bound = std::max(bound, told.given);
    }
    CellLayer layer = carryOver(base, std::move(next.polygons), std::move(next.triangles));
    layer.bounds = std::move(bounds);
    layer.joined = base.joined;
    layer.error = bound;

    Finished done{step.cell, {}};
    Node& node = done.state.node;
    node = describe(layer.triangles.mesh, layer.closed, worker);
    spheres.push_back(node.bounds);
    node.saturated = enclosingBall(spheres);
    node.error = layer.error;
    node.face_size = std::max(face_size, faceSize(layer.polygons));
    node.group = groups_ + uint32_t(index);
    node.child_range = true;
    node.child[0] = first;
    node.child[1] = NodeIndex(result.nodes.size() - 1);
    const std::vector<std::byte> packed = packLayer(layer);
    done.state.position = layers_->append(packed);
    done.state.bytes = packed.size();
    result.finished.push_back(done);
    result.triangles += base.triangles.mesh.triangleCount();
    if (below.empty()) patches.push_back(std::move(base.triangles.mesh));
    for (CellLayer& one : below) patches.push_back(std::move(one.triangles.mesh));
}

UnitResult Builder::runUnit(const Unit& unit) {
    UnitResult result;
    std::vector<std::vector<Mesh>> patches(unit.end - unit.first), joints(patches.size());
    std::vector<const Mesh*> meshes;
    for (size_t i = 0; i < patches.size(); ++i) {
        runStep(unit.first + i, result, patches[i], joints[i]);
        for (const Mesh& patch : patches[i]) meshes.push_back(&patch);
        for (const Mesh& joint : joints[i]) meshes.push_back(&joint);
    }
    result.page = encodePage(meshes, page_settings_);
    progress_.tick(result.triangles);
    return result;
}

void Builder::write(UnitResult& result) {
    for (const Node& node : result.nodes) counts_.triangles += node.triangles;
    writer_.addPage(result.page, result.nodes);
    for (auto& [cell, state] : result.finished) {
        for (NodeIndex& child : state.node.child) child += nodes_in_level_;
        states_.emplace(cell, state);
    }
    nodes_in_level_ += NodeIndex(result.nodes.size());
}

void Builder::writeTop() {
    CHECK_EQ(below_.size(), size_t(1));
    auto& [cell, state] = *below_.begin();
    std::vector<std::byte> bytes(state.bytes);
    layers_below_->read(state.position, bytes);
    const CellLayer layer = unpackLayer(std::move(bytes));
    const Mesh* mesh = &layer.triangles.mesh;
    writer_.beginLevel(0);
    writer_.addPage(encodePage({&mesh, 1}, page_settings_), {&state.node, 1});
    counts_.triangles += state.node.triangles;
    counts_.levels = uint32_t(octree_.topLayer()) + 1;
}

}  // namespace

BuilderCounts buildLayers(Construction& work, const BuilderSettings& settings, Progress& progress) {
    return Builder(work, settings, progress).run();
}

}  // namespace pietra::cluster
