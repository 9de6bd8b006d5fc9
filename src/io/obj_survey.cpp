#include "io/obj_survey.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "base/error.h"

namespace pietra {

namespace {

constexpr size_t kMaxBlocks = 4096;
/// Colours are in [0, 1], and a little more from some writers, or in [0, 255].
constexpr double kMostUnitColour = 2;

class Surveyor {
public:
    Surveyor(ByteReader& reader, uint64_t block_bytes)
        : reader_(reader), cursor_(reader), block_bytes_(block_bytes) {}
    ObjSurvey run();

private:
    void take(ObjWord word);
    void lookAtVertex();
    void lookAtFace();
    void beginBlock();
    void checkContent() const;
    std::vector<std::string> notes() const;

    ByteReader& reader_;
    ObjCursor cursor_;
    ObjSurvey survey_;
    ObjBlock here_;  ///< what stands before the cursor
    uint64_t block_bytes_;
    bool normals_match_ = true;
    double largest_colour_ = 0;
    uint64_t textures_ = 0, lines_ = 0, points_ = 0, materials_ = 0, paints_ = 0, free_forms_ = 0,
             unknown_ = 0;
    std::string first_unknown_;
};

ObjSurvey Surveyor::run() {
    here_.start = cursor_.start();
    survey_.blocks.push_back(here_);
    uint64_t next_block = here_.start.offset + block_bytes_;
    ObjWord word;
    while (cursor_.nextStatement(word)) {
        take(word);
        if (cursor_.offset() < next_block) continue;
        beginBlock();
        next_block = cursor_.offset() + block_bytes_;
    }
    beginBlock();
    checkContent();
    survey_.normals = here_.normals > 0 && normals_match_ && here_.normals == here_.vertices;
    if (largest_colour_ > kMostUnitColour) survey_.colour_scale = 1;
    survey_.notes = notes();
    reader_.release();
    return std::move(survey_);
}

/// From here on is another block. Where the table is full, blocks become twice as long.
void Surveyor::beginBlock() {
    std::vector<ObjBlock>& blocks = survey_.blocks;
    here_.start = cursor_.place();
    if (blocks.size() == kMaxBlocks) {
        for (size_t i = 0; 2 * i < blocks.size(); ++i) blocks[i] = blocks[2 * i];
        blocks.resize(kMaxBlocks / 2);
        block_bytes_ *= 2;
    }
    blocks.push_back(here_);
}

void Surveyor::take(ObjWord word) {
    switch (word) {
        case ObjWord::kVertex:
            ++here_.vertices;
            return lookAtVertex();
        case ObjWord::kFace:
            ++here_.faces;
            return lookAtFace();
        case ObjWord::kNormal:
            ++here_.normals;
            break;
        case ObjWord::kTexture:
            ++textures_;
            break;
        case ObjWord::kLine:
            ++lines_;
            break;
        case ObjWord::kPoint:
            ++points_;
            break;
        case ObjWord::kMaterial:
            ++materials_;
            break;
        case ObjWord::kPaint:
            ++paints_;
            break;
        case ObjWord::kFreeForm:
            ++free_forms_;
            break;
        case ObjWord::kGroup:
            break;
        case ObjWord::kUnknown: {
            const std::string name = cursor_.wordHere();
            if (!std::isalpha(static_cast<unsigned char>(name.front())) ||
                name.find('?') != std::string::npos)
                cursor_.failWord("begins no statement of an OBJ file");
            if (unknown_++ == 0)
                first_unknown_ = fmt::format("\"{}\" on line {}", name, cursor_.place().line);
            break;
        }
    }
    cursor_.skipStatement();
}

void Surveyor::lookAtVertex() {
    if (cursor_.countWords() < 6) return cursor_.skipStatement();
    ObjVertex vertex;
    takeVertex(cursor_, vertex);
    if (vertex.colour_values == 0) return;
    survey_.colours = true;
    for (int k = 0; k < vertex.colour_values; ++k)
        largest_colour_ = std::max(largest_colour_, vertex.colour[k]);
}

void Surveyor::lookAtFace() {
    const size_t corners = cursor_.countWords();
    survey_.triangles += corners > 2 ? corners - 2 : 1;
    // The number, from 0, that an index stands for where `before` of its kind stand before it.
    const auto resolve = [](int64_t index, uint64_t before) {
        return index > 0 ? uint64_t(index) - 1 : before + uint64_t(index);
    };
    while (normals_match_ && cursor_.more()) {
        const ObjCorner corner = cursor_.takeCorner();
        normals_match_ = corner.normal != 0 && resolve(corner.vertex, here_.vertices) ==
                                                   resolve(corner.normal, here_.normals);
    }
    cursor_.skipStatement();
}

void Surveyor::checkContent() const {
    if (here_.vertices == 0)
        throw InputError(reader_.path(), "", "has no vertices: nothing to show");
    if (here_.faces == 0)
        throw InputError(reader_.path(), "",
                         "has vertices but no faces: a cloud of points is nothing to show");
}

std::vector<std::string> Surveyor::notes() const {
    std::vector<std::string> notes;
    if (here_.normals > 0 && !survey_.normals)
        notes.push_back(
            "normals are left out, as they are not one to one with the vertices: they are computed "
            "from the triangles");
    if (textures_ > 0) notes.push_back("texture coordinates are left out");
    if (materials_ > 0) notes.push_back("materials are left out");
    if (paints_ > 0) notes.push_back("the colours in comments (#MRGB) are left out");
    if (lines_ + points_ > 0)
        notes.push_back(
            fmt::format("{} lines and {} statements of points are left out", lines_, points_));
    if (free_forms_ > 0) notes.push_back("free-form curves and surfaces are left out");
    if (unknown_ > 0)
        notes.push_back(fmt::format("{} statements of no known kind are left out ({})", unknown_,
                                    first_unknown_));
    return notes;
}

}  // namespace

ObjSurvey surveyObj(ByteReader& reader, uint64_t block_bytes) {
    return Surveyor(reader, block_bytes).run();
}

void takeVertex(ObjCursor& cursor, ObjVertex& vertex) {
    constexpr const char* kAxes[] = {"x of a vertex", "y of a vertex", "z of a vertex"};
    for (int k = 0; k < 3; ++k) {
        if (!cursor.more()) [[unlikely]]
            cursor.fail(fmt::format("a vertex of {} coordinates, not three", k));
        vertex.position[k] = cursor.takeReal(kAxes[k]);
    }
    vertex.colour_values = 0;
    vertex.weight = 1;
    if (!cursor.more()) return cursor.endStatement("a vertex");
    double rest[4] = {};
    int count = 0;
    for (; count < 4 && (count == 0 || cursor.more()); ++count)
        rest[count] = cursor.takeReal("of a vertex");
    if (count == 2)
        cursor.fail("a vertex of 5 numbers: 3 are a point, 4 have a weight, 6 and 7 a colour");
    if (count == 1) {
        vertex.weight = rest[0];
    } else {
        vertex.colour_values = count;
        std::copy(rest, rest + count, vertex.colour);
    }
    cursor.endStatement("a vertex");
}

}  // namespace pietra
