#pragma once
// What an interrupted build leaves in the folder of temporary data, so that another one goes on
// from there: a folder of its own, named by all that decides the model, with the spills that were
// saved (extmem/spill.h) and a file for each part of the state. A part is there whole or not at all
// when the process is killed. Nothing is synced: after the system itself went down, what lies there
// counts for nothing.
//
// One process at a time has the folder; it goes with this object, unless an error ends the work
// after something was put there. Not thread-safe.

#include <optional>
#include <string>

#include "base/state.h"
#include "base/stopwatch.h"
#include "extmem/file.h"

namespace pietra {

class Checkpoint {
public:
    /// `identity`: all that decides the model's bytes; empty: nothing is ever kept. What another
    /// build left is for load() if `resume` is set, else it is removed. `seconds`: at least so much
    /// time passes from one isDue() to the next, and the twentyfold of what saving takes; 0: none
    /// has to. Throws IoError, and UsageError if something is to be resumed that is being built.
    Checkpoint(const std::string& temp_dir, const std::string& identity, bool resume,
               double seconds);
    ~Checkpoint();
    Checkpoint(const Checkpoint&) = delete;
    Checkpoint& operator=(const Checkpoint&) = delete;

    /// Without this part, what another build left is nothing to resume.
    static constexpr const char* kFirst = "input";
    /// For TempSpace::kept: empty if nothing is kept.
    const std::string& folder() const { return folder_; }
    /// Part kFirst was there.
    bool resumes() const { return resumes_; }
    /// Time to save.
    bool isDue();
    std::optional<StateReader> load(const std::string& part) const;
    void save(const std::string& part, const StateWriter& state);
    /// A spill that no part means any longer.
    void remove(const std::string& name) const;
    /// The work is done: nothing remains.
    void finish() { is_worth_keeping_ = false; }

private:
    std::string folder_;
    File lock_;
    double seconds_;
    bool resumes_ = false;
    Stopwatch since_, began_;
    double cost_seconds_ = 0;
    bool is_worth_keeping_ = false;
};

}  // namespace pietra
