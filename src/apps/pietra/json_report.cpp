#include "apps/pietra/json_report.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "extmem/file.h"

namespace pietra {

namespace {

std::string jsonText(const nlohmann::ordered_json& json) {
    // File names need not be UTF-8; JSON must be.
    return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string folderOf(const std::string& path) {
    const size_t slash = path.rfind('/');
    return slash == std::string::npos ? "." : path.substr(0, slash + 1);
}

}  // namespace

void checkOutput(const std::string& path, bool force) {
    if (path.empty() || path == "-") return;
    struct stat info {};
    if (::stat(path.c_str(), &info) == 0) {
        if (S_ISDIR(info.st_mode)) throw IoError(path, "write", EISDIR);
        if (!force) throw UsageError(fmt::format("{}: exists; --force overwrites it", path));
        if (!S_ISREG(info.st_mode)) throw UsageError(fmt::format("{}: is no regular file", path));
    }
    if (::access(folderOf(path).c_str(), W_OK | X_OK) != 0) throw IoError(path, "create", errno);
}

void writeReport(const std::string& path, const nlohmann::ordered_json& report, bool force) {
    if (!path.empty()) writeText(path, jsonText(report), force);
}

void writeText(const std::string& path, std::string_view text, bool force) {
    if (path == "-") return printOut(text);
    AtomicFile file(path, force);
    file.file().write(text.data(), text.size());
    file.commit();
}

void printJson(const nlohmann::ordered_json& json) {
    printOut(jsonText(json));
}

void printOut(std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
        throw IoError("standard output", "write", errno);
}

}  // namespace pietra
