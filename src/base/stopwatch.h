#pragma once
// Time that has passed.

#include <chrono>
#include <thread>
#include <utility>

namespace pietra {

class Stopwatch {
public:
    double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
    double ms() const { return 1e3 * seconds(); }
    void restart() { start_ = Clock::now(); }
    /// ms(), and starts again at that moment.
    double lapMs() {
        const Clock::time_point now = Clock::now(), before = std::exchange(start_, now);
        return std::chrono::duration<double, std::milli>(now - before).count();
    }
    /// Until `seconds` have passed since the start.
    void wait(double seconds) const {
        std::this_thread::sleep_until(start_ + std::chrono::duration_cast<Clock::duration>(
                                                   std::chrono::duration<double>(seconds)));
    }

private:
    using Clock = std::chrono::steady_clock;
    Clock::time_point start_ = Clock::now();
};

}  // namespace pietra
