#include "io/gltf_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

#include "base/error.h"
#include "io/gltf_column.h"
#include "io/notes.h"

namespace pietra {

namespace {

/// No scene has more triangles or vertices: more than Pietra could ever work through.
constexpr uint64_t kMost = uint64_t(1) << 40;

/// The nodes of the scene with their matrices: each at most once, for they form trees.
class NodeWalk {
public:
    NodeWalk(const GltfDocument& document, const std::string& path)
        : document_(document), path_(path), seen_(document.nodes.size(), false) {}

    std::vector<GltfInstance> instances() {
        if (document_.nodes.empty()) {
            for (uint32_t i = 0; i < document_.meshes.size(); ++i) add(i, glm::dmat4(1));
        } else if (document_.scenes.empty()) {
            walkAll();
        } else {
            const uint64_t scene = document_.scene.value_or(0);
            if (scene >= document_.scenes.size())
                fail("scene", fmt::format("there is no scene {}: there are {}", scene,
                                          document_.scenes.size()));
            for (const uint32_t root : document_.scenes[scene])
                walk(root, fmt::format("scenes[{}].nodes", scene));
        }
        return std::move(instances_);
    }

private:
    struct Step {
        uint32_t node;
        glm::dmat4 parent;
    };

    [[noreturn]] void fail(const std::string& place, const std::string& what) const {
        throw InputError(path_, place, what);
    }

    void walkAll() {
        std::vector<bool> is_child(document_.nodes.size(), false);
        for (const GltfNode& node : document_.nodes)
            for (const uint32_t child : node.children)
                if (child < is_child.size()) is_child[child] = true;
        for (uint32_t i = 0; i < is_child.size(); ++i)
            if (!is_child[i]) walk(i, "nodes");
        for (size_t i = 0; i < seen_.size(); ++i)
            if (!seen_[i]) fail(fmt::format("nodes[{}]", i), "is below itself");
    }

    void walk(uint32_t root, const std::string& user) {
        visit(root, user);
        std::vector<Step> steps{{root, glm::dmat4(1)}};
        while (!steps.empty()) {
            const Step step = steps.back();
            steps.pop_back();
            const GltfNode& node = document_.nodes[step.node];
            const glm::dmat4 matrix =
                node.transform == kGltfNone
                    ? step.parent
                    : times(step.parent, document_.transforms[node.transform]);
            const std::string place = fmt::format("nodes[{}]", step.node);
            if (node.mesh != kGltfNone) {
                if (node.mesh >= document_.meshes.size())
                    fail(place + ".mesh", fmt::format("there is no mesh {}: there are {}",
                                                      node.mesh, document_.meshes.size()));
                add(node.mesh, matrix);
            }
            for (size_t i = node.children.size(); i-- > 0;) {
                visit(node.children[i], place + ".children");
                steps.push_back({node.children[i], matrix});
            }
        }
    }

    void visit(uint32_t node, const std::string& user) {
        if (node >= seen_.size())
            fail(user, fmt::format("there is no node {}: there are {}", node, seen_.size()));
        if (seen_[node])
            fail(user, fmt::format("node {} has another parent, or is below itself", node));
        seen_[node] = true;
    }

    /// A product of two matrices whose last row is 0 0 0 1, in a fixed order of operations.
    static glm::dmat4 times(const glm::dmat4& a, const glm::dmat4& b) {
        glm::dmat4 out(1);
        for (int column = 0; column < 4; ++column)
            for (int row = 0; row < 3; ++row)
                out[column][row] = a[0][row] * b[column][0] + a[1][row] * b[column][1] +
                                   a[2][row] * b[column][2] + (column == 3 ? a[3][row] : 0);
        return out;
    }

    void add(uint32_t mesh, const glm::dmat4& matrix) {
        instances_.push_back({.mesh = mesh, .first_vertex = 0, .matrix = matrix});
    }

