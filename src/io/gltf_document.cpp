#include "io/gltf_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/gltf_text.h"
#include "io/notes.h"

namespace pietra {

namespace {

using Json = nlohmann::json;

/// Extensions that change nothing but looks, or nothing that Pietra would read otherwise.
constexpr std::string_view kHarmless[] = {"KHR_mesh_quantization", "KHR_lights_punctual",
                                          "KHR_animation_pointer", "KHR_xmp",
                                          "EXT_mesh_features",     "EXT_structural_metadata"};
constexpr std::string_view kHarmlessPrefixes[] = {"KHR_materials_", "KHR_texture_", "EXT_texture_",
                                                  "MSFT_texture_",  "EXT_lights_",  "KHR_xmp_"};

/// Has a note of its own.
constexpr const char* kInstances = "EXT_mesh_gpu_instancing";

bool isHarmless(const std::string& extension) {
    return std::find(std::begin(kHarmless), std::end(kHarmless), extension) !=
               std::end(kHarmless) ||
           std::any_of(std::begin(kHarmlessPrefixes), std::end(kHarmlessPrefixes),
                       [&](std::string_view prefix) { return extension.starts_with(prefix); });
}

/// An object of the JSON and where it stands.
class Item {
public:
    Item(const std::string& file, std::string place, const Json& object)
        : file_(file), place_(std::move(place)), object_(object) {
        if (!object.is_object()) fail("", "is no object");
    }

    const Json* find(const char* key) const {
        const auto at = object_.find(key);
        return at == object_.end() ? nullptr : &*at;
    }
    const Json& get(const char* key) const {
        const Json* value = find(key);
        if (!value) fail(key, "is missing");
        return *value;
    }
    /// A whole number that is not negative.
    uint64_t whole(const char* key, const Json& value) const {
        if (value.is_number_unsigned()) return value.get<uint64_t>();
        if (value.is_number_float()) {  // some write 24.0
            const auto real = value.get<double>();
            if (real >= 0 && real <= 0x1p53 && real == std::floor(real)) return uint64_t(real);
        }
        fail(key, "is no whole number");
    }
    uint64_t whole(const char* key) const { return whole(key, get(key)); }
    uint64_t wholeOr(const char* key, uint64_t otherwise) const {
        const Json* value = find(key);
        return value ? whole(key, *value) : otherwise;
    }
    uint32_t index(const char* key, const Json& value) const {
        const uint64_t i = whole(key, value);
        if (i >= kGltfNone) fail(key, fmt::format("index {} is out of range", i));
        return uint32_t(i);
    }
    uint32_t index(const char* key) const { return index(key, get(key)); }
    uint32_t indexOrNone(const char* key) const {
        const Json* value = find(key);
        return value ? index(key, *value) : kGltfNone;
    }
    std::vector<uint32_t> indices(const char* key) const {
        std::vector<uint32_t> out;
        const Json* values = find(key);
        if (!values) return out;
        if (!values->is_array()) fail(key, "is no array");
        for (const Json& value : *values) out.push_back(index(key, value));
        return out;
    }
    const std::string& text(const char* key, const Json& value) const {
        if (!value.is_string()) fail(key, "is no text");
        return value.get_ref<const std::string&>();
    }
    template <size_t N>
    std::array<double, N> reals(const char* key, const std::array<double, N>& otherwise) const {
        const Json* values = find(key);
        if (!values) return otherwise;
        if (!values->is_array() || values->size() != N)
            fail(key, fmt::format("is no array of {} numbers", N));
        std::array<double, N> out;
        for (size_t i = 0; i < N; ++i) {
            if (!(*values)[i].is_number()) fail(key, fmt::format("is no array of {} numbers", N));
            out[i] = (*values)[i].template get<double>();
        }
        return out;
    }
    Item inner(const char* key) const { return {file_, placeOf(key), get(key)}; }
    std::string placeOf(const std::string& key) const {
        return key.empty() ? place_ : place_ + "." + key;
    }
    const std::string& file() const { return file_; }
    const Json& object() const { return object_; }

