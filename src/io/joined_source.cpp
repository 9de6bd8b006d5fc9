#include "io/joined_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/check.h"
#include "base/error.h"

namespace pietra {

namespace {

class JoinedSource : public TriangleSource {
public:
    explicit JoinedSource(std::vector<SourcePart> parts) : parts_(std::move(parts)) {
        CHECK(!parts_.empty());
        chooseSchema();
        for (const SourcePart& part : parts_) {
            first_vertex_.push_back(vertex_count_);
            const uint64_t count = part.source->vertexCount();
            if (count > UINT64_MAX - vertex_count_)
                throw InputError(part.name, "", "there are too many vertices in all files");
            vertex_count_ += count;
        }
    }

    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() override { return vertex_count_; }
    uint64_t triangleCountHint() override {
        uint64_t sum = 0;
        for (const SourcePart& part : parts_) sum += part.source->triangleCountHint();
        return sum;
    }
    uint64_t inputBytes() const override {
        uint64_t sum = 0;
        for (const SourcePart& part : parts_) sum += part.source->inputBytes();
        return sum;
    }
    bool cheapToReread() const override {
        return std::all_of(parts_.begin(), parts_.end(),
                           [](const SourcePart& part) { return part.source->cheapToReread(); });
    }
    std::vector<std::string> notes() const override;

    void rewindVertices() override {
        vertex_part_ = 0;
        for (const SourcePart& part : parts_) part.source->rewindVertices();
    }
    bool readVertices(VertexBatch& batch) override;
    void rewindTriangles() override {
        triangle_part_ = 0;
        triangles_read_ = 0;
        for (const SourcePart& part : parts_) part.source->rewindTriangles();
    }
    bool readTriangles(TriangleBatch& batch) override;

private:
    void chooseSchema();
    void chooseScalars();
    template <class Has>
    const SourcePart* firstWithout(Has&& has) const;
    void keepScalars(VertexBatch& batch) const;

    std::vector<SourcePart> parts_;
    AttributeSchema schema_;
    std::vector<std::string> notes_;
    std::vector<uint64_t> first_vertex_;
    uint64_t vertex_count_ = 0;
    size_t vertex_part_ = 0;
    size_t triangle_part_ = 0;
    uint64_t triangles_read_ = 0;
};

/// Notes of the parts, each sentence once: of many files it is not worth saying which.
std::vector<std::string> JoinedSource::notes() const {
    std::vector<std::string> all = notes_;
    for (const SourcePart& part : parts_)
        for (const std::string& note : part.source->notes())
            if (std::find(all.begin(), all.end(), note) == all.end()) all.push_back(note);
    return all;
}

/// The first part whose schema has not what is asked for, or null.
template <class Has>
const SourcePart* JoinedSource::firstWithout(Has&& has) const {
    for (const SourcePart& part : parts_)
        if (!has(part.source->schema())) return &part;
    return nullptr;
}

void JoinedSource::chooseSchema() {
    const auto hasNormals = [](const AttributeSchema& s) { return s.normals_given; };
    const auto hasColours = [](const AttributeSchema& s) { return s.colours; };
    const auto any = [&](auto has) {
        return std::any_of(parts_.begin(), parts_.end(),
                           [&](const SourcePart& part) { return has(part.source->schema()); });
    };
    const SourcePart* const no_normals = firstWithout(hasNormals);
    schema_.normals_given = !no_normals;
    if (no_normals && any(hasNormals))
        notes_.push_back(fmt::format(
            "normals are left out, as {} has none: they are computed from the triangles",
            no_normals->name));
    const SourcePart* const no_colours = firstWithout(hasColours);
    schema_.colours = any(hasColours);
    if (no_colours && schema_.colours)
        notes_.push_back(
            fmt::format("files without colours, such as {}, are white", no_colours->name));
    chooseScalars();
}

void JoinedSource::chooseScalars() {
    std::vector<std::string> seen;
    for (const SourcePart& part : parts_)
        for (const std::string& name : part.source->schema().scalars) {
            if (std::find(seen.begin(), seen.end(), name) != seen.end()) continue;
            seen.push_back(name);
            const SourcePart* const without = firstWithout([&](const AttributeSchema& s) {
                return std::find(s.scalars.begin(), s.scalars.end(), name) != s.scalars.end();
            });
            if (!without)
                schema_.scalars.push_back(name);
            else
                notes_.push_back(
                    fmt::format("{} is left out, as {} has none", name, without->name));
        }
}

bool JoinedSource::readVertices(VertexBatch& batch) {
    for (; vertex_part_ < parts_.size(); ++vertex_part_) {
        TriangleSource& part = *parts_[vertex_part_].source;
        if (!part.readVertices(batch)) {
            part.rewindVertices();  // which frees its memory
            continue;
        }
        batch.first += first_vertex_[vertex_part_];
        if (!schema_.normals_given) batch.normal.clear();
        if (schema_.colours && !part.schema().colours)
            batch.colour.assign(batch.position.size(), Rgba8{});
        keepScalars(batch);
        return true;
    }
    batch.position.clear();
    batch.normal.clear();
    batch.colour.clear();
    batch.scalar.clear();
    return false;
}

bool JoinedSource::readTriangles(TriangleBatch& batch) {
    for (; triangle_part_ < parts_.size(); ++triangle_part_) {
        TriangleSource& part = *parts_[triangle_part_].source;
        if (!part.readTriangles(batch)) {
            part.rewindTriangles();  // which frees its memory
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

/// Picks the columns of the joined schema out of those of the part at hand.
void JoinedSource::keepScalars(VertexBatch& batch) const {
    const auto& names = parts_[vertex_part_].source->schema().scalars;
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

}  // namespace

std::unique_ptr<TriangleSource> joinSources(std::vector<SourcePart> parts) {
    return std::make_unique<JoinedSource>(std::move(parts));
}

}  // namespace pietra
