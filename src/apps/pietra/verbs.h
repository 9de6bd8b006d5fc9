#pragma once
// The table of verbs. A verb is one verb_*.cpp with a maker, declared here and listed in verbs.cpp.

#include <memory>
#include <vector>

#include "apps/pietra/verb.h"

namespace pietra {

std::unique_ptr<Verb> makeBuildVerb();
std::unique_ptr<Verb> makeInfoVerb();
std::unique_ptr<Verb> makeCheckVerb();
std::unique_ptr<Verb> makeExtractVerb();
std::unique_ptr<Verb> makeRenderVerb();
std::unique_ptr<Verb> makeViewVerb();
std::unique_ptr<Verb> makeBenchVerb();
std::unique_ptr<Verb> makeCompareVerb();
std::unique_ptr<Verb> makeSynthVerb();

using VerbTable = std::vector<std::unique_ptr<Verb>>;

/// All verbs, in the order in which the help page lists them.
VerbTable makeVerbs();

}  // namespace pietra