    const GltfDocument& document_;
    const std::string& path_;
    std::vector<bool> seen_;
    std::vector<GltfInstance> instances_;
};

class SceneBuilder {
public:
    SceneBuilder(const GltfDocument& document, GltfBuffers& buffers)
        : document_(document), buffers_(buffers) {}

    GltfScene build() {
        scene_.instances = NodeWalk(document_, buffers_.path()).instances();
        scene_.shapes.resize(document_.meshes.size());
        std::vector<bool> used(document_.meshes.size(), false);
        for (const GltfInstance& instance : scene_.instances) used[instance.mesh] = true;
        for (uint32_t i = 0; i < used.size(); ++i)
            if (used[i]) choosePrimitives(i);
        chooseSchema();
        for (Chosen& chosen : chosen_) addSurface(chosen);
        for (const Chosen& chosen : chosen_) reach(chosen);
        chosen_.clear();
        countMeshes();
        placeInstances();
        addNotes();
        buffers_.release();
        return std::move(scene_);
    }

private:
    /// A primitive that is drawn.
    struct Chosen {
        uint32_t mesh, primitive;
        uint64_t vertices, triangles;
        uint32_t set = 0;
    };
    struct Reach {
        uint64_t first, last;
    };

    const GltfPrimitive& primitiveOf(const Chosen& c) const {
        return document_.meshes[c.mesh].primitives[c.primitive];
    }
    static std::string placeOf(uint32_t mesh, size_t primitive) {
        return fmt::format("meshes[{}].primitives[{}]", mesh, primitive);
    }
    [[noreturn]] void fail(const std::string& place, const std::string& what) const {
        throw InputError(buffers_.path(), place, what);
    }

    void choosePrimitives(uint32_t mesh) {
        const auto& primitives = document_.meshes[mesh].primitives;
        for (uint32_t i = 0; i < primitives.size(); ++i) {
            const GltfPrimitive& p = primitives[i];
            if (p.mode < GltfPrimitive::kTriangles) {
                ++points_or_lines_;
            } else if (p.position == kGltfNone) {
                ++without_positions_;
            } else {
                choosePrimitive(mesh, i);
            }
        }
    }

    void choosePrimitive(uint32_t mesh, uint32_t number) {
        const GltfPrimitive& p = document_.meshes[mesh].primitives[number];
        const std::string place = placeOf(mesh, number);
        const auto position = columnOf(p.position, place + ".attributes.POSITION");
        if (position.components() != 3) fail(place + ".attributes.POSITION", "is no VEC3");
        uint64_t corners = position.count();
        if (p.indices != kGltfNone) {
            const auto indices = columnOf(p.indices, place + ".indices");
            const GltfComponent type = indices.accessor().component;
            if (indices.components() != 1 || type == GltfComponent::kFloat ||
                type == GltfComponent::kInt8 || type == GltfComponent::kInt16)
                fail(place + ".indices", "are no unsigned whole numbers");
            corners = indices.count();
        }
        checkAttribute(p.normal, position.count(), 3, 3, place + ".attributes.NORMAL");
        checkAttribute(p.colour, position.count(), 3, 4, place + ".attributes.COLOR_0");
        const bool list = p.mode == GltfPrimitive::kTriangles;
        const uint64_t triangles = list ? corners / 3 : corners < 3 ? 0 : corners - 2;
        if (list ? corners % 3 != 0 : triangles == 0) ++with_corners_left_;
        if (triangles == 0 || position.count() == 0) return;
        // note: batches are filled from one chosen primitive after the other, so that each of them
        // must bring something.
        chosen_.push_back({mesh, number, position.count(), triangles});
    }

    GltfColumn columnOf(uint32_t accessor, const std::string& place) {
        return GltfColumn(document_, buffers_, accessor, place);
    }

    void checkAttribute(uint32_t accessor, uint64_t count, int least, int most,
                        const std::string& place) {
        if (accessor == kGltfNone) return;
        const auto column = columnOf(accessor, place);
        if (column.components() < least || column.components() > most)
            fail(place, fmt::format("has {} components", column.components()));
        if (column.count() != count)
            fail(place,
                 fmt::format("has {} elements, but there are {} positions", column.count(), count));
    }

