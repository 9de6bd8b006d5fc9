// openSource(): finds the reader of a file; several files are joined into one model.

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

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
    for (const std::string_view packed : kPackedEndings)
        if (name.ends_with(packed)) name.resize(name.size() - packed.size());
    return name;
}

/// Throws InputError where there is none that Pietra reads.
const MeshFormat& formatOf(ByteReader& reader, const std::string& path) {
    const size_t size = std::min(reader.peek(kHeadBytes), kHeadBytes);
    if (size == 0) throw InputError(path, "", "the file is empty");
    const ByteSource& source = reader.source();
    const FileSigns signs{{reader.data(), size},
                          lowerCaseName(path),
                          source.isCompressed() ? 0 : source.lengthBound()};
    std::string known;
    for (const MeshFormat& format : meshFormats()) {
        if (format.matches(signs)) return format;
        known += fmt::format("{}{}", known.empty() ? "" : ", ", format.name);
    }
    throw InputError(path, "", fmt::format("is of no format that Pietra reads ({})", known));
}

std::unique_ptr<TriangleSource> openOne(const std::string& path, const std::string& temp_dir) {
    auto reader = std::make_unique<ByteReader>(openBytes(path, temp_dir));
    return formatOf(*reader, path).open(std::move(reader));
}

}  // namespace

void checkMeshFormat(const std::string& path) {
    std::error_code fault;
    if (std::filesystem::is_fifo(path, fault))
        throw InputError(path, "", "is a pipe, not a file: build a model of it first");
    ByteReader reader(openBytes(path));
    formatOf(reader, path);
}

std::unique_ptr<TriangleSource> openSource(const std::vector<std::string>& paths,
                                           const std::string& temp_dir) {
    CHECK(!paths.empty());
    if (paths.size() == 1) return openOne(paths.front(), temp_dir);
    std::vector<SourcePart> parts;
    for (const std::string& path : paths) parts.push_back({path, openOne(path, temp_dir)});
    return joinSources(std::move(parts));
}

}  // namespace pietra
