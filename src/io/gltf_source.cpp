#include "io/gltf_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <string_view>

#include "base/error.h"
#include "io/gltf_buffers.h"
#include "io/gltf_column.h"
#include "io/gltf_document.h"
#include "io/gltf_scene.h"

namespace pietra {

namespace {

/// Batches stay below this, however many attributes a vertex has.
constexpr size_t kBatchBytes = 4 << 20;

/// The matrix that turns normals: the cofactors, which are the inverse transpose but for a positive
/// factor, and exist where the inverse does not.
glm::dmat3 normalMatrix(const glm::dmat4& m, double determinant) {
    const Vec3d x(m[0]), y(m[1]), z(m[2]);
    const glm::dmat3 cofactors(glm::cross(y, z), glm::cross(z, x), glm::cross(x, y));
    return determinant < 0 ? -1.0 * cofactors : cofactors;
}

double determinantOf(const glm::dmat4& m) {
    return glm::dot(Vec3d(m[0]), glm::cross(Vec3d(m[1]), Vec3d(m[2])));
}

/// What GltfSource reads vertices with: the columns of a vertex set.
struct VertexColumns {
    VertexColumns(const GltfDocument& document, GltfBuffers& buffers, const GltfVertexSet& set)
        : position(document, buffers, set.position, "") {
        if (set.normal != kGltfNone) normal.emplace(document, buffers, set.normal, "");
        if (set.colour != kGltfNone) colour.emplace(document, buffers, set.colour, "");
        for (const uint32_t scalar : set.scalars)
            scalars.emplace_back(document, buffers, scalar, "");
        block_rows = position.blockRows();
        const auto prepare = [&](GltfColumn& column) {
            column.seek(set.first_row);
            block_rows = std::min(block_rows, column.blockRows());
        };
        prepare(position);
        if (normal) prepare(*normal);
        if (colour) prepare(*colour);
        for (GltfColumn& scalar : scalars) prepare(scalar);
    }

    GltfColumn position;
    std::optional<GltfColumn> normal, colour;
    std::vector<GltfColumn> scalars;
    size_t block_rows = 0;
};

/// The corners of a surface, in order: by its indices, or one vertex after the other.
class CornerReader {
public:
    CornerReader(const GltfDocument& document, GltfBuffers& buffers, const GltfVertexSet& set,
                 const GltfSurface& surface)
        : buffers_(buffers), set_(set), set_rows_(document.accessors[set.position].count) {
        if (surface.indices == kGltfNone) return;
        indices_.emplace(document, buffers, surface.indices, "");
        block_.resize(indices_->blockRows());
    }

    /// The vertex of the next corner, counted from the first one of the set.
    uint64_t next() {
        if (!indices_) return next_++ - set_.first_row;
        if (used_ == filled_) fill();
        return block_[used_++];
    }

private:
    void fill() {
        const uint64_t first = indices_->row();
        filled_ = size_t(std::min<uint64_t>(block_.size(), indices_->count() - first));
        used_ = 0;
        indices_->read(filled_, block_.data(), 1, 1, false);
        for (size_t i = 0; i < filled_; ++i) {
            const uint64_t index = block_[i];
            block_[i] = index - set_.first_row;
            if (block_[i] < set_.count) continue;
            throw InputError(
                buffers_.path(), indices_->placeOf(first + i),
                fmt::format("vertex index {} in a primitive of {} vertices", index, set_rows_));
        }
    }

    GltfBuffers& buffers_;
    const GltfVertexSet& set_;
    uint64_t set_rows_;
    std::optional<GltfColumn> indices_;
    uint64_t next_ = 0;
    std::vector<uint64_t> block_;
    size_t used_ = 0, filled_ = 0;
};

class GltfSource : public TriangleSource {
public:
    GltfSource(GltfDocument document, std::unique_ptr<ByteSource> file,
               std::optional<GltfChunk> chunk, std::vector<std::string> notes)
        : document_(std::move(document)),
          buffers_(std::move(file), document_, chunk),
          scene_(makeGltfScene(document_, buffers_)),
          notes_(std::move(notes)) {
        notes_.insert(notes_.end(), scene_.notes.begin(), scene_.notes.end());
        const size_t vertex_bytes =
            sizeof(Vec3d) + sizeof(Vec3f) + sizeof(Rgba8) + 4 * schema().scalars.size();
        batch_rows_ = std::clamp<size_t>(kBatchBytes / vertex_bytes, 1, kMaxBatch);
    }