    /// Whether a custom attribute can be a scalar of Pietra.
    bool isScalar(const std::pair<std::string, uint32_t>& attribute, const Chosen& c) {
        const std::string place =
            placeOf(c.mesh, c.primitive) + ".attributes." + attribute.first.substr(0, 80);
        const auto column = columnOf(attribute.second, place);
        if (column.components() != 1) return false;
        checkAttribute(attribute.second, c.vertices, 1, 1, place);
        return true;
    }

    /// Normals and scalars that all primitives have; colours that some have, since without them
    /// white is meant.
    void chooseSchema() {
        std::map<std::string, size_t> scalars;
        size_t normals = 0, colours = 0;
        for (const Chosen& c : chosen_) {
            const GltfPrimitive& p = primitiveOf(c);
            normals += p.normal != kGltfNone;
            colours += p.colour != kGltfNone;
            for (const auto& attribute : p.custom) {
                if (isScalar(attribute, c))
                    ++scalars[attribute.first];
                else
                    vectors_left_out_ = true;
            }
        }
        const size_t all = chosen_.size();
        scene_.schema.normals_given = all > 0 && normals == all;
        scene_.schema.colours = colours > 0;
        some_left_out_ = normals > 0 && normals < all;
        for (const auto& [name, count] : scalars) {
            if (count == all)
                names_.push_back(name);
            else
                some_left_out_ = true;
        }
        for (const std::string& name : names_) scene_.schema.scalars.push_back(name.substr(1));
    }

    void addSurface(Chosen& c) {
        const GltfPrimitive& p = primitiveOf(c);
        GltfShape& shape = scene_.shapes[c.mesh];
        GltfVertexSet set;
        set.position = p.position;
        if (scene_.schema.normals_given) set.normal = p.normal;
        set.colour = p.colour;
        for (const std::string& name : names_)
            for (const auto& [custom, accessor] : p.custom)
                if (custom == name) set.scalars.push_back(accessor);
        set.count = c.vertices;
        std::vector<uint32_t> key{c.mesh, set.position, set.normal, set.colour};
        key.insert(key.end(), set.scalars.begin(), set.scalars.end());
        const auto [known, is_new] = sets_.emplace(std::move(key), uint32_t(shape.sets.size()));
        if (is_new) {
            shape.sets.push_back(std::move(set));
            ++users_[p.position];
        }
        c.set = known->second;
        shape.surfaces.push_back({known->second, p.indices, p.mode, c.triangles});
    }

    /// Where the positions serve several meshes: widens what is used of them by what `c` reaches.
    void reach(const Chosen& c) {
        const GltfPrimitive& p = primitiveOf(c);
        if (users_[p.position] < 2) return;
        const auto reached = p.indices == kGltfNone ? std::nullopt : reachOf(p.indices);
        const Reach all{0, c.vertices - 1};
        // note: what lies beyond the end is a fault, which reading will name.
        const bool fits = reached && reached->last < c.vertices;
        const auto [at, is_new] = reach_.emplace(std::pair(c.mesh, c.set), fits ? *reached : all);
        if (is_new) return;
        at->second.first = std::min(at->second.first, fits ? reached->first : all.first);
        at->second.last = std::max(at->second.last, fits ? reached->last : all.last);
    }

    /// The smallest and the largest index; none where finding out would take too long.
    std::optional<Reach> reachOf(uint32_t accessor) {
        const auto known = reach_of_.find(accessor);
        if (known != reach_of_.end()) return known->second;
        GltfColumn column = columnOf(accessor, "indices");
        // note: accessors may overlap, so their sum is not bounded by the size of the file.
        scanned_ += column.count();
        if (scanned_ > 4 * buffers_.storedBytes()) return {};
        Reach reach{UINT64_MAX, 0};
        std::vector<uint64_t> block(column.blockRows());
        while (column.row() < column.count()) {
            const auto rows =
                size_t(std::min<uint64_t>(block.size(), column.count() - column.row()));
            column.read(rows, block.data(), 1, 1, false);
            const auto [least, most] =
                std::minmax_element(block.begin(), block.begin() + ptrdiff_t(rows));
            reach.first = std::min(reach.first, *least);
            reach.last = std::max(reach.last, *most);
        }
        reach_of_.emplace(accessor, reach);
        return reach;
    }