    [[noreturn]] void fail(const std::string& key, const std::string& what) const {
        throw InputError(file_, placeOf(key), what);
    }

private:
    const std::string& file_;
    std::string place_;
    const Json& object_;
};

GltfComponent componentOf(const Item& item) {
    const uint64_t type = item.whole("componentType");
    for (const auto known : {GltfComponent::kInt8, GltfComponent::kUint8, GltfComponent::kInt16,
                             GltfComponent::kUint16, GltfComponent::kUint32, GltfComponent::kFloat})
        if (type == uint64_t(known)) return known;
    item.fail("componentType", fmt::format("{} is none of glTF", type));
}

glm::dmat4 transformOf(const Item& item) {
    glm::dmat4 m(1);
    if (item.find("matrix")) {
        const auto values = item.reals<16>("matrix", {});
        for (int i = 0; i < 16; ++i) m[i / 4][i % 4] = values[i];  // column by column
        if (m[0][3] != 0 || m[1][3] != 0 || m[2][3] != 0 || m[3][3] != 1)
            item.fail("matrix", "its last row is not 0 0 0 1");
        return m;
    }
    const auto [x, y, z, w] = item.reals<4>("rotation", {0, 0, 0, 1});
    const auto scale = item.reals<3>("scale", {1, 1, 1});
    const auto translation = item.reals<3>("translation", {0, 0, 0});
    const double length_sq = x * x + y * y + z * z + w * w;
    if (!(length_sq > 0) || !std::isfinite(length_sq)) item.fail("rotation", "is no quaternion");
    const double s = 2 / length_sq;
    m[0] = {1 - s * (y * y + z * z), s * (x * y + w * z), s * (x * z - w * y), 0};
    m[1] = {s * (x * y - w * z), 1 - s * (x * x + z * z), s * (y * z + w * x), 0};
    m[2] = {s * (x * z + w * y), s * (y * z - w * x), 1 - s * (x * x + y * y), 0};
    for (int k = 0; k < 3; ++k) m[k] *= scale[k];
    m[3] = {translation[0], translation[1], translation[2], 1};
    return m;
}

/// Takes what the parser brings, object by object.
class DocumentBuilder {
public:
    explicit DocumentBuilder(const std::string& file) : file_(file) {}

    /// A callback of the parser; false: the value need not be kept.
    bool onEvent(int depth, Json::parse_event_t event, const Json& value) {
        using Event = Json::parse_event_t;
        if (event == Event::key && depth == 1) {
            section_ = value.get<std::string>();
            table_ = tableOf(section_);
            entry_ = 0;
            if (section_ == "materials") leaveOut(GltfLeftOut::kMaterials);
            if (section_ == "textures") leaveOut(GltfLeftOut::kTextures);
            if (section_ == "skins") leaveOut(GltfLeftOut::kSkins);
            if (section_ == "animations") leaveOut(GltfLeftOut::kAnimations);
            return table_ || section_ == "asset" || section_ == "scene" ||
                   section_ == "extensionsRequired" || section_ == "extensionsUsed";
        }
        if (depth == 0 && (event == Event::value || event == Event::array_start))
            throw InputError(file_, "", "its JSON is no object");
        const bool starts = event == Event::object_start || event == Event::array_start;
        if (depth == 1 && !starts && event != Event::key) return onSection(event, value);
        if (depth == 2 && !starts && event != Event::key) return onEntry(value);
        return true;
    }

    GltfDocument finish() {
        if (!has_version_) throw InputError(file_, "asset.version", "is missing");
        return std::move(document_);
    }

private:
    using Table = void (DocumentBuilder::*)(const Item&);