    const AttributeSchema& schema() const override { return scene_.schema; }
    uint64_t vertexCount() override { return scene_.vertices; }
    uint64_t triangleCountHint() override { return scene_.triangles; }
    uint64_t inputBytes() const override { return buffers_.storedBytes(); }
    bool cheapToReread() const override { return true; }
    std::vector<std::string> notes() const override { return notes_; }

    void rewindVertices() override {
        vertex_instance_ = vertex_set_ = 0;
        vertices_read_ = 0;
        columns_.reset();
        buffers_.release();
    }
    bool readVertices(VertexBatch& batch) override;
    void rewindTriangles() override {
        triangle_instance_ = surface_ = 0;
        surface_triangles_ = triangles_read_ = 0;
        corners_.reset();
        buffers_.release();
    }
    bool readTriangles(TriangleBatch& batch) override;

private:
    void nextVertexSet();
    void appendVertices(size_t rows, VertexBatch& batch);
    void place(const glm::dmat4& matrix, VertexBatch& batch, size_t begin);
    void appendColours(size_t rows, VertexBatch& batch);
    void appendTriangles(size_t count, TriangleBatch& batch);

    GltfDocument document_;
    GltfBuffers buffers_;
    GltfScene scene_;
    std::vector<std::string> notes_;
    size_t batch_rows_ = 0;

    size_t vertex_instance_ = 0, vertex_set_ = 0;
    uint64_t vertices_read_ = 0;
    std::optional<VertexColumns> columns_;  ///< of the vertex set at hand, once begun

