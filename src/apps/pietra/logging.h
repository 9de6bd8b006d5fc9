#pragma once
// Messages to people: to standard error, and with times to a log file where one is given.
// Thread-safe. A progress bar steps aside while a message is written (status_line.h). Until
// setUpLogging() is called, messages of level info and above go to standard error.

#include <string>

namespace pietra {

/// `level`: debug, info, warn or error. `quiet`: standard error shows errors only. `file` may be
/// empty; throws IoError if it cannot be written.
void setUpLogging(const std::string& level, bool quiet, const std::string& file);

void logDebug(const std::string& message);
void logInfo(const std::string& message);
void logWarning(const std::string& message);
/// Written as "pietra: MESSAGE", whatever the level.
void logError(const std::string& message);

}  // namespace pietra
