#include "apps/pietra/status_line.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>

namespace pietra {

namespace {

constexpr std::string_view kClear = "\r\x1b[K";

size_t terminalColumns(int descriptor) {
    winsize size{};
    return ioctl(descriptor, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

}  // namespace

void StatusLine::write(std::string_view text) const {
    while (!text.empty()) {
        const ssize_t n = ::write(descriptor_, text.data(), text.size());
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return;
        text.remove_prefix(size_t(n));
    }
}

void StatusLine::show(std::string_view text) {
    const std::lock_guard lock(mutex_);
    // note: a line that fills the last column would wrap, and could not be rewritten.
    const std::string line(text.substr(0, terminalColumns(descriptor_) - 1));
    if (line == shown_) return;
    shown_ = line;
    write(std::string(kClear) + shown_);
}

void StatusLine::print(std::string_view line) {
    const std::lock_guard lock(mutex_);
    std::string text;
    if (!shown_.empty()) text = kClear;
    text.append(line).append("\n").append(shown_);
    write(text);
}

bool StatusLine::isTerminal() const {
    return ::isatty(descriptor_) == 1;
}

bool StatusLine::colours() const {
    const char* no_color = std::getenv("NO_COLOR");
    const char* term = std::getenv("TERM");
    return isTerminal() && !(no_color && *no_color) && !(term && std::string_view(term) == "dumb");
}

StatusLine& errorLine() {
    static StatusLine line(STDERR_FILENO);
    return line;
}

}  // namespace pietra