    size_t triangle_instance_ = 0, surface_ = 0;
    uint64_t triangles_read_ = 0;
    uint64_t surface_triangles_ = 0;  ///< how many of the surface at hand were read
    std::optional<CornerReader> corners_;
    std::array<uint64_t, 2> earlier_{};  ///< strips: the last two corners; fans: first and last
};

bool GltfSource::readVertices(VertexBatch& batch) {
    batch.restart(vertices_read_);
    while (vertex_instance_ < scene_.instances.size() && batch.position.size() < batch_rows_) {
        const auto& shape = scene_.shapes[scene_.instances[vertex_instance_].mesh];
        const GltfVertexSet& set = shape.sets[vertex_set_];
        if (!columns_) columns_.emplace(document_, buffers_, set);
        const uint64_t left = set.first_row + set.count - columns_->position.row();
        const size_t rows = size_t(
            std::min<uint64_t>({left, columns_->block_rows, batch_rows_ - batch.position.size()}));
        appendVertices(rows, batch);
        if (rows == left) nextVertexSet();
    }
    vertices_read_ += batch.position.size();
    return !batch.position.empty();
}

void GltfSource::nextVertexSet() {
    columns_.reset();
    const auto& shape = scene_.shapes[scene_.instances[vertex_instance_].mesh];
    if (++vertex_set_ < shape.sets.size()) return;
    vertex_set_ = 0;
    ++vertex_instance_;
}

void GltfSource::appendVertices(size_t rows, VertexBatch& batch) {
    const size_t begin = batch.position.size();
    batch.position.resize(begin + rows);
    columns_->position.read(rows, &batch.position[begin].x, 3, 3, true);
    if (schema().normals_given) {
        batch.normal.resize(begin + rows);
        columns_->normal->read(rows, &batch.normal[begin].x, 3, 3, true);
    }
    if (schema().colours) appendColours(rows, batch);
    const size_t scalars = schema().scalars.size();
    batch.scalar.resize((begin + rows) * scalars);
    for (size_t k = 0; k < scalars; ++k)
        columns_->scalars[k].read(rows, &batch.scalar[begin * scalars + k], scalars, 1, true);
    place(scene_.instances[vertex_instance_].matrix, batch, begin);
}

/// Turns what was read into the axes of the scene.
void GltfSource::place(const glm::dmat4& matrix, VertexBatch& batch, size_t begin) {
    const bool moved = matrix != glm::dmat4(1);
    bool finite = true;
    for (size_t i = begin; i < batch.position.size(); ++i) {
        Vec3d& p = batch.position[i];
        if (moved)
            p = Vec3d(matrix[0]) * p.x + Vec3d(matrix[1]) * p.y + Vec3d(matrix[2]) * p.z +
                Vec3d(matrix[3]);
        finite = finite && std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
    }
    if (!finite) {
        size_t i = begin;
        const auto at = [&] { return batch.position[i]; };
        while (std::isfinite(at().x) && std::isfinite(at().y) && std::isfinite(at().z)) ++i;
        const uint64_t row = columns_->position.row() - (batch.position.size() - i);
        throw InputError(buffers_.path(), columns_->position.placeOf(row),
                         fmt::format("vertex {} is at ({}, {}, {}), which is no point",
                                     batch.first + i, at().x, at().y, at().z));
    }
    if (!moved || !schema().normals_given) return;
    const glm::dmat3 turn = normalMatrix(matrix, determinantOf(matrix));
    for (size_t i = begin; i < batch.normal.size(); ++i) {
        const Vec3d n(batch.normal[i]);
        const Vec3d turned = turn[0] * n.x + turn[1] * n.y + turn[2] * n.z;
        const double length = std::sqrt(glm::dot(turned, turned));
        batch.normal[i] = length > 0 ? Vec3f(turned / length) : Vec3f(0);
    }
}

void GltfSource::appendColours(size_t rows, VertexBatch& batch) {
    const size_t begin = batch.colour.size();
    batch.colour.resize(begin + rows, Rgba8{});
    if (!columns_->colour) return;
    GltfColumn& column = *columns_->colour;
    const int components = std::min(column.components(), 4);
    Rgba8* const out = batch.colour.data() + begin;
    if (column.accessor().component == GltfComponent::kUint8)
        return column.read(rows, &out->r, sizeof(Rgba8), components, false);
    std::vector<float> values(rows * 4, 1.0f);
    column.read(rows, values.data(), 4, components, true);
    for (size_t i = 0; i < rows; ++i) {
        uint8_t* const bytes = &out[i].r;
        for (int k = 0; k < components; ++k) {
            const float value = values[4 * i + size_t(k)];
            bytes[k] = value > 0 ? uint8_t(std::min(value, 1.0f) * 255 + 0.5f) : uint8_t(0);
        }
    }
}

bool GltfSource::readTriangles(TriangleBatch& batch) {
    batch.first = triangles_read_;
    batch.triangle.clear();
    while (triangle_instance_ < scene_.instances.size() && batch.triangle.size() < kMaxBatch) {
        const GltfShape& shape = scene_.shapes[scene_.instances[triangle_instance_].mesh];
        const GltfSurface& surface = shape.surfaces[surface_];
        if (!corners_) {
            corners_.emplace(document_, buffers_, shape.sets[surface.set], surface);
            surface_triangles_ = 0;
        }
        const uint64_t left = surface.triangles - surface_triangles_;
        appendTriangles(size_t(std::min<uint64_t>(left, kMaxBatch - batch.triangle.size())), batch);
        if (surface_triangles_ < surface.triangles) continue;
        corners_.reset();
        if (++surface_ < shape.surfaces.size()) continue;
        surface_ = 0;
        ++triangle_instance_;
    }
    triangles_read_ += batch.triangle.size();
    return !batch.triangle.empty();
}

void GltfSource::appendTriangles(size_t count, TriangleBatch& batch) {
    const GltfInstance& instance = scene_.instances[triangle_instance_];
    const GltfShape& shape = scene_.shapes[instance.mesh];
    const GltfSurface& surface = shape.surfaces[surface_];
    const uint64_t base = instance.first_vertex + shape.sets[surface.set].first_vertex;
    const bool mirrored = determinantOf(instance.matrix) < 0;
    const auto corner = [&] { return base + corners_->next(); };
    if (surface_triangles_ == 0 && surface.mode != GltfPrimitive::kTriangles) {
        earlier_[0] = corner();
        earlier_[1] = corner();
    }
    for (size_t i = 0; i < count; ++i, ++surface_triangles_) {
        std::array<uint64_t, 3> t;
        if (surface.mode == GltfPrimitive::kTriangles) {
            for (uint64_t& vertex : t) vertex = corner();
        } else {
            t = {earlier_[0], earlier_[1], corner()};
            const bool strip = surface.mode == GltfPrimitive::kStrip;
            earlier_ = {strip ? t[1] : t[0], t[2]};
            // Every second triangle of a strip runs the other way.
            if (strip && surface_triangles_ % 2 != 0) std::swap(t[0], t[1]);
        }
        if (mirrored) std::swap(t[1], t[2]);
        batch.triangle.push_back(t);
    }
}

constexpr std::string_view kMagic = "glTF", kJsonChunk = "JSON", kDataChunk("BIN\0", 4);
constexpr size_t kHeadBytes = 12, kChunkHeadBytes = 8;

/// Where the parts of a GLB are.
struct GlbParts {
    uint64_t json_begin = 0, json_end = 0;
    std::optional<GltfChunk> data;
    std::vector<std::string> notes;
};

uint32_t loadWord(const uint8_t* bytes) {
    uint32_t word;
    std::memcpy(&word, bytes, sizeof word);
    return word;
}

GlbParts readGlbHead(ByteReader& reader) {
    const uint64_t size = reader.source().lengthBound();
    const auto need = [&](uint64_t offset, size_t bytes) {
        reader.seek(offset);
        if (reader.peek(bytes) < bytes)
            throw InputError::atByte(reader.path(), size, "the file ends within a head of glTF");
        return reader.data();
    };
    const uint8_t* const head = need(0, kHeadBytes);
    const uint32_t version = loadWord(head + 4), length = loadWord(head + 8);
    if (version != 2)
        throw InputError::atByte(reader.path(), 4,
                                 fmt::format("Pietra reads glTF 2, not {}", version));
    if (length > size || length < kHeadBytes + kChunkHeadBytes)
        throw InputError::atByte(
            reader.path(), 8,
            fmt::format("the head counts {} bytes, but the file has {}", length, size));
    GlbParts parts;
    if (length < size)
        parts.notes.push_back(fmt::format("{} bytes after the end are left out", size - length));
    for (uint64_t at = kHeadBytes; at < length && !parts.data;) {
        const uint8_t* const chunk = need(at, kChunkHeadBytes);
        const uint64_t bytes = loadWord(chunk), begin = at + kChunkHeadBytes;
        const std::string_view type(reinterpret_cast<const char*>(chunk + 4), 4);
        if (begin > length || bytes > length - begin)
            throw InputError::atByte(
                reader.path(), at,
                fmt::format("a chunk of {} bytes in a file of {}", bytes, length));
        const bool first = at == kHeadBytes;
        if (first != (type == kJsonChunk))
            throw InputError::atByte(
                reader.path(), at + 4,
                first ? "the first chunk is not the JSON" : "another chunk of JSON");
        if (first) {
            parts.json_begin = begin;
            parts.json_end = begin + bytes;
            // Blanks should fill the chunk up, but some writers take zeros.
            while (parts.json_end > begin && *need(parts.json_end - 1, 1) == 0) --parts.json_end;
        } else if (type == kDataChunk) {
            parts.data = {begin, bytes};
        }
        at = begin + (bytes + 3) / 4 * 4;
    }
    return parts;
}

bool isGlb(std::span<const uint8_t> head) {
    return head.size() >= kMagic.size() && std::equal(kMagic.begin(), kMagic.end(), head.begin());
}

}  // namespace

bool isGltf(const FileSigns& signs) {
    if (isGlb(signs.head)) return true;
    const std::string_view text = signs.text();
    const size_t first = text.find_first_not_of(" \t\r\n");
    if (first == text.npos || text[first] != '{') return false;
    return signs.name.ends_with(".gltf") || text.find("\"asset\"") != text.npos;
}

std::unique_ptr<TriangleSource> openGltf(std::unique_ptr<ByteReader> reader) {
    // Its parts are read in turns.
    if (reader->source().isCompressed())
        reader = std::make_unique<ByteReader>(reader->takeSource()->unpacked());
    GlbParts parts;
    parts.json_end = reader->source().lengthBound();
    if (reader->peek(kMagic.size()) >= kMagic.size() && isGlb({reader->data(), kMagic.size()}))
        parts = readGlbHead(*reader);
    GltfDocument document = readGltfDocument(*reader, parts.json_begin, parts.json_end);
    return std::make_unique<GltfSource>(std::move(document), reader->takeSource(), parts.data,
                                        std::move(parts.notes));
}

}  // namespace pietra
