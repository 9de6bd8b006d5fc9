#include "io/gltf_buffers.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "base/error.h"
#include "io/file_signs.h"

namespace pietra {

namespace {

constexpr uint8_t kNoDigit = 64;

constexpr std::array<uint8_t, 256> makeDigits() {
    constexpr std::string_view kAlphabet =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::array<uint8_t, 256> digits{};
    for (uint8_t& d : digits) d = kNoDigit;
    for (size_t i = 0; i < kAlphabet.size(); ++i) digits[uint8_t(kAlphabet[i])] = uint8_t(i);
    return digits;
}

constexpr std::array<uint8_t, 256> kDigits = makeDigits();

/// Decodes groups of four characters to three bytes each; returns how many characters were digits.
size_t decodeBase64(std::string_view text, uint8_t* out) {
    for (size_t i = 0; i + 4 <= text.size(); i += 4, out += 3) {
        uint32_t bits = 0;
        for (size_t k = 0; k < 4; ++k) {
            const uint8_t digit = kDigits[uint8_t(text[i + k])];
            if (digit == kNoDigit) return i + k;
            bits = bits << 6 | digit;
        }
        out[0] = uint8_t(bits >> 16);
        out[1] = uint8_t(bits >> 8);
        out[2] = uint8_t(bits);
    }
    return text.size();
}

/// "%20" to " "; none if it is no such code.
std::optional<std::string> percentDecoded(std::string_view uri) {
    std::string out;
    for (size_t i = 0; i < uri.size(); ++i) {
        if (uri[i] != '%') {
            out += uri[i];
            continue;
        }
        uint8_t code = 0;
        const char* const digits = uri.data() + i + 1;
        if (i + 2 >= uri.size() || std::from_chars(digits, digits + 2, code, 16).ptr != digits + 2)
            return {};
        out += char(code);
        i += 2;
    }
    return out;
}

bool hasScheme(std::string_view uri) {
    const size_t colon = uri.find(':');
    return colon != uri.npos && uri.find_first_of("/?#") > colon;
}

}  // namespace

/// Where a buffer lies.
struct GltfBuffers::Place {
    enum Kind { kFile, kBeside, kBase64, kMemory } kind = kFile;
    uint64_t offset = 0;               ///< kFile, kBase64: of its first byte or character
    uint64_t characters = 0;           ///< kBase64, without padding
    std::string path;                  ///< kBeside
    std::unique_ptr<ByteSource> held;  ///< kMemory, and of packed files beside it the copy
    uint64_t bytes = 0;                ///< how many there are
};

GltfBuffers::GltfBuffers(std::unique_ptr<ByteSource> file, const GltfDocument& document,
                         std::optional<GltfChunk> chunk)
    : file_(std::move(file)),
      document_(document),
      chunk_(chunk),
      places_(document.buffers.size()),
      stored_bytes_(file_->storedBytes()) {}

GltfBuffers::~GltfBuffers() = default;

void GltfBuffers::fail(uint32_t buffer, const char* key, const std::string& what) const {
    throw InputError(path(), fmt::format("buffers[{}].{}", buffer, key), what);
}

void GltfBuffers::require(uint32_t buffer) {
    if (places_[buffer]) return;
    auto place = std::make_unique<Place>(locate(buffer));
    if (place->kind == Place::kBeside) {
        auto source = openBytes(place->path, file_->tempDir());
        const bool packed = source->isCompressed();
        if (packed) source = source->unpacked();
        place->bytes = source->lengthBound();
        stored_bytes_ += source->storedBytes();
        if (packed) place->held = std::move(source);
    }
    if (sizeOf(buffer) > place->bytes)
        fail(buffer, "byteLength",
             fmt::format("counts {} bytes, but there are {}{}", sizeOf(buffer), place->bytes,
                         place->kind == Place::kBeside ? " in " + place->path : std::string()));
    places_[buffer] = std::move(place);
}

GltfBuffers::Place GltfBuffers::locate(uint32_t buffer) const {
    Place place;
    if (!document_.buffers[buffer].uri) {
        if (buffer != 0 || !chunk_)
            fail(buffer, "uri", "is missing, so its data is nowhere" + document_.whyMissing());
        place.offset = chunk_->offset;
        place.bytes = chunk_->bytes;
        return place;
    }
    const std::string& uri = *document_.buffers[buffer].uri;
    if (uri.starts_with("data:")) return locateData(buffer, uri);
    const auto name = percentDecoded(uri);
    if (!name || name->empty() || hasScheme(uri) || uri.front() == '/' ||
        name->find('\0') != name->npos)
        fail(buffer, "uri", "is no name of a file beside the glTF file");
    place.kind = Place::kBeside;
    place.path = (std::filesystem::path(path()).parent_path() / *name).string();
    std::error_code fault;
    if (!std::filesystem::exists(place.path, fault))
        for (const char* ending : kPackedEndings)
            if (std::filesystem::exists(place.path + ending, fault)) {
                place.path += ending;
                break;
            }
    return place;
}

GltfBuffers::Place GltfBuffers::locateData(uint32_t buffer, const std::string& uri) const {
    const size_t comma = uri.find(',');
    if (comma == uri.npos || !std::string_view(uri).substr(0, comma).ends_with(";base64"))
        fail(buffer, "uri", "holds data that is not base64");
    std::string_view text = std::string_view(uri).substr(comma + 1);
    Place place;
    if (text.starts_with("@")) {  // see gltf_text.h
        place.kind = Place::kBase64;
        const char* const end = text.data() + text.size();
        const auto first = std::from_chars(text.data() + 1, end, place.offset);
        if (first.ptr < end) std::from_chars(first.ptr + 1, end, place.characters);
        const uint64_t length = file_->lengthBound();
        if (place.offset > length || place.characters > length - place.offset)
            fail(buffer, "uri", "its base64 data is damaged");
        char last[2] = {};
        while (place.characters > 0 &&
               file_->read(place.offset + place.characters - 1, last, 1) == 1 && last[0] == '=')
            --place.characters;
        place.bytes = place.characters / 4 * 3 + place.characters % 4 * 3 / 4;
        return place;
    }
    while (text.ends_with('=')) text.remove_suffix(1);
    const size_t bytes = text.size() / 4 * 3 + text.size() % 4 * 3 / 4;
    std::string padded(text);
    padded.resize((text.size() + 3) / 4 * 4, 'A');
    std::vector<uint8_t> decoded(padded.size() / 4 * 3);
    if (decodeBase64(padded, decoded.data()) < padded.size())
        fail(buffer, "uri", "its base64 data is damaged");
    decoded.resize(bytes);
    place.kind = Place::kMemory;
    place.bytes = bytes;
    place.held = bytesInMemory(path(), std::move(decoded));
    return place;
}

ByteSource& GltfBuffers::open(uint32_t buffer) {
    const auto at = std::find_if(open_.begin(), open_.end(),
                                 [&](const OpenFile& f) { return f.buffer == buffer; });
    if (at != open_.end()) {
        std::rotate(at, at + 1, open_.end());
    } else {
        if (open_.size() >= kOpenFiles) open_.erase(open_.begin());
        open_.push_back({buffer, openBytes(places_[buffer]->path)});
    }
    return *open_.back().source;
}

void GltfBuffers::read(uint32_t buffer, uint64_t offset, uint8_t* out, size_t bytes) {
    const Place& place = *places_[buffer];
    size_t done = bytes;
    switch (place.kind) {
        case Place::kFile:
            done = file_->read(place.offset + offset, out, bytes);
            break;
        case Place::kBeside:
            done = (place.held ? *place.held : open(buffer)).read(offset, out, bytes);
            break;
        case Place::kMemory:
            done = place.held->read(offset, out, bytes);
            break;
        case Place::kBase64:
            readBase64(place, offset, out, bytes);
            break;
    }
    if (done < bytes)
        throw InputError(place.kind == Place::kBeside ? place.path : path(),
                         fmt::format("byte {}", place.offset + offset + done),
                         "the file has become shorter");
}

void GltfBuffers::readBase64(const Place& place, uint64_t offset, uint8_t* out, size_t bytes) {
    const uint64_t first = offset / 3 * 4;
    const uint64_t last = std::min((offset + bytes + 2) / 3 * 4, place.characters);
    std::string text(size_t(last - first), '\0');
    text.resize(file_->read(place.offset + first, text.data(), text.size()));
    if (text.size() < last - first)
        throw InputError::atByte(path(), place.offset + first + text.size(),
                                 "the file has become shorter");
    text.resize((text.size() + 3) / 4 * 4, 'A');
    std::vector<uint8_t> decoded(text.size() / 4 * 3);
    const size_t good = decodeBase64(text, decoded.data());
    if (good < text.size())
        throw InputError::atByte(path(), place.offset + first + good, "is no character of base64");
    std::memcpy(out, decoded.data() + offset % 3, bytes);
}

const uint8_t* GltfBuffers::window(uint32_t buffer, uint64_t begin, uint64_t end) {
    const auto at = std::find_if(windows_.begin(), windows_.end(), [&](const Window& w) {
        return w.buffer == buffer && w.begin == begin && w.end == end;
    });
    if (at != windows_.end()) {
        std::rotate(at, at + 1, windows_.end());
        return windows_.back().bytes.data();
    }
    if (windows_.size() < kWindows)
        windows_.emplace_back();
    else
        std::rotate(windows_.begin(), windows_.begin() + 1, windows_.end());
    Window& window = windows_.back();
    // note: a window whose reading fails must not be found again.
    window.begin = window.end = 0;
    window.buffer = kGltfNone;
    window.bytes.resize(size_t(end - begin));
    read(buffer, begin, window.bytes.data(), window.bytes.size());
    window.buffer = buffer;
    window.begin = begin;
    window.end = end;
    return window.bytes.data();
}

std::string GltfBuffers::placeOf(uint32_t buffer, uint64_t offset) const {
    const Place& place = *places_[buffer];
    if (place.kind == Place::kBeside) return fmt::format("byte {} of {}", offset, place.path);
    if (place.kind == Place::kFile) return fmt::format("byte {}", place.offset + offset);
    return fmt::format("byte {} of the data in buffers[{}].uri", offset, buffer);
}

}  // namespace pietra
