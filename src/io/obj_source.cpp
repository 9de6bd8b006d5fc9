#include "io/obj_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "base/error.h"
#include "io/obj_cursor.h"
#include "io/obj_survey.h"
#include "io/triangle_room.h"

namespace pietra {

namespace {

uint8_t colourByte(double value) {
    return value > 0 ? uint8_t(std::min(value, 255.0) + 0.5) : uint8_t(0);
}

/// A cursor that stops at the statements of one kind and leaps over blocks without any.
class StatementStream {
public:
    /// `count`: which of a block's counts is the kind's.
    StatementStream(ObjCursor& cursor, const ObjSurvey& survey, ObjWord kind,
                    uint64_t ObjBlock::*count)
        : cursor_(cursor), blocks_(survey.blocks), kind_(kind), count_(count) {
        rewind();
    }

    void rewind() {
        block_ = 0;
        block_end_ = 0;
        place_ = blocks_[0].start;
        vertices_ = 0;
    }
    /// The cursor may have been elsewhere since leave().
    void enter() { cursor_.seek(place_); }
    void leave() { place_ = cursor_.place(); }
    /// Moves behind the first word of the next statement of the kind; there must be one.
    void next() {
        ObjWord word;
        for (;;) {
            if (cursor_.offset() >= block_end_) enterBlock();
            if (!cursor_.nextStatement(word)) [[unlikely]]
                cursor_.fail("the file ends early: has it changed since it was opened?");
            if (word == kind_) return;
            if (word == ObjWord::kVertex) ++vertices_;
            cursor_.skipStatement();
        }
    }
    /// How many vertices stand before the statement, where it is not one itself.
    uint64_t verticesBefore() const { return vertices_; }

private:
    void enterBlock();

    ObjCursor& cursor_;
    const std::vector<ObjBlock>& blocks_;
    ObjWord kind_;
    uint64_t ObjBlock::*count_;
    size_t block_ = 0;        ///< the one after that in which the cursor is
    uint64_t block_end_ = 0;  ///< where the cursor leaves its block
    ObjPlace place_;
    uint64_t vertices_ = 0;
};

void StatementStream::enterBlock() {
    const size_t first = block_;
    while (block_ + 1 < blocks_.size() && blocks_[block_].*count_ == blocks_[block_ + 1].*count_)
        ++block_;
    if (block_ + 1 >= blocks_.size()) {
        block_end_ = UINT64_MAX;  // the end of the file will tell
        return;
    }
    if (block_ != first) {
        cursor_.seek(blocks_[block_].start);
        vertices_ = blocks_[block_].vertices;
    }
    block_end_ = blocks_[++block_].start.offset;
}

class ObjSource : public TriangleSource {
public:
    ObjSource(std::unique_ptr<ByteReader> reader, uint64_t block_bytes)
        : reader_(std::move(reader)),
          survey_(surveyObj(*reader_, block_bytes)),
          cursor_(*reader_),
          vertices_(cursor_, survey_, ObjWord::kVertex, &ObjBlock::vertices),
          faces_(cursor_, survey_, ObjWord::kFace, &ObjBlock::faces) {
        cursor_.start();
        reader_->release();
        if (survey_.normals) normals_.emplace(reader_->source().again(), survey_);
        schema_.colours = survey_.colours;
        schema_.normals_given = survey_.normals;
    }

    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() override { return survey_.vertexCount(); }
    uint64_t triangleCountHint() override { return survey_.triangles; }
    uint64_t inputBytes() const override { return reader_->source().storedBytes(); }
    bool cheapToReread() const override { return false; }
    std::vector<std::string> notes() const override;

