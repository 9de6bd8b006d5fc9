#include "io/ply_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>

#include "base/check.h"
#include "base/error.h"
#include "io/file_signs.h"
#include "io/notes.h"

namespace pietra {

namespace {

struct TypeName {
    std::string_view name;
    PlyType type;
};
constexpr TypeName kTypeNames[] = {
    {"char", PlyType::kInt8},     {"uchar", PlyType::kUint8},   {"short", PlyType::kInt16},
    {"ushort", PlyType::kUint16}, {"int", PlyType::kInt32},     {"uint", PlyType::kUint32},
    {"int64", PlyType::kInt64},   {"uint64", PlyType::kUint64}, {"float", PlyType::kFloat},
    {"double", PlyType::kDouble}, {"int8", PlyType::kInt8},     {"uint8", PlyType::kUint8},
    {"int16", PlyType::kInt16},   {"uint16", PlyType::kUint16}, {"int32", PlyType::kInt32},
    {"uint32", PlyType::kUint32}, {"float32", PlyType::kFloat}, {"float64", PlyType::kDouble},
};

/// More of either is no mesh but an attack on the quadratic search for names.
constexpr size_t kMaxElements = 1000;
constexpr size_t kMaxProperties = 1000;

/// The words of a line and where the next line starts.
class HeaderLines {
public:
    explicit HeaderLines(ByteReader& reader) : path_(reader.path()) {
        reader.seek(0);
        const size_t size = std::min(reader.peek(kMaxPlyHeader), kMaxPlyHeader);
        text_ = {reinterpret_cast<const char*>(reader.data()), size};
        if (text_.starts_with(kByteOrderMark)) position_ = kByteOrderMark.size();
        // note: which line end the file uses must be decided before the last line, or a binary body
        // that begins with the byte 10 would lose it.
        const size_t first_end = text_.find_first_of("\r\n");
        if (first_end != text_.npos && text_[first_end] == '\r')
            end_ = text_.substr(first_end).starts_with("\r\n") ? "\r\n" : "\r";
    }

    /// False where the text ends without a whole further line.
    bool next() {
        const size_t line_end = text_.find(end_.back(), position_);
        if (line_end == text_.npos) return false;
        std::string_view line = text_.substr(position_, line_end - position_);
        position_ = line_end + 1;
        ++number_;
        split(line);
        return true;
    }

    const std::vector<std::string_view>& words() const { return words_; }
    uint64_t number() const { return number_; }
    size_t position() const { return position_; }
    [[noreturn]] void fail(const std::string& what) const {
        throw InputError::atLine(path_, number_, what);
    }

private:
    void split(std::string_view line) {
        words_.clear();
        constexpr std::string_view blanks = " \t\r";
        for (size_t at = line.find_first_not_of(blanks); at != line.npos;) {
            const size_t end = std::min(line.find_first_of(blanks, at), line.size());
            words_.push_back(line.substr(at, end - at));
            at = line.find_first_not_of(blanks, end);
        }
    }

