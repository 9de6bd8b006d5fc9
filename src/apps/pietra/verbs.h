#pragma once
// The table of verbs. A verb is one verb_*.cpp with a maker, declared here and listed in verbs.cpp.

#include <memory>
#include <vector>

#include "apps/pietra/verb.h"

namespace pietra {

std::unique_ptr<Verb> makeBuildVerb();
std::unique_ptr<Verb> makeInfoVerb();
std::unique_ptr<Verb> makeRenderVerb();

using VerbTable = std::vector<std::unique_ptr<Verb>>;

/// All verbs, in the order in which the help page lists them.
VerbTable makeVerbs();

}  // namespace pietra