    void rewindVertices() override;
    bool readVertices(VertexBatch& batch) override;
    void rewindTriangles() override;
    bool readTriangles(TriangleBatch& batch) override;

private:
    /// Normals stand at places of their own, so they are read by a cursor of their own.
    struct NormalStream {
        NormalStream(std::unique_ptr<ByteSource> bytes, const ObjSurvey& survey)
            : reader(std::move(bytes)),
              cursor(reader),
              statements(cursor, survey, ObjWord::kNormal, &ObjBlock::normals) {
            cursor.start();
            rewind();
        }
        void rewind() {
            statements.rewind();
            reader.release();
        }
        Vec3f next();

        ByteReader reader;
        ObjCursor cursor;
        StatementStream statements;
    };

    void readVertex(uint64_t number, Vec3d& position, Rgba8* colour);
    void beginFace();
    bool addCorner(TriangleRoom& room);
    uint64_t indexOf(const ObjCorner& corner) const;

    std::unique_ptr<ByteReader> reader_;
    ObjSurvey survey_;
    ObjCursor cursor_;
    AttributeSchema schema_;

    StatementStream vertices_;
    std::optional<NormalStream> normals_;
    uint64_t vertices_read_ = 0;
    uint64_t weights_ = 0;  ///< vertices whose weight is not 1, since the first one was read

