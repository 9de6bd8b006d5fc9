#include "io/ply_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string_view>

#include "base/error.h"
#include "io/notes.h"
#include "io/ply_cursor.h"
#include "io/ply_faces.h"
#include "io/ply_header.h"
#include "io/ply_vertices.h"

namespace pietra {

namespace {

bool holdsFaces(const PlyElement& e) {
    return e.name == "face" || e.name == "tristrips";
}

/// Fewest bytes that `element` can take.
uint64_t minimumBytes(const PlyElement& element, PlyEncoding encoding) {
    // In ascii each value has a digit at least, and a blank or line end after it.
    const uint64_t row =
        encoding == PlyEncoding::kAscii ? 2 * element.properties.size() : element.minimumRowBytes();
    if (row > 0 && element.count > UINT64_MAX / row) return UINT64_MAX;
    return row * element.count;
}

class PlySource : public TriangleSource {
public:
    explicit PlySource(std::unique_ptr<ByteReader> reader)
        : reader_(std::move(reader)),
          header_(readPlyHeader(*reader_)),
          cursor_(*reader_, header_.encoding),
          vertex_element_(findVertices()),
          vertices_(cursor_, header_.elements[vertex_element_]),
          starts_(header_.elements.size() + 1) {
        for (const PlyElement& e : header_.elements) {
            if (!holdsFaces(e)) continue;
            faces_.emplace_back(cursor_, e, vertexCount());
            if (e.count > 0) has_faces_ = true;
        }
        starts_[0] = PlyPlace{header_.body_offset, header_.body_line};
        checkCounts();
        reader_->release();
    }

    const AttributeSchema& schema() const override { return vertices_.schema(); }
    uint64_t vertexCount() override { return header_.elements[vertex_element_].count; }
    uint64_t triangleCountHint() override;
    uint64_t inputBytes() const override { return reader_->source().storedBytes(); }
    bool cheapToReread() const override {
        return header_.encoding != PlyEncoding::kAscii && !reader_->source().isCompressed();
    }
    std::vector<std::string> notes() const override;

    void rewindVertices() override {
        vertices_read_ = 0;
        reader_->release();
    }
    bool readVertices(VertexBatch& batch) override;
    void rewindTriangles() override;
    bool readTriangles(TriangleBatch& batch) override;

private:
    size_t findVertices() const;
    void checkCounts() const;
    void goTo(size_t element);
    size_t elementOf(size_t face_reader) const;
    void checkRest();

    std::unique_ptr<ByteReader> reader_;
    PlyHeader header_;
    PlyCursor cursor_;
    size_t vertex_element_;
    PlyVertexReader vertices_;
    std::vector<PlyFaceReader> faces_;  ///< one for each element that holds faces, in order
    bool has_faces_ = false;
    /// Where each element starts, as far as known; the last entry is the end of the last one.
    std::vector<std::optional<PlyPlace>> starts_;
    bool rest_checked_ = false;

