#include "base/progress.h"

#include "base/error.h"

namespace pietra {

std::atomic<bool> Progress::cancelled_{false};

namespace {
constexpr int64_t kShowEvery_ns = 100'000'000;
}

void Progress::beginStage(const std::string& name, uint64_t total) {
    endStage();
    ++stage_;
    active_ = true;
    name_ = name;
    done_ = 0;
    total_ = total;
    began_ = Clock::now();
    next_show_ns_ = 0;
}

void Progress::endStage() {
    if (!active_) return;
    active_ = false;
    const ProgressState last = state();
    seconds_.emplace_back(name_, last.stage_seconds);
    if (sink_) sink_->stageEnded(last);
}

void Progress::tick(uint64_t units) {
    if (cancelRequested()) throw Interrupted();
    done_.fetch_add(units, std::memory_order_relaxed);
    if (!sink_) return;
    const int64_t now = (Clock::now() - began_).count();
    if (now < next_show_ns_.load(std::memory_order_relaxed)) return;
    if (showing_.test_and_set(std::memory_order_acquire)) return;
    next_show_ns_.store(now + kShowEvery_ns, std::memory_order_relaxed);
    sink_->show(state());
    showing_.clear(std::memory_order_release);
}

ProgressState Progress::state() const {
    const std::chrono::duration<double> seconds = Clock::now() - began_;
    return {stage_, stages_, name_, done_.load(std::memory_order_relaxed), total_, seconds.count()};
}

}  // namespace pietra
