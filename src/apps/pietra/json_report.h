#pragma once
// Outputs of the verbs that are no meshes: reports as JSON, and standard output.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace pietra {

/// Throws what writing `path` later would: UsageError if it exists and `force` is false or if it is
/// no regular file, IoError if it is a directory or its folder is missing or not writable. For the
/// start of a verb, so that hours of work do not end in a refusal. Empty and "-" are fine.
void checkOutput(const std::string& path, bool force);

/// Indented JSON with a newline; atomic. "-" is standard output; an empty path writes nothing.
void writeReport(const std::string& path, const nlohmann::ordered_json& report, bool force);

/// Any other text, likewise.
void writeText(const std::string& path, std::string_view text, bool force);

/// JSON to standard output.
void printJson(const nlohmann::ordered_json& json);

/// Writes to standard output and flushes it; throws IoError.
void printOut(std::string_view text);

}  // namespace pietra
