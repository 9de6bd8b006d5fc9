#include "apps/pietra/progress_display.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <optional>

#include "base/budget.h"
#include "base/text.h"

namespace pietra {

namespace {

using std::chrono::seconds;

MemoryUse memoryNow() {
    return {residentBytes(), peakResidentBytes()};
}

double rate(const ProgressState& state) {
    return state.stage_seconds > 0 ? double(state.done) / state.stage_seconds : 0;
}

/// Of this stage, at its rate so far; empty while that says nothing.
std::optional<double> secondsLeft(const ProgressState& state) {
    if (state.done == 0 || state.done > state.total) return std::nullopt;
    return double(state.total - state.done) / rate(state);
}

double fraction(const ProgressState& state) {
    return state.total > 0 ? std::min(1.0, double(state.done) / double(state.total)) : 0;
}

std::string stageText(const ProgressState& state) {
    return state.stages > 0
               ? fmt::format("stage {} of {}, {}", state.stage, state.stages, state.name)
               : fmt::format("stage {}, {}", state.stage, state.name);
}

seconds lineInterval(ProgressMode mode) {
    return seconds(mode == ProgressMode::kPlain ? 10 : 1);
}

}  // namespace

ProgressMode progressMode(const std::string& word, bool quiet, const StatusLine& line) {
    if (quiet || word == "none") return ProgressMode::kNone;
    if (word == "bar") return ProgressMode::kBar;
    if (word == "plain") return ProgressMode::kPlain;
    if (word == "json") return ProgressMode::kJson;
    const char* term = std::getenv("TERM");
    const bool dumb = !term || std::string_view(term) == "dumb";
    return line.isTerminal() && !dumb ? ProgressMode::kBar : ProgressMode::kPlain;
}

std::string progressText(const ProgressState& state, const MemoryUse& memory) {
    std::string text = stageText(state) + ":";
    if (state.total > 0) text += fmt::format(" {:.0f}%,", 100 * fraction(state));
    if (state.done > 0) text += fmt::format(" {}/s,", formatCount(rate(state)));
    text += fmt::format(" memory {}, peak {}", formatBytes(memory.now), formatBytes(memory.peak));
    if (const auto left = secondsLeft(state))
        text += fmt::format(", {} left", formatSeconds(*left));
    return text;
}

std::string progressJson(const ProgressState& state, const MemoryUse& memory, const char* event) {
    const auto left = secondsLeft(state);
    // note: names of stages are plain words of ours, nothing to escape.
    return fmt::format(
        R"({{"event":"{}","stage":{},"stages":{},"name":"{}","done":{},"total":{},"seconds":{:.3f},)"
        R"("per_second":{:.1f},"seconds_left":{},"rss_bytes":{},"peak_rss_bytes":{}}})",
        event, state.stage, state.stages, state.name, state.done, state.total, state.stage_seconds,
        rate(state), left ? fmt::format("{:.1f}", *left) : "null", memory.now, memory.peak);
}

std::string progressBar(const ProgressState& state, int cells) {
    std::string bar(size_t(cells) + 2, '.');
    bar.front() = '[';
    bar.back() = ']';
    std::fill_n(bar.begin() + 1, size_t(fraction(state) * cells), '#');
    return bar;
}

ProgressDisplay::ProgressDisplay(ProgressMode mode, StatusLine& line, Clock clock)
    : mode_(mode),
      line_(line),
      clock_(std::move(clock)),
      next_line_(clock_() + lineInterval(mode)) {}

ProgressDisplay::~ProgressDisplay() {
    if (mode_ == ProgressMode::kBar) line_.show("");
}

void ProgressDisplay::show(const ProgressState& state) {
    if (mode_ == ProgressMode::kNone) return;
    if (mode_ == ProgressMode::kBar) {
        line_.show(progressBar(state, 24) + " " + progressText(state, memoryNow()));
        return;
    }
    const auto now = clock_();
    if (now < next_line_) return;
    next_line_ = now + lineInterval(mode_);
    line_.print(mode_ == ProgressMode::kJson ? progressJson(state, memoryNow(), "progress")
                                             : "pietra: " + progressText(state, memoryNow()));
}

void ProgressDisplay::stageEnded(const ProgressState& state) {
    if (mode_ == ProgressMode::kJson) line_.print(progressJson(state, memoryNow(), "stage_ended"));
    if (mode_ != ProgressMode::kBar) return;
    line_.show("");
    line_.print(fmt::format("{}: {}", stageText(state), formatSeconds(state.stage_seconds)));
}

}  // namespace pietra
