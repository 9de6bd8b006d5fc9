#include "methods/pmesh/split_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <unordered_map>

#include "base/error.h"
#include "base/parallel.h"
#include "methods/pmesh/split_codec.h"
#include "methods/pmesh/split_faults.h"
#include "methods/pmesh/split_view.h"

namespace pietra::pmesh {
namespace {

constexpr size_t kTogether = 64;  ///< nodes read at a time

/// What a node has to know from above of each split of its frontier.
struct FromAbove {
    Leaf first;
    Vec3i position;          ///< of the unsplit vertex
    bool is_live;            ///< which is there, if all above are applied
    NestedCriterion within;  ///< of the split above
};

/// A node that is referred to.
struct Waiting {
    std::vector<FromAbove> frontier;
    std::vector<NestedCriterion> parts;  ///< SplitNode::child_parts
};

/// A set of leaves, and the place of each in it.
class LeafSet {
public:
    explicit LeafSet(size_t leaves) : bits_(leaves / 64 + 1), before_(bits_.size()) {}
    static size_t bytes(size_t leaves) { return (leaves / 64 + 1) * 12; }
    void add(Leaf leaf) { bits_[leaf / 64] |= uint64_t(1) << leaf % 64; }
    bool has(Leaf leaf) const { return (bits_[leaf / 64] >> leaf % 64 & 1) != 0; }
    /// How many there are; now they may be asked for their places.
    uint32_t count() {
        uint32_t sum = 0;
        for (size_t w = 0; w < bits_.size(); ++w) {
            before_[w] = sum;
            sum += uint32_t(std::popcount(bits_[w]));
        }
        return sum;
    }
    /// Of the last one that is not after this leaf; leaf 0 must be in the set.
    uint32_t placeOf(Leaf leaf) const {
        const uint64_t upTo = bits_[leaf / 64] << (63 - leaf % 64);
        return before_[leaf / 64] + uint32_t(std::popcount(upTo)) - 1;
    }

private:
    std::vector<uint64_t> bits_;
    std::vector<uint32_t> before_;
};

class Model : public AdaptiveModel {
public:
    explicit Model(const ModelReader& reader) : reader_(reader), forest_(openForest(reader)) {
        for (const SplitBase::Root& root : forest_.base.root) leaves_ += root.leaves;
    }

    std::string pageFault(uint32_t page) const override;
    std::string modelFault(Budget& budget) override;
    MeshCut cut(const CutRequest& request, Budget& budget) override;

private:
    /// is_applied(split, FromAbove) of every split whose vertex is there, parents first; then
    /// visit(node, slot, FromAbove, whether it is, the parts of the frontier it is in).
    template <class IsApplied, class Visit>
    void walk(Budget& budget, IsApplied&& is_applied, Visit&& visit) const;
    NestedCriterion criterionOf(const VertexSplit& split, const FromAbove& from) const {
        return split.criterion.at(from.position, forest_.grid);
    }
    float errorOf(uint16_t error) const {
        return NestedCriterion::errorOf(error) * float(forest_.grid.unit(forest_.lattice));
    }
    uint16_t errorFor(uint64_t max_triangles, Budget& budget) const;

