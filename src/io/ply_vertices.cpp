#include "io/ply_vertices.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "io/notes.h"

namespace pietra {

namespace {

/// Batches stay below this, however many attributes a vertex has.
constexpr size_t kBatchBytes = 4 << 20;

template <class T, bool Swap, class Out>
void copyColumn(const uint8_t* in, size_t stride, size_t rows, Out* out, size_t out_stride) {
    for (size_t i = 0; i < rows; ++i, in += stride, out += out_stride)
        *out = Out(loadValue<T, Swap>(in));
}

/// Calls body(T{}) with the C++ type that `type` stands for.
template <class Body>
void withType(PlyType type, Body&& body) {
    switch (type) {
        case PlyType::kInt8:
            return body(int8_t{});
        case PlyType::kUint8:
            return body(uint8_t{});
        case PlyType::kInt16:
            return body(int16_t{});
        case PlyType::kUint16:
            return body(uint16_t{});
        case PlyType::kInt32:
            return body(int32_t{});
        case PlyType::kUint32:
            return body(uint32_t{});
        case PlyType::kInt64:
            return body(int64_t{});
        case PlyType::kUint64:
            return body(uint64_t{});
        case PlyType::kFloat:
            return body(float{});
        case PlyType::kDouble:
            return body(double{});
    }
}

/// Writes `rows` values of a column to out[0], out[out_stride], ...
template <class Out>
void readColumn(const PlyRowReader& block, size_t property, size_t rows, Out* out,
                size_t out_stride) {
    const PlyColumn& column = block.column(property);
    const uint8_t* in = block.data() + column.offset;
    withType(column.stored, [&](auto type) {
        using T = decltype(type);
        if (block.swapsBytes())
            copyColumn<T, true>(in, block.stride(), rows, out, out_stride);
        else
            copyColumn<T, false>(in, block.stride(), rows, out, out_stride);
    });
}

/// What a colour value is multiplied by to lie in [0, 255].
double colourScale(PlyType declared) {
    switch (declared) {
        case PlyType::kFloat:
        case PlyType::kDouble:
            return 255;
        case PlyType::kUint16:
            return 255.0 / 65535.0;
        default:
            return 1;
    }
}

uint8_t colourByte(double value) {
    return value > 0 ? uint8_t(std::min(value, 255.0) + 0.5) : uint8_t(0);
}

void readColourColumn(const PlyRowReader& block, size_t property, size_t rows, uint8_t* out) {
    const PlyColumn& column = block.column(property);
    if (column.stored == PlyType::kUint8)
        return readColumn(block, property, rows, out, sizeof(Rgba8));
    const double scale = colourScale(column.declared);
    const uint8_t* in = block.data() + column.offset;
    withType(column.stored, [&](auto type) {
        using T = decltype(type);
        for (size_t i = 0; i < rows; ++i, in += block.stride(), out += sizeof(Rgba8)) {
            const T value = block.swapsBytes() ? loadValue<T, true>(in) : loadValue<T, false>(in);
            *out = colourByte(double(value) * scale);
        }
    });
}

template <class T>
T* grow(std::vector<T>& values, size_t by) {
    const size_t size = values.size();
    values.resize(size + by);
    return values.data() + size;
}

/// The positions of all `names` in the element, or empty if one is missing or a list.
std::vector<size_t> findAll(const PlyElement& element, const std::vector<std::string>& names) {
    std::vector<size_t> found;
    for (const std::string& name : names) {
        const auto at = element.find(name);
        if (!at || element.properties[*at].is_list) return {};
        found.push_back(*at);
    }
    return found;
}

std::vector<size_t> findColour(const PlyElement& element) {
    const std::vector<std::string> spellings[] = {
        {"red", "green", "blue", "alpha"},
        {"diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"},
        {"r", "g", "b", "a"}};
    for (std::vector<std::string> names : spellings) {
        std::vector<size_t> found = findAll(element, names);
        if (!found.empty()) return found;
        names.pop_back();
        found = findAll(element, names);
        if (!found.empty()) return found;
    }
    return {};
}

bool isTextureCoordinate(const std::string& name) {
    constexpr const char* names[] = {"s",         "t",         "u",         "v",
                                     "texture_u", "texture_v", "texture_s", "texture_t"};
    return std::find(std::begin(names), std::end(names), name) != std::end(names);
}

}  // namespace

PlyVertexReader::PlyVertexReader(PlyCursor& cursor, const PlyElement& element)
    : cursor_(cursor), element_(element), rows_(cursor, element) {
    chooseProperties();
    const size_t vertex_bytes = sizeof(Vec3d) + sizeof(Vec3f) + sizeof(Rgba8) + 4 * scalars_.size();
    batch_rows_ = std::clamp<size_t>(kBatchBytes / vertex_bytes, 1, kMaxBatch);
}

void PlyVertexReader::chooseProperties() {
    const auto position = findAll(element_, {"x", "y", "z"});
    if (position.empty())
        throw InputError(cursor_.reader().path(), "", "the vertices have no properties x, y and z");
    std::copy(position.begin(), position.end(), position_.begin());
    const auto normal = findAll(element_, {"nx", "ny", "nz"});
    if (!normal.empty()) normal_ = {normal[0], normal[1], normal[2]};
    colour_ = findColour(element_);

    std::vector<bool> used(element_.properties.size(), false);
    for (const std::vector<size_t>& list : {position, normal, colour_})
        for (const size_t property : list) used[property] = true;
    bool texture = false;
    std::vector<std::string> lists;
    for (size_t i = 0; i < element_.properties.size(); ++i) {
        const PlyProperty& p = element_.properties[i];
        if (used[i]) continue;
        if (p.is_list) {
            lists.push_back(p.name + " of element " + element_.name);
        } else if (isTextureCoordinate(p.name)) {
            texture = true;
        } else {
            scalars_.push_back(i);
            schema_.scalars.push_back(p.name);
        }
    }
    if (!lists.empty()) notes_.push_back(leftOut("property", lists));
    if (texture) notes_.push_back("texture coordinates are left out");
    schema_.normals_given = normal_.has_value();
    schema_.colours = !colour_.empty();
}

void PlyVertexReader::read(uint64_t first, VertexBatch& batch) {
    batch.restart(first);
    const auto wanted = size_t(std::min<uint64_t>(batch_rows_, element_.count - first));
    while (batch.position.size() < wanted)
        append(rows_.next(wanted - batch.position.size()), batch);
}

void PlyVertexReader::append(size_t rows, VertexBatch& batch) {
    const size_t begin = batch.position.size();
    Vec3d* position = grow(batch.position, rows);
    for (int k = 0; k < 3; ++k) readColumn(rows_, position_[k], rows, &position->x + k, 3);
    checkFinite(batch, begin);
    if (normal_) {
        Vec3f* normal = grow(batch.normal, rows);
        for (int k = 0; k < 3; ++k) readColumn(rows_, (*normal_)[k], rows, &normal->x + k, 3);
    }
    if (!colour_.empty()) {
        Rgba8* colour = grow(batch.colour, rows);
        for (size_t k = 0; k < colour_.size(); ++k)
            readColourColumn(rows_, colour_[k], rows, &colour->r + k);
    }
    float* scalar = grow(batch.scalar, rows * scalars_.size());
    for (size_t k = 0; k < scalars_.size(); ++k)
        readColumn(rows_, scalars_[k], rows, scalar + k, scalars_.size());
}

void PlyVertexReader::checkFinite(const VertexBatch& batch, size_t begin) {
    const auto finite = [](const Vec3d& p) {
        return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
    };
    // Zero times a number is zero, times anything else it is not: a sum is quicker than a test
    // each.
    double sum = 0;
    for (size_t i = begin; i < batch.position.size(); ++i) {
        const Vec3d& p = batch.position[i];
        sum += p.x * 0 + p.y * 0 + p.z * 0;
    }
    if (sum == 0) return;
    size_t i = begin;
    while (finite(batch.position[i])) ++i;
    const Vec3d& p = batch.position[i];
    cursor_.fail(rows_.placeOf(i - begin),
                 fmt::format("vertex {} is at ({}, {}, {}), which is no point", batch.first + i,
                             p.x, p.y, p.z));
}

}  // namespace pietra
