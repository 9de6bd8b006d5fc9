#pragma once
// Progress as people and programs read it, on standard error: a bar on a terminal, else a line
// every ten seconds, or a line of JSON a second. Memory figures are the process's resident set.

#include <chrono>
#include <functional>
#include <string>

#include "apps/pietra/status_line.h"
#include "base/progress.h"

namespace pietra {

/// Resident set of the process, in bytes.
struct MemoryUse {
    uint64_t now = 0;
    uint64_t peak = 0;
};

enum class ProgressMode { kBar, kPlain, kJson, kNone };

/// `word`: auto, bar, plain, json or none. `auto` is a bar on a terminal that can rewrite its line.
ProgressMode progressMode(const std::string& word, bool quiet, const StatusLine& line);

/// "stage 2 of 5, sort: 43%, 1.2 M/s, memory 312 MiB, peak 400 MiB, 12.0 s left"; what is unknown
/// is left out. "Left" counts the rest of this stage at its rate so far.
std::string progressText(const ProgressState& state, const MemoryUse& memory);
/// One JSON object, without newline: event ("progress" or "stage_ended"), stage, stages, name,
/// done, total, seconds, per_second, seconds_left (null where unknown), rss_bytes, peak_rss_bytes.
std::string progressJson(const ProgressState& state, const MemoryUse& memory, const char* event);
/// "[######......]", `cells` wide between the brackets.
std::string progressBar(const ProgressState& state, int cells);

class ProgressDisplay : public ProgressSink {
public:
    using Clock = std::function<std::chrono::steady_clock::time_point()>;
    /// `line` must outlive this. `clock`: the time, for tests.
    ProgressDisplay(ProgressMode mode, StatusLine& line,
                    Clock clock = std::chrono::steady_clock::now);
    ~ProgressDisplay() override;

    void show(const ProgressState& state) override;
    void stageEnded(const ProgressState& state) override;

private:
    const ProgressMode mode_;
    StatusLine& line_;
    const Clock clock_;
    std::chrono::steady_clock::time_point next_line_;
};

}  // namespace pietra