    void countMeshes() {
        for (const auto& [key, reach] : reach_) {
            GltfVertexSet& set = scene_.shapes[key.first].sets[key.second];
            set.first_row = reach.first;
            set.count = reach.last - reach.first + 1;
        }
        for (GltfShape& shape : scene_.shapes) {
            for (GltfVertexSet& set : shape.sets) {
                set.first_vertex = shape.vertices;
                addTo(shape.vertices, set.count);
            }
            for (const GltfSurface& surface : shape.surfaces)
                addTo(shape.triangles, surface.triangles);
        }
    }

    void placeInstances() {
        std::erase_if(scene_.instances, [&](const GltfInstance& instance) {
            return scene_.shapes[instance.mesh].triangles == 0;
        });
        for (GltfInstance& instance : scene_.instances) {
            instance.first_vertex = scene_.vertices;
            addTo(scene_.vertices, scene_.shapes[instance.mesh].vertices);
            addTo(scene_.triangles, scene_.shapes[instance.mesh].triangles);
        }
        if (scene_.instances.empty()) fail("", "has no triangles to show in its scene");
    }

    void addTo(uint64_t& sum, uint64_t count) const {
        if (count > kMost || (sum += count) > kMost)
            fail("", "its meshes and instances add up to more than 2^40 triangles or vertices");
    }

    void addNotes() {
        const auto note = [&](const std::string& text) { scene_.notes.push_back(text); };
        static constexpr const char* kNames[size_t(GltfLeftOut::kCount)] = {
            "texture coordinates", "tangents",   "second colours",
            "materials",           "textures",   "skins",
            "morph targets",       "animations", "instances of EXT_mesh_gpu_instancing"};
        std::vector<std::string> names;
        for (size_t i = 0; i < document_.left_out.size(); ++i)
            if (document_.left_out[i]) names.push_back(kNames[i]);
        if (!names.empty()) {
            note(listed(names) + " are left out");
        }
        if (!document_.unknown.empty()) note(leftOut("extension", document_.unknown));
        if (points_or_lines_ > 0)
            note(fmt::format("{} primitives of points or lines are left out", points_or_lines_));
        if (without_positions_ > 0)
            note(fmt::format("{} primitives without positions are left out", without_positions_));
        if (with_corners_left_ > 0)
            note(fmt::format("the last corners of {} primitives make no triangle and are left out",
                             with_corners_left_));
        if (some_left_out_) note("attributes that not all primitives have are left out");
        if (vectors_left_out_) note("custom attributes that are no scalars are left out");
        if (document_.scenes.size() > 1)
            note(fmt::format("{} other scenes are left out", document_.scenes.size() - 1));
    }

    const GltfDocument& document_;
    GltfBuffers& buffers_;
    GltfScene scene_;
    std::vector<Chosen> chosen_;
    std::vector<std::string> names_;  ///< of the scalars, with their underscores
    std::map<std::vector<uint32_t>, uint32_t> sets_;
    std::map<uint32_t, uint32_t> users_;                    ///< how many sets have these positions
    std::map<std::pair<uint32_t, uint32_t>, Reach> reach_;  ///< by mesh and set
    std::map<uint32_t, Reach> reach_of_;                    ///< by accessor of indices
    uint64_t scanned_ = 0;
    size_t points_or_lines_ = 0, without_positions_ = 0, with_corners_left_ = 0;
    bool some_left_out_ = false, vectors_left_out_ = false;
};

}  // namespace

GltfScene makeGltfScene(const GltfDocument& document, GltfBuffers& buffers) {
    return SceneBuilder(document, buffers).build();
}

}  // namespace pietra
