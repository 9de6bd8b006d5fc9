#pragma once
// What happens before what in loops over oneTBB, told to the thread sanitizer: Debian's library is
// built without it, so its own synchronisation is not seen. Without that sanitizer, nothing.

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace pietra {

/// One a loop. What the caller did before happens before all tasks; they, before what follows it.
class TaskOrder {
public:
    TaskOrder() { begin(); }
    ~TaskOrder() { end(); }
    TaskOrder(const TaskOrder&) = delete;
    TaskOrder& operator=(const TaskOrder&) = delete;

    /// Again, of tasks that are begun and waited for one by one.
    void begin() { release(begun_); }
    void end() { acquire(done_); }

    /// Lives while a task works.
    class Task {
    public:
        explicit Task(TaskOrder& order) : order_(order) { acquire(order_.begun_); }
        ~Task() { release(order_.done_); }
        Task(const Task&) = delete;
        Task& operator=(const Task&) = delete;

    protected:
        TaskOrder& order_;
    };
    /// Of those that come one after the other: also after tasks that are done, before such as begin.
    class Turn : public Task {
    public:
        explicit Turn(TaskOrder& order) : Task(order) { acquire(order_.done_); }
        ~Turn() { release(order_.begun_); }
    };

private:
#if defined(__SANITIZE_THREAD__)
    static void release(char& at) { __tsan_release(&at); }
    static void acquire(char& at) { __tsan_acquire(&at); }
#else
    static void release(char&) {}
    static void acquire(char&) {}
#endif
    char begun_ = 0, done_ = 0;
};

}  // namespace pietra
