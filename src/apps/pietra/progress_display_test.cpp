#include "apps/pietra/progress_display.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>

namespace pietra {
namespace {

using std::chrono::milliseconds;
using TimePoint = std::chrono::steady_clock::time_point;

/// A terminal of its own (a pty), or a pipe; `text()` is what has been written to it so far.
class Screen {
public:
    explicit Screen(bool terminal) {
        if (!terminal) {
            int ends[2];
            if (::pipe(ends) != 0) std::abort();
            reader_ = ends[0];
            writer = ends[1];
            return;
        }
        reader_ = ::posix_openpt(O_RDWR | O_NOCTTY);
        if (reader_ < 0 || ::grantpt(reader_) != 0 || ::unlockpt(reader_) != 0) return;
        writer = ::open(::ptsname(reader_), O_RDWR | O_NOCTTY);
        const winsize size{24, 60, 0, 0};
        ::ioctl(reader_, TIOCSWINSZ, &size);
    }
    ~Screen() {
        ::close(reader_);
        ::close(writer);
    }
    /// Terminals pass on what is written in their own time, but in order: up to a mark.
    std::string text() {
        constexpr char kMark = 1;
        if (::write(writer, &kMark, 1) != 1) std::abort();
        std::string all;
        for (char c; ::read(reader_, &c, 1) == 1 && c != kMark;) all += c;
        return all;
    }
    int writer = -1;

private:
    int reader_ = -1;
};

ProgressState sorting(double seconds, uint64_t done) {
    return {2, 5, "sort", done, 4'000'000, seconds};
}

TEST(ProgressText, tellsAllThatIsKnown) {
    EXPECT_EQ(progressText(sorting(1, 1'000'000), {300 << 20, 400 << 20}),
              "stage 2 of 5, sort: 25%, 1.0 M/s, memory 300 MiB, peak 400 MiB, 3.0 s left");
    EXPECT_EQ(progressText({1, 0, "read", 0, 0, 1}, {300 << 20, 400 << 20}),
              "stage 1, read: memory 300 MiB, peak 400 MiB");
    // More than was expected: no time left is known, and never more than the whole.
    EXPECT_EQ(progressText({1, 1, "read", 150, 100, 1}, {1 << 20, 1 << 20}),
              "stage 1 of 1, read: 100%, 150/s, memory 1.0 MiB, peak 1.0 MiB");
}

TEST(ProgressText, barsAndJson) {
    EXPECT_EQ(progressBar(sorting(1, 1'000'000), 8), "[##......]");
    EXPECT_EQ(progressBar(sorting(1, 9'000'000), 8), "[########]");
    EXPECT_EQ(progressBar({1, 1, "x", 5, 0, 1}, 4), "[....]");
    const auto json =
        nlohmann::json::parse(progressJson(sorting(2, 1'000'000), {30, 40}, "progress"));
    EXPECT_EQ(json["event"], "progress");
    EXPECT_EQ(json["stage"], 2);
    EXPECT_EQ(json["name"], "sort");
    EXPECT_EQ(json["done"], 1'000'000);
    EXPECT_EQ(json["per_second"], 500'000);
    EXPECT_EQ(json["seconds_left"], 6);
    EXPECT_EQ(json["peak_rss_bytes"], 40);
    EXPECT_TRUE(nlohmann::json::parse(progressJson({}, {}, "progress"))["seconds_left"].is_null());
}

TEST(ProgressDisplay, plainIsOneLineEveryTenSeconds) {
    Screen screen(false);
    StatusLine line(screen.writer);
    TimePoint now{};
    ProgressDisplay display(ProgressMode::kPlain, line, [&] { return now; });
    for (int i = 0; i < 350; ++i, now += milliseconds(100)) display.show(sorting(1, 1000));
    display.stageEnded(sorting(35, 4'000'000));
    std::istringstream lines(screen.text());
    int count = 0;
    for (std::string text; std::getline(lines, text); ++count)
        EXPECT_TRUE(text.starts_with("pietra: stage 2 of 5, sort: ")) << text;
    EXPECT_EQ(count, 3);
}

TEST(ProgressDisplay, noneAndQuietAreSilent) {
    Screen screen(false);
    StatusLine line(screen.writer);
    EXPECT_EQ(progressMode("bar", true, line), ProgressMode::kNone);
    EXPECT_EQ(progressMode("auto", false, line), ProgressMode::kPlain);
    TimePoint now{};
    ProgressDisplay display(ProgressMode::kNone, line, [&] { return now; });
    now += milliseconds(60'000);
    display.show(sorting(1, 1));
    display.stageEnded(sorting(1, 1));
    EXPECT_EQ(screen.text(), "");
}

TEST(ProgressDisplay, aBarRewritesItsLineAndFitsTheTerminal) {
    Screen screen(true);
    if (screen.writer < 0) GTEST_SKIP() << "no pseudo-terminals here";
    StatusLine line(screen.writer);
    ::setenv("TERM", "xterm", 1);
    EXPECT_EQ(progressMode("auto", false, line), ProgressMode::kBar);
    ::setenv("TERM", "dumb", 1);
    EXPECT_EQ(progressMode("auto", false, line), ProgressMode::kPlain);
    ::setenv("TERM", "xterm", 1);
    ::unsetenv("NO_COLOR");
    EXPECT_TRUE(line.colours());
    ::setenv("NO_COLOR", "1", 1);
    EXPECT_FALSE(line.colours());
    {
        ProgressDisplay display(ProgressMode::kBar, line);
        display.show(sorting(1, 1'000'000));
        const std::string first = screen.text();
        const std::string clear = "\r\x1b[K";
        EXPECT_EQ(first.substr(0, clear.size() + 14), clear + "[######.......");
        EXPECT_EQ(first.size(), clear.size() + 59);  // of 60 columns
        line.print("a message");
        EXPECT_EQ(screen.text(), clear + "a message\r\n" + first.substr(clear.size()));
        display.stageEnded(sorting(4, 4'000'000));
        EXPECT_EQ(screen.text(), clear + "stage 2 of 5, sort: 4.0 s\r\n");
        display.show(sorting(1, 1'000'000));
        screen.text();
    }
    EXPECT_EQ(screen.text(), "\r\x1b[K");
}

}  // namespace
}  // namespace pietra
