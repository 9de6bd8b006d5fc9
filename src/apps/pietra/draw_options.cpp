#include "apps/pietra/draw_options.h"

namespace pietra {

void CullOption::declare(OptionSet& options, const char* help) {
    options.choice("--cull", word_, {"none", "frustum", "cone", "occlusion", "all"}, help);
}

Culling CullOption::culling() const {
    const bool all = word_ == "all";
    return {all || word_ == "frustum", all || word_ == "cone", all, all || word_ == "occlusion"};
}

}  // namespace pietra
