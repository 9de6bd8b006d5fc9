#pragma once
// A thread for all that is asked of OpenGL, from whichever thread.
//
// note: letting the threads of a parallel loop make the context current in turn does not do: they
// live on while the program ends, and a driver's data of theirs is then freed twice (Mesa 22).

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace pietra {

class GlThread {
public:
    GlThread() : thread_([this] { work(); }) {}
    ~GlThread() {
        {
            const std::lock_guard lock(mutex_);
            done_ = true;
        }
        changed_.notify_all();
        thread_.join();
    }

    /// Runs `body` in the thread, waits for it, and throws what it throws. One caller at a time.
    void run(const std::function<void()>& body) {
        std::unique_lock lock(mutex_);
        body_ = &body;
        changed_.notify_all();
        changed_.wait(lock, [this] { return body_ == nullptr; });
        if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    }

private:
    void work() {
        std::unique_lock lock(mutex_);
        for (;;) {
            changed_.wait(lock, [this] { return done_ || body_ != nullptr; });
            if (body_ == nullptr) return;
            try {
                (*body_)();
            } catch (...) {
                thrown_ = std::current_exception();
            }
            body_ = nullptr;
            changed_.notify_all();
        }
    }

    std::mutex mutex_;
    std::condition_variable changed_;
    const std::function<void()>* body_ = nullptr;
    std::exception_ptr thrown_;
    bool done_ = false;
    std::thread thread_;  // last: begins when all else is there
};

}  // namespace pietra
