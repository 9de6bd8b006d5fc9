#pragma once
// What a verb of the command line is. Each verb_*.cpp holds one; verbs.h lists them.

#include <string>
#include <utility>
#include <vector>

#include "apps/pietra/option_set.h"
#include "base/progress.h"

namespace pietra {

/// What every verb understands.
struct CommonOptions {
    bool force = false;
    std::string report;  ///< path of the JSON report; empty: none; "-": standard output
    std::string progress = "auto";
    bool quiet = false;
    std::string log_level = "info";
    std::string log_file;
    std::string config;
};

/// What a verb says about itself; paragraphs and examples are wrapped by the help page.
struct VerbText {
    std::string name;
    std::string summary;                   ///< one line, for the list of verbs
    std::vector<std::string> usage;        ///< "IN... -o OUT.pietra [options]", without the name
    std::vector<std::string> description;  ///< paragraphs
    std::vector<std::pair<std::string, std::string>> examples;  ///< what for, command line
    /// A table of words and what they mean, with its title; may be empty.
    std::string terms_title = {};
    std::vector<std::pair<std::string, std::string>> terms = {};
};

/// What a running verb is given.
struct RunContext {
    const CommonOptions& common;
    Progress& progress;
};

class Verb {
public:
    virtual ~Verb() = default;
    virtual VerbText text() const = 0;
    /// Called once, before parsing; targets are members of the verb.
    virtual void declare(OptionSet& options) = 0;
    /// Returns the exit code: 0, or what a check found (3: damaged, 6: faulty); all else is thrown.
    virtual int run(const RunContext& context) = 0;
};

}  // namespace pietra
