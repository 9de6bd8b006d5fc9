#include "apps/pietra/verbs.h"

namespace pietra {

VerbTable makeVerbs() {
    VerbTable verbs;
    return verbs;
}

}  // namespace pietra