    static Table tableOf(const std::string& section) {
        struct Row {
            const char* name;
            Table table;
        };
        static constexpr Row kRows[] = {{"buffers", &DocumentBuilder::addBuffer},
                                        {"bufferViews", &DocumentBuilder::addView},
                                        {"accessors", &DocumentBuilder::addAccessor},
                                        {"meshes", &DocumentBuilder::addMesh},
                                        {"nodes", &DocumentBuilder::addNode},
                                        {"scenes", &DocumentBuilder::addScene}};
        for (const Row& row : kRows)
            if (section == row.name) return row.table;
        return nullptr;
    }

    bool onSection(Json::parse_event_t event, const Json& value) {
        if (table_ && event != Json::parse_event_t::array_end)
            throw InputError(file_, section_, "is no array");
        if (section_ == "asset") {
            const Item asset(file_, section_, value);
            const std::string& version = asset.text("version", asset.get("version"));
            if (!version.starts_with("2."))
                asset.fail("version",
                           fmt::format("Pietra reads glTF 2, not \"{}\"", printable(version)));
            has_version_ = true;
        } else if (section_ == "scene") {
            if (!value.is_number_unsigned()) throw InputError(file_, section_, "is no index");
            document_.scene = value.get<uint64_t>();
        }
        return false;
    }

    bool onEntry(const Json& value) {
        if (table_) {
            (this->*table_)(Item(file_, fmt::format("{}[{}]", section_, entry_++), value));
            return false;
        }
        const bool required = section_ == "extensionsRequired";
        if (!value.is_string() || (!required && section_ != "extensionsUsed")) return true;
        const auto& name = value.get_ref<const std::string&>();
        if (isHarmless(name)) return false;
        if (required)
            throw InputError(file_, section_,
                             fmt::format("Pietra does not know the extension {}, without which "
                                         "the file cannot be read",
                                         printable(name)));
        if (name != kInstances) document_.unknown.push_back(name);
        return false;
    }

    void leaveOut(GltfLeftOut what) { document_.left_out[size_t(what)] = true; }

    void addBuffer(const Item& item) {
        GltfBuffer buffer;
        buffer.bytes = item.whole("byteLength");
        if (const Json* uri = item.find("uri")) buffer.uri = item.text("uri", *uri);
        document_.buffers.push_back(std::move(buffer));
    }

    void addView(const Item& item) {
        GltfView view;
        view.buffer = item.index("buffer");
        view.offset = item.wholeOr("byteOffset", 0);
        view.bytes = item.whole("byteLength");
        const uint64_t stride = item.wholeOr("byteStride", 0);
        if (stride > UINT16_MAX) item.fail("byteStride", fmt::format("{} is too large", stride));
        view.stride = uint32_t(stride);
        document_.views.push_back(view);
    }

