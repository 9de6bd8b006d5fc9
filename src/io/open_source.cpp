// openSource(): finds the reader of a file; several files are joined into one model.

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "base/check.h"
#include "base/error.h"
#include "io/formats.h"
#include "io/joined_source.h"
#include "io/triangle_source.h"

namespace pietra {

namespace {

constexpr size_t kHeadBytes = 4096;

std::string lowerCaseName(const std::string& path) {
    std::string name = path;
    for (char& c : name) c = char(std::tolower(static_cast<unsigned char>(c)));
    for (const std::string packed : {".gz", ".xz", ".zst"})
        if (name.ends_with(packed)) name.resize(name.size() - packed.size());
    return name;
}

/// Throws InputError where there is none that Pietra reads.
const MeshFormat& formatOf(ByteReader& reader, const std::string& path) {
    const size_t size = std::min(reader.peek(kHeadBytes), kHeadBytes);
    if (size == 0) throw InputError(path, "", "the file is empty");
    const std::span<const uint8_t> head(reader.data(), size);
    const std::string name = lowerCaseName(path);
    std::string known;
    for (const MeshFormat& format : meshFormats()) {
        if (format.matches(head, name)) return format;
        known += fmt::format("{}{}", known.empty() ? "" : ", ", format.name);
    }
    throw InputError(path, "", fmt::format("is of no format that Pietra reads ({})", known));
}

std::unique_ptr<TriangleSource> openOne(const std::string& path) {
    auto reader = std::make_unique<ByteReader>(openBytes(path));
    return formatOf(*reader, path).open(std::move(reader));
}

}  // namespace

void checkMeshFormat(const std::string& path) {
    ByteReader reader(openBytes(path));
    formatOf(reader, path);
}

std::unique_ptr<TriangleSource> openSource(const std::vector<std::string>& paths) {
    CHECK(!paths.empty());
    if (paths.size() == 1) return openOne(paths.front());
    std::vector<SourcePart> parts;
    for (const std::string& path : paths) parts.push_back({path, openOne(path)});
    return joinSources(std::move(parts));
}

}  // namespace pietra
