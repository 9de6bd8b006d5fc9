// openSource(): finds the reader of a file, and joins several files into one model.

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "base/check.h"
#include "base/error.h"
#include "io/formats.h"
#include "io/triangle_source.h"

namespace pietra {

namespace {

constexpr size_t kHeadBytes = 4096;

std::string lowerCaseName(const std::string& path) {
    std::string name = path;
    for (char& c : name) c = char(std::tolower(static_cast<unsigned char>(c)));
    if (name.ends_with(".gz")) name.resize(name.size() - 3);
    return name;
}

std::unique_ptr<TriangleSource> openOne(const std::string& path) {
    auto reader = std::make_unique<ByteReader>(openBytes(path));
    const size_t size = std::min(reader->peek(kHeadBytes), kHeadBytes);
    if (size == 0) throw InputError(path, "", "the file is empty");
    const std::span<const uint8_t> head(reader->data(), size);
    const std::string name = lowerCaseName(path);
    std::string known;
    for (const MeshFormat& format : meshFormats()) {
        if (format.matches(head, name)) return format.open(std::move(reader));
        known += fmt::format("{}{}", known.empty() ? "" : ", ", format.name);
    }
    throw InputError(path, "", fmt::format("is of no format that Pietra reads ({})", known));
}

/// Several sources, one after the other. Attributes that not all of them have are left out.
class JoinedSource : public TriangleSource {
public:
    explicit JoinedSource(std::vector<std::unique_ptr<TriangleSource>> parts)
        : parts_(std::move(parts)) {
        chooseSchema();
        for (const auto& part : parts_) {
            first_vertex_.push_back(vertex_count_);
            vertex_count_ += part->vertexCount();
        }
    }

    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() override { return vertex_count_; }
    uint64_t triangleCountHint() override {
        uint64_t sum = 0;
        for (const auto& part : parts_) sum += part->triangleCountHint();
        return sum;
    }
    uint64_t inputBytes() const override {
        uint64_t sum = 0;
        for (const auto& part : parts_) sum += part->inputBytes();
        return sum;
    }
    bool cheapToReread() const override {
        return std::all_of(parts_.begin(), parts_.end(),
                           [](const auto& part) { return part->cheapToReread(); });
    }
    std::vector<std::string> notes() const override {
        std::vector<std::string> all = notes_;
        for (const auto& part : parts_)
            for (const std::string& note : part->notes())
                if (std::find(all.begin(), all.end(), note) == all.end()) all.push_back(note);
        return all;
    }

    void rewindVertices() override {
        vertex_part_ = 0;
        for (const auto& part : parts_) part->rewindVertices();
    }
    bool readVertices(VertexBatch& batch) override {
        for (; vertex_part_ < parts_.size(); ++vertex_part_) {
            if (!parts_[vertex_part_]->readVertices(batch)) {
                parts_[vertex_part_]->rewindVertices();  // which frees its memory
                continue;
            }
            batch.first += first_vertex_[vertex_part_];
            if (!schema_.normals_given) batch.normal.clear();
            if (!schema_.colours) batch.colour.clear();
            keepScalars(batch);
            return true;
        }
        batch.position.clear();
        return false;
    }
    void rewindTriangles() override {
        triangle_part_ = 0;
        triangles_read_ = 0;
        for (const auto& part : parts_) part->rewindTriangles();
    }
    bool readTriangles(TriangleBatch& batch) override {
        for (; triangle_part_ < parts_.size(); ++triangle_part_) {
            if (!parts_[triangle_part_]->readTriangles(batch)) {
                parts_[triangle_part_]->rewindTriangles();  // which frees its memory
                continue;
            }
            batch.first = triangles_read_;
            triangles_read_ += batch.triangle.size();
            const uint64_t shift = first_vertex_[triangle_part_];
            for (auto& t : batch.triangle)
                for (uint64_t& index : t) index += shift;
            return true;
        }
        batch.triangle.clear();
        return false;
    }

private:
    void chooseSchema() {
        schema_ = parts_.front()->schema();
        bool same = true;
        for (const auto& part : parts_) {
            const AttributeSchema& s = part->schema();
            same = same && s == parts_.front()->schema();
            schema_.normals_given = schema_.normals_given && s.normals_given;
            schema_.colours = schema_.colours && s.colours;
            std::erase_if(schema_.scalars, [&](const std::string& name) {
                return std::find(s.scalars.begin(), s.scalars.end(), name) == s.scalars.end();
            });
        }
        if (!same) notes_.push_back("attributes that not all files have are left out");
    }

    /// Picks the columns of the joined schema out of those of the part at hand.
    void keepScalars(VertexBatch& batch) const {
        const auto& names = parts_[vertex_part_]->schema().scalars;
        if (names == schema_.scalars) return;
        std::vector<size_t> column;
        for (const std::string& name : schema_.scalars)
            column.push_back(size_t(std::find(names.begin(), names.end(), name) - names.begin()));
        std::vector<float> kept;
        kept.reserve(batch.position.size() * column.size());
        for (size_t v = 0; v < batch.position.size(); ++v)
            for (const size_t c : column) kept.push_back(batch.scalar[v * names.size() + c]);
        batch.scalar = std::move(kept);
    }

    std::vector<std::unique_ptr<TriangleSource>> parts_;
    AttributeSchema schema_;
    std::vector<std::string> notes_;
    std::vector<uint64_t> first_vertex_;
    uint64_t vertex_count_ = 0;
    size_t vertex_part_ = 0;
    size_t triangle_part_ = 0;
    uint64_t triangles_read_ = 0;
};

}  // namespace

std::unique_ptr<TriangleSource> openSource(const std::vector<std::string>& paths) {
    CHECK(!paths.empty());
    if (paths.size() == 1) return openOne(paths.front());
    std::vector<std::unique_ptr<TriangleSource>> parts;
    for (const std::string& path : paths) parts.push_back(openOne(path));
    return std::make_unique<JoinedSource>(std::move(parts));
}

}  // namespace pietra
