#include "apps/pietra/verbs.h"

namespace pietra {

VerbTable makeVerbs() {
    VerbTable verbs;
    verbs.push_back(makeBuildVerb());
    verbs.push_back(makeInfoVerb());
    verbs.push_back(makeRenderVerb());
    return verbs;
}

}  // namespace pietra