    void addAccessor(const Item& item) {
        GltfAccessor accessor;
        accessor.view = item.indexOrNone("bufferView");
        accessor.offset = item.wholeOr("byteOffset", 0);
        accessor.count = item.whole("count");
        accessor.component = componentOf(item);
        if (const Json* normalized = item.find("normalized"))
            accessor.normalized = normalized->is_boolean() && normalized->get<bool>();
        const std::string& type = item.text("type", item.get("type"));
        const char* const kTypes[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
        for (int i = 0; i < 4; ++i)
            if (type == kTypes[i]) accessor.components = uint8_t(i + 1);
        if (accessor.components == 0 && !type.starts_with("MAT"))
            item.fail("type", fmt::format("\"{}\" is none of glTF", printable(type)));
        if (item.find("sparse")) {
            accessor.sparse = uint32_t(document_.sparse.size());
            document_.sparse.push_back(sparseOf(item.inner("sparse")));
        }
        document_.accessors.push_back(accessor);
    }

    static GltfSparse sparseOf(const Item& item) {
        GltfSparse sparse;
        sparse.count = item.whole("count");
        const Item indices = item.inner("indices"), values = item.inner("values");
        sparse.index_view = indices.index("bufferView");
        sparse.index_offset = indices.wholeOr("byteOffset", 0);
        sparse.index_component = componentOf(indices);
        sparse.value_view = values.index("bufferView");
        sparse.value_offset = values.wholeOr("byteOffset", 0);
        return sparse;
    }

    void addMesh(const Item& item) {
        const Json& primitives = item.get("primitives");
        if (!primitives.is_array()) item.fail("primitives", "is no array");
        GltfMesh mesh;
        for (size_t i = 0; i < primitives.size(); ++i)
            mesh.primitives.push_back(primitiveOf(
                Item(file_, item.placeOf(fmt::format("primitives[{}]", i)), primitives[i])));
        document_.meshes.push_back(std::move(mesh));
    }

    GltfPrimitive primitiveOf(const Item& item) {
        GltfPrimitive primitive;
        const uint64_t mode = item.wholeOr("mode", GltfPrimitive::kTriangles);
        if (mode > GltfPrimitive::kFan) item.fail("mode", fmt::format("{} is none of glTF", mode));
        primitive.mode = uint8_t(mode);
        primitive.indices = item.indexOrNone("indices");
        const Item attributes = item.inner("attributes");
        primitive.position = attributes.indexOrNone("POSITION");
        primitive.normal = attributes.indexOrNone("NORMAL");
        primitive.colour = attributes.indexOrNone("COLOR_0");
        for (const auto& [name, value] : attributes.object().items()) {
            if (name.starts_with("_"))
                primitive.custom.emplace_back(name, attributes.index(name.c_str(), value));
            else if (name.starts_with("TEXCOORD_"))
                leaveOut(GltfLeftOut::kTextureCoordinates);
            else if (name == "TANGENT")
                leaveOut(GltfLeftOut::kTangents);
            else if (name.starts_with("COLOR_") && name != "COLOR_0")
                leaveOut(GltfLeftOut::kMoreColours);
        }
        const Json* targets = item.find("targets");
        if (targets && !targets->empty()) leaveOut(GltfLeftOut::kMorphTargets);
        return primitive;
    }

    void addNode(const Item& item) {
        GltfNode node;
        node.mesh = item.indexOrNone("mesh");
        node.children = item.indices("children");
        for (const char* key : {"matrix", "translation", "rotation", "scale"}) {
            if (!item.find(key)) continue;
            node.transform = uint32_t(document_.transforms.size());
            document_.transforms.push_back(transformOf(item));
            break;
        }
        const Json* extensions = item.find("extensions");
        if (extensions && extensions->is_object() && extensions->contains(kInstances))
            leaveOut(GltfLeftOut::kGpuInstances);
        document_.nodes.push_back(std::move(node));
    }

    void addScene(const Item& item) { document_.scenes.push_back(item.indices("nodes")); }

    const std::string& file_;
    GltfDocument document_;
    std::string section_;  ///< the key at the top that the parser is in
    Table table_ = nullptr;
    size_t entry_ = 0;
    bool has_version_ = false;
};

}  // namespace

size_t bytesOf(GltfComponent component) {
    switch (component) {
        case GltfComponent::kInt8:
        case GltfComponent::kUint8:
            return 1;
        case GltfComponent::kInt16:
        case GltfComponent::kUint16:
            return 2;
        default:
            return 4;
    }
}

std::string GltfDocument::whyMissing() const {
    if (unknown.empty()) return "";
    return fmt::format(" (the file uses {}, which Pietra does not know)", listed(unknown));
}

GltfDocument readGltfDocument(ByteReader& reader, uint64_t begin, uint64_t end) {
    GltfText text(reader, begin, end);
    DocumentBuilder builder(reader.path());
    try {
        const auto onEvent = [&](int depth, Json::parse_event_t event, Json& value) {
            return builder.onEvent(depth, event, value);
        };
        // note: hardly anything is left of the root by then.
        const Json root = Json::parse(text.begin(), text.end(), onEvent);
    } catch (const Json::exception&) {
        throw InputError(reader.path(), reader.placeOf(text.offset()), "the JSON is damaged here");
    }
    return builder.finish();
}

}  // namespace pietra
