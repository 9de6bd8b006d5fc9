#pragma once
// The last line of a terminal, which progress keeps rewriting, shared with the messages that scroll
// above it. All writes go to one descriptor under one lock. Faults of that descriptor are ignored:
// nobody could be told.

#include <mutex>
#include <string>
#include <string_view>

namespace pietra {

class StatusLine {
public:
    explicit StatusLine(int descriptor) : descriptor_(descriptor) {}
    /// Shows `text` (without newline) as the last line, cut to the terminal's width; empty: removes
    /// it.
    void show(std::string_view text);
    /// Writes a whole line, newline added, above the status.
    void print(std::string_view line);

    bool isTerminal() const;
    /// Colours are wanted: a terminal, no NO_COLOR, TERM is not "dumb".
    bool colours() const;

private:
    void write(std::string_view text) const;
    const int descriptor_;
    std::mutex mutex_;
    std::string shown_;
};

/// The one on standard error.
StatusLine& errorLine();

}  // namespace pietra