    const ModelReader& reader_;
    const SplitForest forest_;
    Leaf leaves_ = 0;
};

template <class IsApplied, class Visit>
void Model::walk(Budget& budget, IsApplied&& is_applied, Visit&& visit) const {
    std::unordered_map<NodeIndex, Waiting> waiting;
    std::vector<Reservation> memory;
    size_t references = 0, reserved = 0;
    Leaf first = 0;
    for (const SplitBase::Root& root : forest_.base.root) {
        if (root.split != kNoSplit) {
            const NodeIndex n = nodeOfSplit(root.split);
            waiting[n].frontier.push_back(
                {first, root.vertex.position, true, forest_.row[n].criterion});
            ++references;
        }
        first += root.leaves;
    }
    std::vector<NodeIndex> level;
    for (const auto& [n, from] : waiting) level.push_back(n);
    while (!level.empty()) {
        std::sort(level.begin(), level.end());
        std::vector<NodeIndex> next;
        size_t taken = 0;
        orderedPipeline(
            level.size(), kTogether,
            [&](size_t i) {
                SplitNode node;
                if (const std::string fault = readNode(reader_, forest_, level[i], node);
                    !fault.empty())
                    throw InputError::atByte(reader_.path(), reader_.page(level[i]).offset, fault);
                return node;
            },
            [&](const SplitNode& node) {
                const NodeIndex n = level[taken++];
                const SplitRow& row = forest_.row[n];
                Waiting above = std::move(waiting.at(n));
                waiting.erase(n);
                std::vector<FromAbove>& from = above.frontier;
                references -= from.size();
                if (from.size() != node.frontier)
                    throw InputError::atByte(reader_.path(), reader_.page(n).offset,
                                             "it does not fit its parent");
                from.resize(node.split.size());
                std::array<std::vector<FromAbove>, 2> below;
                std::array<bool, 2> any_live{};
                for (uint32_t s = 0; s < node.split.size(); ++s) {
                    const VertexSplit& split = node.split[s];
                    const Leaf name = from[s].first + split.leaves[0];
                    if (name >= leaves_)
                        throw InputError::atByte(reader_.path(), reader_.page(n).offset,
                                                 "it has too many leaves");
                    const bool applied = from[s].is_live && is_applied(split, from[s]);
                    const NestedCriterion own = criterionOf(split, from[s]);
                    if (from[s].is_live)
                        visit(node, s, from[s], applied,
                              s < node.frontier ? std::span<const NestedCriterion>(above.parts)
                                                : std::span<const NestedCriterion>());
                    for (const size_t end : {0u, 1u}) {
                        if (split.child[end] == kNoChildSplit) continue;
                        const FromAbove child{end == 0 ? from[s].first : name,
                                              from[s].position + split.offset[end], applied, own};
                        const size_t where = split.child[end] / kSplitSlots;
                        if (where == 0) {
                            from[split.child[end]] = child;
                        } else {
                            below[where - 1].push_back(child);
                            any_live[where - 1] |= applied;
                        }
                    }
                }
                for (const size_t side : {0u, 1u})
                    if (any_live[side]) {
                        references += below[side].size();
                        next.push_back(row.child[side]);
                        waiting[row.child[side]] = {std::move(below[side]), node.child_parts[side]};
                    }
                constexpr size_t kMore = 1 << 12;
                for (; references > reserved; reserved += kMore)
                    memory.push_back(budget.reserve(kMore * sizeof(FromAbove),
                                                    "the nodes of a progressive mesh"));
            });
        level = std::move(next);
    }
}

std::string Model::pageFault(uint32_t page) const {
    const NodeIndex n = page;
    SplitNode node, child;
    if (std::string fault = readNode(reader_, forest_, n, node); !fault.empty()) return fault;
    for (const NodeIndex c : forest_.row[n].child) {
        // A child that cannot be read is its own page's fault.
        if (c == kNoNode || !readNode(reader_, forest_, c, child).empty()) continue;
        if (const std::string fault = faultBetween(forest_.row[n], node, c, child); !fault.empty())
            return fmt::format("node {}, which it refers to: {}", c, fault);
    }
    return "";
}

std::string Model::modelFault(Budget& budget) {
    std::string fault;
    uint64_t splits = 0;
    walk(
        budget, [](const VertexSplit&, const FromAbove&) { return true; },
        [&](const SplitNode& node, uint32_t s, const FromAbove& from, bool,
            std::span<const NestedCriterion> parts) {
            const VertexSplit& split = node.split[s];
            ++splits;
            for (const size_t side : {0u, 1u}) {
                const int64_t w = int64_t(from.first) + split.leaves[0] + split.corner[side].w;
                if ((split.brings >> side & 1) && (w < 0 || w >= int64_t(leaves_)))
                    fault = "a triangle has a corner that is no leaf";
            }
            const NestedCriterion own = criterionOf(split, from);
            if (!from.within.encloses(own))
                fault = "a split's criterion exceeds that of the one above";
            if (!parts.empty() &&
                std::none_of(parts.begin(), parts.end(),
                             [&](const NestedCriterion& part) { return part.encloses(own); }))
                fault = "a split's criterion exceeds what its node's parent states";
        });
    uint64_t expected = 0;
    for (const SplitRow& row : forest_.row) expected += row.splits;
    if (fault.empty() && splits != expected)
        fault = fmt::format("{} of its {} splits are referred to", splits, expected);
    return fault;
}

/// The least error of which a cut has no more triangles: what states more is applied.
uint16_t Model::errorFor(uint64_t max_triangles, Budget& budget) const {
    std::vector<uint64_t> brought(size_t(NestedCriterion::kEver) + 1);
    walk(
        budget, [](const VertexSplit&, const FromAbove&) { return true; },
        [&](const SplitNode& node, uint32_t s, const FromAbove&, bool,
            std::span<const NestedCriterion>) {
            const VertexSplit& split = node.split[s];
            brought[split.criterion.error] += (split.brings & 1u) + (split.brings >> 1 & 1u);
        });
    uint64_t triangles = forest_.base.triangle.size();
    uint16_t error = NestedCriterion::kEver;
    for (; error > 0; --error) {
        triangles += brought[error];
        if (triangles > max_triangles) break;
    }
    return error;
}

MeshCut Model::cut(const CutRequest& request, Budget& budget) {
    const auto finest = double(reader_.info().quantisation_error);
    SplitView view = wholeSplitView(true);
    if (request.view && request.pixels > 0)
        view = splitView(*request.view, forest_.lattice, forest_.grid, request.pixels,
                         reader_.info().bounds);
    // What states more is applied, if the view needs it.
    uint16_t least = 0;
    double least_error = -1;
    if (request.max_triangles)
        least = errorFor(*request.max_triangles, budget);
    else if (request.max_error)
        least_error = *request.max_error - finest;
    const bool by_view = request.view.has_value() && !request.max_triangles && request.pixels > 0;
    const auto needs = [&](const VertexSplit& split, const FromAbove& from) {
        if (by_view) return view.needs(criterionOf(split, from));
        const uint16_t error = split.criterion.error;
        return error > least && double(errorOf(error)) > least_error;
    };

    constexpr const char* kWhat = "a cut of a progressive mesh";
    const Reservation for_set = budget.reserve(LeafSet::bytes(leaves_), kWhat);
    LeafSet active(leaves_);
    Leaf first = 0;
    for (const SplitBase::Root& root : forest_.base.root) {
        active.add(first);
        first += root.leaves;
    }
    size_t triangles = forest_.base.triangle.size();
    using Parts = std::span<const NestedCriterion>;
    walk(budget, needs,
         [&](const SplitNode& node, uint32_t s, const FromAbove& from, bool applied, Parts) {
             if (!applied) return;
             const VertexSplit& split = node.split[s];
             active.add(from.first + split.leaves[0]);
             triangles += (split.brings & 1u) + (split.brings >> 1 & 1u);
         });
    const size_t vertices = leaves_ > 0 ? active.count() : 0;
    const WordLayout layout = forest_.layout;
    const Reservation for_mesh = budget.reserve(
        vertices * (sizeof(Vec3i) + sizeof(OctNormal) + 4 * layout.words() + sizeof(uint16_t)) +
            triangles * (sizeof(Triangle) + sizeof(float) + 1),
        kWhat);
    MeshCut cut;
    Mesh& mesh = cut.mesh;
    mesh.position.resize(vertices);
    mesh.normal.resize(vertices);
    mesh.colour.resize(vertices * layout.colours);
    mesh.scalar.resize(vertices * layout.scalars);
    mesh.triangle.reserve(triangles);
    std::vector<uint16_t> next_error(vertices, 0);
    const auto put = [&](Leaf leaf, const Vec3i& position, uint16_t normal,
                         std::span<const uint32_t> words) {
        const uint32_t v = active.placeOf(leaf);
        mesh.position[v] = position * (1 << forest_.lattice.shift);
        mesh.normal[v] = unpackNormal(normal);
        if (layout.words() > 0) setVertex(words, layout, mesh, v);
    };
    first = 0;
    for (size_t r = 0; r < forest_.base.root.size(); ++r) {
        const SplitBase::Root& root = forest_.base.root[r];
        put(first, root.vertex.position, root.vertex.normal,
            std::span(forest_.base.word).subspan(r * layout.words(), layout.words()));
        first += root.leaves;
    }
    for (const auto& t : forest_.base.triangle)
        mesh.triangle.push_back({active.placeOf(t[0]), active.placeOf(t[1]), active.placeOf(t[2])});
    // Parents first: of what is put in one place the last one stays.
    walk(
        budget,
        [&](const VertexSplit& split, const FromAbove& from) {
            return active.has(from.first + split.leaves[0]);
        },
        [&](const SplitNode& node, uint32_t s, const FromAbove& from, bool applied, Parts) {
            const VertexSplit& split = node.split[s];
            if (!applied) {
                next_error[active.placeOf(from.first)] = split.criterion.error;
                return;
            }
            const Leaf name = from.first + split.leaves[0];
            const auto words = std::span(node.word);
            for (const size_t end : {0u, 1u})
                put(end == 0 ? from.first : name, from.position + split.offset[end],
                    split.normal[end],
                    words.subspan((2 * size_t(s) + end) * layout.words(), layout.words()));
            for (const size_t side : {0u, 1u}) {
                if ((split.brings >> side & 1) == 0) continue;
                const VertexSplit::Corners& c = split.corner[side];
                const Leaf w = name + uint32_t(c.w);
                if (w >= leaves_)
                    throw InputError(reader_.path(), "",
                                     "the model is damaged: a corner is no leaf");
                const uint32_t v = active.placeOf(from.first + c.v), u = active.placeOf(name + c.u);
                mesh.triangle.push_back({side == 0 ? v : u, side == 0 ? u : v, active.placeOf(w)});
            }
        });
    mesh.edge_class.assign(mesh.triangleCount(), 0);
    cut.max_error = finest;
    for (const Triangle& t : mesh.triangle) {
        const uint16_t error = std::max({next_error[t[0]], next_error[t[1]], next_error[t[2]]});
        const double stated = double(errorOf(error)) + finest;
        cut.max_error = std::max(cut.max_error, stated);
        cut.error.push_back(float(stated));
    }
    cut.below_finest = request.max_error && cut.max_error > *request.max_error;
    cut.over_budget = request.max_triangles && mesh.triangleCount() > *request.max_triangles;
    return cut;
}

}  // namespace

SplitForest openForest(const ModelReader& reader) {
    const uint32_t format = reader.identity().method_format;
    if (format != kMethodFormat)
        throw InputError(reader.path(), "",
                         fmt::format("version {} of pmesh cannot be read by this program, which "
                                     "reads version {}: build it again",
                                     format, kMethodFormat));
    const auto damaged = [&](const std::string& what) {
        throw InputError(reader.path(), "", "the model is damaged: " + what);
    };
    SplitForest forest;
    forest.lattice = reader.info().lattice;
    forest.layout = WordLayout::of(reader.info().schema);
    forest.row = rowsOf(reader.nodes());
    if (reader.pageCount() != forest.row.size()) damaged("a page has several nodes");
    std::string fault;
    if (!decodeSplitBase(reader.methodSection(), forest, fault)) damaged("its base mesh: " + fault);
    setCriteria(reader.nodes(), forest.lattice, forest.grid, forest.row);
    return forest;
}

std::string readNode(const ModelReader& reader, const SplitForest& forest, NodeIndex index,
                     SplitNode& node) {
    thread_local std::vector<std::byte> bytes;
    std::string fault;
    if (!reader.tryReadPage(index, bytes, fault)) return fault;
    if (decodeSplitNode(bytes, forest.row[index], forest.layout, node, fault)) return "";
    return fmt::format("page {} is damaged: {}", index, fault);
}

std::unique_ptr<AdaptiveModel> openModel(const ModelReader& reader) {
    return std::make_unique<Model>(reader);
}

}  // namespace pietra::pmesh