    uint64_t vertices_read_ = 0;
    PlyPlace vertex_place_;
    uint64_t triangles_read_ = 0;
    size_t face_reader_ = 0;
    bool in_faces_ = false;  ///< faces_[face_reader_] was started
    PlyPlace face_place_;
};

size_t PlySource::findVertices() const {
    for (size_t i = 0; i < header_.elements.size(); ++i)
        if (header_.elements[i].name == "vertex") return i;
    throw InputError(reader_->path(), "", "the header has no element vertex");
}

/// So that no caller allocates for a count that the file cannot back.
void PlySource::checkCounts() const {
    uint64_t left = reader_->source().lengthBound();
    left -= std::min(left, header_.body_offset);
    if (header_.encoding == PlyEncoding::kAscii) ++left;  // the last line end may be missing
    for (const PlyElement& e : header_.elements) {
        const uint64_t bytes = minimumBytes(e, header_.encoding);
        if (bytes > left)
            throw InputError(reader_->path(), "",
                             fmt::format("the file is too short for the {} rows of element {} that "
                                         "its header counts",
                                         e.count, e.name));
        left -= bytes;
    }
    if (header_.elements[vertex_element_].count == 0)
        throw InputError(reader_->path(), "", "has no vertices: nothing to show");
    if (!has_faces_)
        throw InputError(reader_->path(), "",
                         "has vertices but no faces: a cloud of points is nothing to show");
}

uint64_t PlySource::triangleCountHint() {
    uint64_t count = 0;
    for (const PlyElement& e : header_.elements) {
        if (e.name == "face") count += e.count;
        // Strips are few and long; closed meshes have about two triangles a vertex.
        if (e.name == "tristrips" && e.count > 0) count += 2 * vertexCount();
    }
    return count;
}

std::vector<std::string> PlySource::notes() const {
    std::vector<std::string> notes = vertices_.notes();
    for (const PlyFaceReader& faces : faces_) {
        const auto& schema_notes = faces.schemaNotes();
        notes.insert(notes.end(), schema_notes.begin(), schema_notes.end());
        for (std::string& note : faces.notes()) notes.push_back(std::move(note));
    }
    std::vector<std::string> others;
    for (const PlyElement& e : header_.elements)
        if (e.name != "vertex" && !holdsFaces(e) && e.count > 0) others.push_back(e.name);
    if (!others.empty()) notes.push_back(leftOut("element", others));
    if (header_.names_textures) notes.push_back("textures are left out");
    return notes;
}

/// Moves the cursor to the start of an element (or, for the one after the last, to the end),
/// reading over what stands before it where nothing else tells.
void PlySource::goTo(size_t element) {
    size_t known = element;
    while (!starts_[known]) --known;
    cursor_.seek(*starts_[known]);
    for (; known < element; ++known) {
        cursor_.beginRows(header_.elements[known], 0);
        cursor_.skipRows(header_.elements[known].count);
        starts_[known + 1] = cursor_.place();
    }
}

bool PlySource::readVertices(VertexBatch& batch) {
    if (vertices_read_ == 0) {
        goTo(vertex_element_);
    } else {
        cursor_.seek(vertex_place_);
    }
    cursor_.beginRows(header_.elements[vertex_element_], vertices_read_);
    vertices_.read(vertices_read_, batch);
    vertices_read_ += batch.position.size();
    vertex_place_ = cursor_.place();
    if (vertices_read_ == vertexCount()) starts_[vertex_element_ + 1] = vertex_place_;
    return !batch.position.empty();
}

void PlySource::rewindTriangles() {
    triangles_read_ = face_reader_ = 0;
    in_faces_ = false;
    reader_->release();
}

size_t PlySource::elementOf(size_t face_reader) const {
    size_t element = 0;
    for (size_t seen = 0;; ++element)
        if (holdsFaces(header_.elements[element]) && seen++ == face_reader) return element;
}

bool PlySource::readTriangles(TriangleBatch& batch) {
    batch.first = triangles_read_;
    // A triangle takes some bytes, so a small file needs no large batch.
    batch.triangle.resize(size_t(std::min<uint64_t>(kMaxBatch, reader_->source().lengthBound())));
    TriangleRoom room{batch.triangle.data(), batch.triangle.size(), 0};
    while (face_reader_ < faces_.size() && room.left() > 0) {
        const size_t element = elementOf(face_reader_);
        if (!in_faces_) {
            goTo(element);
            faces_[face_reader_].start();
            in_faces_ = true;
        } else {
            cursor_.seek(face_place_);
            cursor_.beginRows(header_.elements[element], faces_[face_reader_].row());
        }
        const bool ended = faces_[face_reader_].read(room);
        face_place_ = cursor_.place();
        if (!ended) break;
        starts_[element + 1] = face_place_;
        ++face_reader_;
        in_faces_ = false;
    }
    batch.triangle.resize(room.size);
    triangles_read_ += room.size;
    if (room.size > 0) return true;
    if (triangles_read_ == 0)
        throw InputError(reader_->path(), "",
                         "has no face of three corners or more: nothing to show");
    checkRest();
    return false;
}

/// Once all triangles are read: what the header counts beyond them must be there too, and no more.
void PlySource::checkRest() {
    if (rest_checked_) return;
    goTo(header_.elements.size());
    cursor_.expectEnd();
    rest_checked_ = true;
}

}  // namespace

bool isPly(const FileSigns& signs) {
    const std::string_view text = signs.text();
    return text.size() > 3 && text.starts_with("ply") && isBlankOrLineEnd(text[3]);
}

std::unique_ptr<TriangleSource> openPly(std::unique_ptr<ByteReader> reader) {
    return std::make_unique<PlySource>(std::move(reader));
}

}  // namespace pietra
