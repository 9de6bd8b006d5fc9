#pragma once
// Options of the verbs that draw.

#include <string>

#include "apps/pietra/option_set.h"
#include "multires/cut.h"

namespace pietra {

/// --cull: what is left out.
class CullOption {
public:
    void declare(OptionSet& options, const char* help);
    Culling culling() const;

private:
    std::string word_ = "all";
};

}  // namespace pietra
