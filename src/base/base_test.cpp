#include <gtest/gtest.h>
#include <sched.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "base/budget.h"
#include "base/check.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "base/text.h"
#include "base/worker_placement.h"

namespace pietra {
namespace {

TEST(Check, printsOperands) {
    const int a = 1, b = 2;
    try {
        CHECK_EQ(a, b);
        FAIL();
    } catch (const BugError& e) {
        EXPECT_NE(std::string(e.what()).find("CHECK(a == b): 1 and 2"), std::string::npos);
    }
}

TEST(Error, namesFilePlaceAndFault) {
    EXPECT_STREQ(InputError::atByte("a.ply", 17, "no vertices").what(),
                 "a.ply: byte 17: no vertices");
    EXPECT_STREQ(InputError::atLine("a.obj", 3, "bad index").what(), "a.obj: line 3: bad index");
    EXPECT_EQ(IoError("x", "open", 2).exitCode(), 4);
    EXPECT_STREQ(IoError("x", "open", 2).what(), "x: cannot open: No such file or directory");
}

TEST(Budget, neverExceedsItsLimit) {
    Budget budget(100);
    Reservation a = budget.reserve(60, "a");
    EXPECT_THROW(auto b = budget.reserve(41, "b"), MemoryError);
    EXPECT_EQ(budget.tryReserve(41).bytes(), 0u);
    Reservation c = budget.tryReserve(40);
    EXPECT_EQ(c.bytes(), 40u);
    a.release();
    EXPECT_EQ(budget.used(), 40u);
    EXPECT_EQ(budget.peak(), 100u);
}

TEST(Text, readsSizes) {
    EXPECT_EQ(parseBytes("512M"), 512u << 20);
    EXPECT_EQ(parseBytes("1.5G"), 3u << 29);
    EXPECT_EQ(parseBytes("64k"), 65536u);
    EXPECT_EQ(parseBytes("17"), 17u);
    for (const char* bad : {"", "M", "-1", "1X", "1e3M", "nan", "99999999999G"})
        EXPECT_FALSE(parseBytes(bad)) << bad;
    EXPECT_EQ(formatBytes(1536), "1.5 KiB");
}

TEST(Progress, ticksAndCancels) {
    struct Sink : ProgressSink {
        void show(const ProgressState&) override {}
        void stageEnded(const ProgressState& s) override { ended = s; }
        ProgressState ended;
    } sink;
    Progress progress(&sink);
    progress.setStages(1);
    progress.beginStage("work", 1000);
    parallelFor(1000, [&](size_t) { progress.tick(); });
    progress.endStage();
    EXPECT_EQ(sink.ended.done, 1000u);
    EXPECT_EQ(sink.ended.name, "work");
}

TEST(WorkerPlacement, KeepsWorkersOffOneProcessor) {
    cpu_set_t allowed;
    ASSERT_EQ(::sched_getaffinity(0, sizeof allowed, &allowed), 0);
    if (CPU_COUNT(&allowed) < 2) GTEST_SKIP() << "one processor";
    WorkerPlacement placement;
    const std::thread::id frame_thread = std::this_thread::get_id();
    std::atomic<int> workers{0}, misplaced{0};
    for (int round = 0; round < 1000 && workers == 0; ++round) {
        placement.update();
        parallelFor(64, [&](size_t) {
            std::this_thread::sleep_for(std::chrono::microseconds(50));
            if (std::this_thread::get_id() == frame_thread) return;
            cpu_set_t mine;
            ++workers;
            misplaced += ::sched_getaffinity(0, sizeof mine, &mine) != 0 ||
                         CPU_COUNT(&mine) != CPU_COUNT(&allowed) - 1;
        });
    }
    EXPECT_GT(workers, 0);
    EXPECT_EQ(misplaced, 0);
}

}  // namespace
}  // namespace pietra