    StatementStream faces_;
    uint64_t faces_read_ = 0;
    uint64_t triangles_read_ = 0;
    uint64_t polygons_ = 0;
    // The state inside a face.
    bool in_face_ = false;
    uint64_t corners_ = 0;
    uint64_t first_ = 0, previous_ = 0;
};

std::vector<std::string> ObjSource::notes() const {
    std::vector<std::string> notes = survey_.notes;
    if (weights_ > 0)
        notes.push_back(fmt::format("the weights of {} vertices are left out", weights_));
    if (polygons_ > 0)
        notes.push_back(fmt::format("{} polygons are cut into fans of triangles", polygons_));
    return notes;
}

void ObjSource::rewindVertices() {
    vertices_read_ = 0;
    vertices_.rewind();
    if (normals_) normals_->rewind();
    reader_->release();
}

bool ObjSource::readVertices(VertexBatch& batch) {
    const auto count =
        size_t(std::min<uint64_t>(kMaxBatch, survey_.vertexCount() - vertices_read_));
    batch.first = vertices_read_;
    batch.scalar.clear();
    batch.position.resize(count);
    batch.colour.resize(survey_.colours ? count : 0);
    batch.normal.resize(normals_ ? count : 0);
    if (count == 0) return false;
    if (vertices_read_ == 0) weights_ = 0;
    vertices_.enter();
    for (size_t i = 0; i < count; ++i) {
        vertices_.next();
        readVertex(batch.first + i, batch.position[i],
                   survey_.colours ? &batch.colour[i] : nullptr);
    }
    vertices_.leave();
    if (normals_) {
        normals_->statements.enter();
        for (Vec3f& normal : batch.normal) normal = normals_->next();
        normals_->statements.leave();
    }
    vertices_read_ += count;
    return true;
}

void ObjSource::readVertex(uint64_t number, Vec3d& position, Rgba8* colour) {
    ObjVertex vertex;
    const ObjPlace here = cursor_.place();
    takeVertex(cursor_, vertex);
    position = {vertex.position[0], vertex.position[1], vertex.position[2]};
    // Zero times a number is zero, times anything else it is not.
    if (const Vec3d zero = position * 0.0; !(zero.x + zero.y + zero.z == 0)) [[unlikely]]
        throw InputError::atLine(reader_->path(), here.line,
                                 fmt::format("vertex {} is at ({}, {}, {}), which is no point",
                                             number + 1, position.x, position.y, position.z));
    weights_ += vertex.weight != 1;
    if (!colour) return;
    const double scale = survey_.colour_scale;
    const double* c = vertex.colour;
    *colour = Rgba8{};
    if (vertex.colour_values >= 3)
        *colour = {colourByte(c[0] * scale), colourByte(c[1] * scale), colourByte(c[2] * scale),
                   255};
    if (vertex.colour_values == 4) colour->a = colourByte(c[3] * scale);
}

Vec3f ObjSource::NormalStream::next() {
    statements.next();
    double value[3];
    for (double& v : value) {
        if (!cursor.more()) cursor.fail("a normal of fewer than three numbers");
        v = cursor.takeReal("of a normal");
    }
    cursor.endStatement("a normal");
    return {float(value[0]), float(value[1]), float(value[2])};
}

void ObjSource::rewindTriangles() {
    faces_read_ = triangles_read_ = 0;
    in_face_ = false;
    faces_.rewind();
    reader_->release();
}

bool ObjSource::readTriangles(TriangleBatch& batch) {
    batch.first = triangles_read_;
    // A triangle takes some bytes, so a small file needs no large batch.
    batch.triangle.resize(size_t(std::min<uint64_t>(kMaxBatch, reader_->source().lengthBound())));
    TriangleRoom room{batch.triangle.data(), batch.triangle.size(), 0};
    if (triangles_read_ == 0) polygons_ = 0;
    if (faces_read_ < survey_.faceCount()) {
        faces_.enter();
        while (room.left() > 0 && (in_face_ || faces_read_ < survey_.faceCount())) {
            if (!in_face_) beginFace();
            while (room.left() > 0 && addCorner(room)) {
            }
        }
        faces_.leave();
    }
    batch.triangle.resize(room.size);
    triangles_read_ += room.size;
    return room.size > 0;
}

void ObjSource::beginFace() {
    faces_.next();
    in_face_ = true;
    corners_ = 0;
}

/// False at the end of the face.
bool ObjSource::addCorner(TriangleRoom& room) {
    if (!cursor_.more()) {
        if (corners_ < 3)
            cursor_.fail(fmt::format("a face of {} corners; it needs three at least", corners_));
        polygons_ += corners_ > 3;
        cursor_.endStatement("a face");
        in_face_ = false;
        ++faces_read_;
        return false;
    }
    const uint64_t index = indexOf(cursor_.takeCorner());
    if (corners_ >= 2) room.add(first_, previous_, index);
    if (corners_ == 0) first_ = index;
    previous_ = index;
    ++corners_;
    return true;
}

uint64_t ObjSource::indexOf(const ObjCorner& corner) const {
    const int64_t index = corner.vertex;
    const uint64_t before = faces_.verticesBefore();
    if (index > 0) {
        if (uint64_t(index) > survey_.vertexCount()) [[unlikely]]
            cursor_.fail(fmt::format("vertex index {} in a mesh of {} vertices", index,
                                     survey_.vertexCount()));
        return uint64_t(index) - 1;
    }
    if (uint64_t(-index) > before) [[unlikely]]
        cursor_.fail(fmt::format("vertex index {} after {} vertices", index, before));
    return before - uint64_t(-index);
}

}  // namespace

bool isObj(const FileSigns& signs) {
    if (signs.name.ends_with(".obj")) return true;
    const std::string_view text = signs.text();
    bool found = false;
    for (size_t begin = 0, end; (end = text.find_first_of("\r\n", begin)) != text.npos;
         begin = end + 1) {
        const std::string_view line = text.substr(begin, end - begin);
        const std::string_view word = line.substr(0, line.find_first_of(" \t"));
        constexpr std::string_view kWords[] = {"v", "vn",     "vt",     "f", "g", "o",
                                               "s", "usemtl", "mtllib", "l", "p"};
        if (word.empty() || word.starts_with('#')) continue;
        if (std::find(std::begin(kWords), std::end(kWords), word) == std::end(kWords)) return false;
        found = true;
    }
    return found;
}

std::unique_ptr<TriangleSource> openObj(std::unique_ptr<ByteReader> reader) {
    return openObjInBlocks(std::move(reader), kObjBlockBytes);
}

std::unique_ptr<TriangleSource> openObjInBlocks(std::unique_ptr<ByteReader> reader,
                                                uint64_t block_bytes) {
    return std::make_unique<ObjSource>(std::move(reader), block_bytes);
}

}  // namespace pietra
