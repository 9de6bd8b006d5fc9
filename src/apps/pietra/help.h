#pragma once
// Help pages, as text wrapped to a width in columns.

#include <string>

#include "apps/pietra/verbs.h"

namespace pietra {

/// `pietra --help`.
std::string programHelp(const VerbTable& verbs, const OptionSet& common, int columns);
/// `pietra VERB --help`.
std::string verbHelp(const VerbText& text, const OptionSet& options, const OptionSet& common,
                     int columns);
/// Columns of the terminal at standard output, at most 100; 80 where there is none.
int helpColumns();

}  // namespace pietra
