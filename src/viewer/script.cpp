#include "viewer/script.h"

#include <fmt/format.h>

#include <cerrno>
#include <fstream>
#include <sstream>

#include "base/error.h"

namespace pietra {
namespace {

constexpr int kDragSteps = 8;

uint8_t buttonOf(const std::string& name) {
    if (name == "left") return SDL_BUTTON_LEFT;
    if (name == "middle") return SDL_BUTTON_MIDDLE;
    return name == "right" ? SDL_BUTTON_RIGHT : 0;
}

}  // namespace

Script::Script(const std::string& path) {
    std::ifstream in(path);
    if (!in) throw IoError(path, "open", errno);
    std::string line;
    for (int number = 1; std::getline(in, line); ++number)
        if (!line.empty() && line[0] != '#') {
            const size_t before = steps_.size();
            parse(line);
            if (steps_.size() == before)
                throw InputError(path, fmt::format("line {}", number),
                                 fmt::format("'{}' is no command", line));
        }
}

void Script::addMotion(int x, int y, uint32_t buttons) {
    Step step{Step::Kind::kEvent, {}, {}};
    step.event.motion = {};
    step.event.type = SDL_MOUSEMOTION;
    step.event.motion.x = x;
    step.event.motion.y = y;
    step.event.motion.state = buttons;
    steps_.push_back(step);
}

void Script::addButton(bool down, uint8_t button, int x, int y, uint8_t clicks) {
    Step step{Step::Kind::kEvent, {}, {}};
    step.event.type = down ? SDL_MOUSEBUTTONDOWN : SDL_MOUSEBUTTONUP;
    step.event.button.button = button;
    step.event.button.state = down ? SDL_PRESSED : SDL_RELEASED;
    step.event.button.clicks = clicks;
    step.event.button.x = x;
    step.event.button.y = y;
    steps_.push_back(step);
}

void Script::addKey(SDL_Keycode key) {
    for (const bool down : {true, false}) {
        Step step{Step::Kind::kEvent, {}, {}};
        step.event.type = down ? SDL_KEYDOWN : SDL_KEYUP;
        step.event.key.state = down ? SDL_PRESSED : SDL_RELEASED;
        step.event.key.keysym.sym = key;
        step.event.key.keysym.scancode = SDL_GetScancodeFromKey(key);
        steps_.push_back(step);
    }
}

/// Adds nothing where the line is none of the commands.
void Script::parse(const std::string& line) {
    std::istringstream in(line);
    std::string word, name;
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
    in >> word;
    if (word == "wait") {
        steps_.push_back({Step::Kind::kWait, {}, {}});
    } else if (word == "quit") {
        Step step{Step::Kind::kEvent, {}, {}};
        step.event.type = SDL_QUIT;
        steps_.push_back(step);
    } else if (word == "screenshot" && in >> name) {
        steps_.push_back({Step::Kind::kScreenshot, {}, name});
    } else if (word == "drop" && in >> name) {
        Step step{Step::Kind::kEvent, {}, {}};
        step.event.type = SDL_DROPFILE;
        step.event.drop.file = SDL_strdup(name.c_str());
        steps_.push_back(step);
    } else if (word == "key" && in >> name) {
        if (const SDL_Keycode key = SDL_GetKeyFromName(name.c_str()); key != SDLK_UNKNOWN)
            addKey(key);
    } else if (word == "drag" && in >> name >> x0 >> y0 >> x1 >> y1 && buttonOf(name)) {
        const uint8_t button = buttonOf(name);
        addMotion(x0, y0, 0);
        addButton(true, button, x0, y0, 1);
        for (int i = 1; i <= kDragSteps; ++i)
            addMotion(x0 + (x1 - x0) * i / kDragSteps, y0 + (y1 - y0) * i / kDragSteps,
                      SDL_BUTTON(button));
        addButton(false, button, x1, y1, 1);
    } else if (word == "click" && in >> name >> x0 >> y0 && buttonOf(name)) {
        addMotion(x0, y0, 0);
        for (const bool down : {true, false}) addButton(down, buttonOf(name), x0, y0, 1);
    } else if (word == "double" && in >> x0 >> y0) {
        addMotion(x0, y0, 0);
        for (const uint8_t clicks : {uint8_t(1), uint8_t(2)})
            for (const bool down : {true, false}) addButton(down, SDL_BUTTON_LEFT, x0, y0, clicks);
    } else if (word == "wheel" && in >> x1 >> x0 >> y0) {
        addMotion(x0, y0, 0);
        Step step{Step::Kind::kEvent, {}, {}};
        step.event.type = SDL_MOUSEWHEEL;
        step.event.wheel.y = x1;
        step.event.wheel.preciseY = float(x1);
        steps_.push_back(step);
    }
}

}  // namespace pietra
