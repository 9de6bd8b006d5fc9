#include "apps/pietra/verbs.h"

namespace pietra {

VerbTable makeVerbs() {
    VerbTable verbs;
    verbs.push_back(makeBuildVerb());
    verbs.push_back(makeInfoVerb());
    verbs.push_back(makeCheckVerb());
    verbs.push_back(makeExtractVerb());
    verbs.push_back(makeRenderVerb());
    verbs.push_back(makeViewVerb());
    verbs.push_back(makeBenchVerb());
    verbs.push_back(makeCompareVerb());
    verbs.push_back(makeSynthVerb());
    return verbs;
}

}  // namespace pietra
