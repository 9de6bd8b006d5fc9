#pragma once
// A user made of a file, for tests and demonstrations: one command a line, run in turn.
//
//   wait                      until all builds have ended and the picture is as fine as asked for
//   key NAME                  a key as SDL names it: F, [, 1, F1, Escape
//   drag BUTTON X0 Y0 X1 Y1   left, middle, right; in eight steps
//   click BUTTON X Y          and "double X Y": the left one, twice
//   wheel STEPS X Y           upwards is positive
//   drop FILE                 onto the window
//   screenshot FILE           of the window, as PNG
//   quit
//
// Empty lines and lines that begin with # are left out.

#include <SDL.h>

#include <deque>
#include <string>

namespace pietra {

class Script {
public:
    Script() = default;
    /// Throws IoError, or InputError that names the line.
    explicit Script(const std::string& path);

    struct Step {
        enum class Kind { kEvent, kWait, kScreenshot } kind;
        SDL_Event event{};
        std::string file;
    };
    bool done() const { return steps_.empty(); }
    const Step& front() const { return steps_.front(); }
    void pop() { steps_.pop_front(); }

private:
    void parse(const std::string& line);
    void addMotion(int x, int y, uint32_t buttons);
    void addButton(bool down, uint8_t button, int x, int y, uint8_t clicks);
    void addKey(SDL_Keycode key);

    std::deque<Step> steps_;
};

}  // namespace pietra
