#include "apps/pietra/verbs.h"

namespace pietra {

VerbTable makeVerbs() {
    VerbTable verbs;
    verbs.push_back(makeBuildVerb());
    return verbs;
}

}  // namespace pietra