    const std::string& path_;
    std::string_view text_;
    std::string_view end_ = "\n";
    size_t position_ = 0;
    uint64_t number_ = 0;
    std::vector<std::string_view> words_;
};

std::string quoted(std::string_view word) {
    return '"' + printable(word) + '"';
}

PlyType parseType(const HeaderLines& lines, std::string_view word) {
    for (const TypeName& t : kTypeNames)
        if (t.name == word) return t.type;
    lines.fail(fmt::format("{} is no type of a property", quoted(word)));
}

PlyEncoding parseFormat(const HeaderLines& lines) {
    const auto& words = lines.words();
    if (words.size() < 2) lines.fail("the format is missing");
    if (words[1] == "ascii") return PlyEncoding::kAscii;
    if (words[1] == "binary_little_endian") return PlyEncoding::kLittleEndian;
    if (words[1] == "binary_big_endian") return PlyEncoding::kBigEndian;
    lines.fail(fmt::format("{} is no format of a PLY file", quoted(words[1])));
}

PlyElement parseElement(const HeaderLines& lines, const PlyHeader& header) {
    const auto& words = lines.words();
    if (words.size() < 3) lines.fail("an element has a name and a count");
    PlyElement element;
    element.name = words[1];
    const char* end = words[2].data() + words[2].size();
    const auto [rest, fault] = std::from_chars(words[2].data(), end, element.count);
    if (fault != std::errc() || rest != end)
        lines.fail(fmt::format("the count of element {} is no number: {}", quoted(words[1]),
                               quoted(words[2])));
    if (header.elements.size() >= kMaxElements)
        lines.fail(fmt::format("more than {} elements", kMaxElements));
    if (header.find(element.name))
        lines.fail(fmt::format("element {} stands there twice", quoted(words[1])));
    return element;
}

PlyProperty parseProperty(const HeaderLines& lines, const PlyElement& element) {
    const auto& words = lines.words();
    PlyProperty property;
    property.is_list = words.size() > 1 && words[1] == "list";
    if (words.size() < (property.is_list ? 5u : 3u))
        lines.fail("a property has a type and a name, a list two types and a name");
    if (property.is_list) {
        property.count_type = parseType(lines, words[2]);
        if (isReal(property.count_type)) lines.fail("the count of a list cannot be a real number");
    }
    property.type = parseType(lines, words[property.is_list ? 3 : 1]);
    property.name = words[property.is_list ? 4 : 2];
    if (element.properties.size() >= kMaxProperties)
        lines.fail(fmt::format("more than {} properties of one element", kMaxProperties));
    if (element.find(property.name))
        lines.fail(fmt::format("property {} of element {} stands there twice",
                               quoted(property.name), quoted(element.name)));
    return property;
}

}  // namespace

size_t sizeOf(PlyType type) {
    constexpr size_t sizes[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    return sizes[size_t(type)];
}

const char* nameOf(PlyType type) {
    for (const TypeName& t : kTypeNames)
        if (t.type == type) return t.name.data();
    CHECK(false);
    return "";
}

bool PlyElement::hasLists() const {
    return std::any_of(properties.begin(), properties.end(),
                       [](const PlyProperty& p) { return p.is_list; });
}

size_t PlyElement::minimumRowBytes() const {
    size_t bytes = 0;
    for (const PlyProperty& p : properties) bytes += sizeOf(p.is_list ? p.count_type : p.type);
    return bytes;
}

std::optional<size_t> PlyElement::find(const std::string& wanted) const {
    for (size_t i = 0; i < properties.size(); ++i)
        if (properties[i].name == wanted) return i;
    return std::nullopt;
}

const PlyElement* PlyHeader::find(const std::string& wanted) const {
    for (const PlyElement& e : elements)
        if (e.name == wanted) return &e;
    return nullptr;
}

PlyHeader readPlyHeader(ByteReader& reader) {
    HeaderLines lines(reader);
    PlyHeader header;
    bool has_format = false;
    if (!lines.next() || lines.words().size() != 1 || lines.words()[0] != "ply")
        throw InputError(reader.path(), "", "is no PLY file: its first line is not \"ply\"");
    while (true) {
        if (!lines.next())
            throw InputError::atLine(reader.path(), lines.number() + 1,
                                     "the header has no end_header");
        if (lines.words().empty()) continue;
        const std::string_view word = lines.words()[0];
        if (word == "end_header") break;
        if (word == "comment" || word == "obj_info") {
            if (lines.words().size() > 2 && lines.words()[1] == "TextureFile")
                header.names_textures = true;
            continue;
        }
        if (word == "format") {
            header.encoding = parseFormat(lines);
            has_format = true;
        } else if (word == "element") {
            header.elements.push_back(parseElement(lines, header));
        } else if (word == "property") {
            if (header.elements.empty()) lines.fail("a property stands before the first element");
            PlyElement& element = header.elements.back();
            element.properties.push_back(parseProperty(lines, element));
        } else {
            lines.fail(fmt::format("{} is no word of a PLY header", quoted(word)));
        }
    }
    if (!has_format)
        throw InputError::atLine(reader.path(), lines.number(), "the header names no format");
    header.body_offset = lines.position();
    header.body_line = lines.number() + 1;
    return header;
}

}  // namespace pietra
