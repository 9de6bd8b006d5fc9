#pragma once
// Progress and cancellation of a long job. Work functions take a `Progress&`, name their stages,
// and tick; a tick throws Interrupted once cancellation was asked for. How it is shown (bar, lines,
// JSON) is the command line's business: it implements `ProgressSink`. tick() is thread-safe and
// cheap.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace pietra {

/// What a sink is told.
struct ProgressState {
    int stage = 0;   ///< from 1
    int stages = 0;  ///< in all
    std::string name;
    uint64_t done = 0;   ///< units of this stage
    uint64_t total = 0;  ///< 0: unknown
    double stage_seconds = 0;
};

class ProgressSink {
public:
    virtual ~ProgressSink() = default;
    /// Called from whichever thread ticks, never concurrently, some ten times a second at most.
    virtual void show(const ProgressState& state) = 0;
    /// A stage has ended; `state.done` is final.
    virtual void stageEnded(const ProgressState& state) = 0;
};

class Progress {
public:
    /// `sink` may be null; it must outlive this.
    explicit Progress(ProgressSink* sink = nullptr) : sink_(sink) {}

    void setStages(int stages) { stages_ = stages; }
    /// Ends the stage before, if any. `total`: units expected, 0 if unknown.
    void beginStage(const std::string& name, uint64_t total);
    void endStage();
    /// Throws Interrupted if cancellation was requested.
    void tick(uint64_t units = 1);

    /// Seconds of each stage ended so far, by name, in order.
    const std::vector<std::pair<std::string, double>>& stageSeconds() const { return seconds_; }

    /// Async-signal-safe: what a SIGINT handler calls.
    static void requestCancel() { cancelled_.store(true, std::memory_order_relaxed); }
    static bool cancelRequested() { return cancelled_.load(std::memory_order_relaxed); }

private:
    using Clock = std::chrono::steady_clock;
    ProgressState state() const;
    static std::atomic<bool> cancelled_;
    ProgressSink* sink_;
    int stages_ = 0;
    int stage_ = 0;
    bool active_ = false;
    std::string name_;
    std::atomic<uint64_t> done_{0};
    uint64_t total_ = 0;
    Clock::time_point began_;
    std::atomic<int64_t> next_show_ns_{0};
    std::atomic_flag showing_ = ATOMIC_FLAG_INIT;
    std::vector<std::pair<std::string, double>> seconds_;
};

}  // namespace pietra
