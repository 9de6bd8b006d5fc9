#pragma once
// The command line: which verb, with which options. Parsing is CLI11's; messages are ours, one
// sentence each, and tested. Options may also come from a file (--config), which the command line
// overrides: `key = value` lines, those of a verb below a line `[verb]`.

#include <string>
#include <vector>

#include "apps/pietra/verbs.h"

namespace pietra {

struct Command {
    Verb* verb = nullptr;  ///< to be run, or null where `print` is the answer
    std::string print;     ///< for standard output: help or version
};

/// `arguments`: without the program's name. Declares the verbs' options and sets their targets and
/// `common`. Throws UsageError, or IoError where the config file cannot be read.
Command parseCommandLine(const std::vector<std::string>& arguments, const VerbTable& verbs,
                         CommonOptions& common);

}  // namespace pietra
