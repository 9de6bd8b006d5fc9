#include "viewer/background_build.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace pietra {
namespace {

constexpr int kNiceness = 10;  // the window goes first
constexpr std::string_view kPrefix = "pietra: ";

}  // namespace

BackgroundBuild::BackgroundBuild(const std::string& program, std::string mesh, std::string model)
    : mesh_(std::move(mesh)), model_(std::move(model)) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw IoError(program, "start", errno);
    output_ = ends[0];
    ::fcntl(output_, F_SETFL, O_NONBLOCK);
    // "--" is not needed before a name that begins with a dash if there is a slash in it.
    const std::string input = mesh_.starts_with('-') ? "./" + mesh_ : mesh_;
    std::array<const char*, 9> words{"pietra",  "build",      input.c_str(), "-o",   model_.c_str(),
                                     "--force", "--progress", "json",        nullptr};
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
    const int fault = ::posix_spawn(&process_, program.c_str(), &actions, nullptr,
                                    const_cast<char* const*>(words.data()), environ);
    posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
    if (fault != 0) {
        ::close(output_);
        throw IoError(program, "start", fault);
    }
    ::setpriority(PRIO_PROCESS, id_t(process_), kNiceness);
}

BackgroundBuild::~BackgroundBuild() {
    if (state_ == State::kRunning) {
        ::kill(process_, SIGINT);
        while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
        }
    }
    ::close(output_);
}

BackgroundBuild::State BackgroundBuild::poll() {
    if (state_ != State::kRunning) return state_;
    int status = 0;
    const pid_t ended = ::waitpid(process_, &status, WNOHANG);
    read();  // after the question: what an ended process has said is there
    if (ended != process_) return state_;
    state_ = WIFEXITED(status) && WEXITSTATUS(status) == 0 ? State::kDone : State::kFailed;
    if (WIFSIGNALED(status)) text_ = fmt::format("ended by signal {}", WTERMSIG(status));
    return state_;
}

void BackgroundBuild::read() {
    std::array<char, 4096> bytes;
    for (ssize_t got; (got = ::read(output_, bytes.data(), bytes.size())) > 0;) {
        for (const char c : std::string_view(bytes.data(), size_t(got))) {
            if (c != '\n') {
                unfinished_line_ += c;
                continue;
            }
            takeLine(unfinished_line_);
            unfinished_line_.clear();
        }
    }
}

/// Progress as JSON, else a sentence.
void BackgroundBuild::takeLine(const std::string& line) {
    const auto json = nlohmann::json::parse(line, nullptr, false);
    if (!json.is_object()) {
        text_ = line.starts_with(kPrefix) ? line.substr(kPrefix.size()) : line;
        return;
    }
    const double total = json.value("total", 0.0);
    fraction_ = total > 0 ? float(json.value("done", 0.0) / total) : 0;
    text_ = fmt::format("stage {} of {}, {}", json.value("stage", 0), json.value("stages", 0),
                        json.value("name", ""));
}

}  // namespace pietra
