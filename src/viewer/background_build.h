#pragma once
// Builds a model beside the window: another Pietra in a process of its own, so that neither its
// memory nor a bad file touches what is on the screen.

#include <sys/types.h>

#include <string>

namespace pietra {

class BackgroundBuild {
public:
    enum class State { kRunning, kDone, kFailed };

    /// Runs `program build mesh -o model --force`. Throws IoError if it cannot be started.
    BackgroundBuild(const std::string& program, std::string mesh, std::string model);
    /// Interrupts it if it still runs; nothing is left behind then.
    ~BackgroundBuild();
    BackgroundBuild(const BackgroundBuild&) = delete;
    BackgroundBuild& operator=(const BackgroundBuild&) = delete;

    /// Takes note of what the process has said. Never waits.
    State poll();
    const std::string& mesh() const { return mesh_; }
    const std::string& model() const { return model_; }
    /// "stage 2 of 4, sort", and when it has failed, why.
    const std::string& text() const { return text_; }
    /// Of the stage, 0 to 1.
    float fraction() const { return fraction_; }

private:
    void read();
    void takeLine(const std::string& line);

    std::string mesh_, model_;
    pid_t process_ = 0;
    int output_ = -1;
    State state_ = State::kRunning;
    std::string unfinished_line_, text_ = "starting";
    float fraction_ = 0;
};

}  // namespace pietra
