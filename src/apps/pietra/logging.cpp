#include "apps/pietra/logging.h"

#include <fcntl.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <memory>
#include <mutex>

#include "apps/pietra/status_line.h"
#include "base/error.h"

namespace pietra {

namespace {

/// "pietra: MESSAGE", with the level named where it is a warning or for debugging.
class TerminalSink : public spdlog::sinks::base_sink<std::mutex> {
protected:
    void sink_it_(const spdlog::details::log_msg& message) override {
        const bool colours = errorLine().colours();
        std::string line = "pietra: ";
        if (message.level == spdlog::level::warn)
            line += colours ? "\x1b[33mwarning:\x1b[0m " : "warning: ";
        if (message.level == spdlog::level::debug) line += "debug: ";
        line.append(message.payload.data(), message.payload.size());
        errorLine().print(line);
    }
    void flush_() override {}
};

spdlog::logger& logger() {
    static spdlog::logger instance("pietra", std::make_shared<TerminalSink>());
    return instance;
}

}  // namespace

void setUpLogging(const std::string& level, bool quiet, const std::string& file) {
    const auto least = spdlog::level::from_str(level);
    logger().set_level(least);
    logger().sinks().front()->set_level(quiet ? std::max(least, spdlog::level::err) : least);
    if (file.empty()) return;
    const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (descriptor < 0) throw IoError(file, "write", errno);
    ::close(descriptor);
    auto sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(file);
    sink->set_level(least);
    sink->set_pattern("%Y-%m-%d %H:%M:%S.%e %l %v");
    logger().sinks().push_back(sink);
    logger().flush_on(spdlog::level::debug);
}

// note: passed as arguments, or braces in a file's name would be taken for a format.
void logDebug(const std::string& message) {
    logger().debug("{}", message);
}
void logInfo(const std::string& message) {
    logger().info("{}", message);
}
void logWarning(const std::string& message) {
    logger().warn("{}", message);
}
void logError(const std::string& message) {
    logger().error("{}", message);
}

}  // namespace pietra
