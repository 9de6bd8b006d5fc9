#include "apps/pietra/draw_options.h"

#include <fmt/format.h>

#include "apps/pietra/logging.h"
#include "base/text.h"

namespace pietra {

void CullOption::declare(OptionSet& options, const char* help) {
    options.choice("--cull", word_, {"none", "frustum", "cone", "occlusion", "all"}, help);
}

Culling CullOption::culling() const {
    const bool all = word_ == "all";
    return {all || word_ == "frustum", all || word_ == "cone", all, all || word_ == "occlusion"};
}

void declareVram(OptionSet& options, uint64_t& bytes) {
    options.size("--vram", bytes,
                 "Most graphics memory for what is loaded, with --renderer gl: what is drawn must "
                 "fit into it, and --ram only bounds what is kept beside it.");
}

GlMessageHandler glMessages(const CommonOptions& common) {
    if (common.log_level != "debug") return {};
    return [](const GlMessage& message) { logWarning(fmt::format("OpenGL: {}", message.text)); };
}

std::string memoryMessage(uint64_t ram, uint64_t vram, const MemoryError& error) {
    return vram == 0 ? fmt::format("--ram {}: {}", formatBytes(ram), error.what())
                     : fmt::format("--ram {}, --vram {}: {}", formatBytes(ram), formatBytes(vram),
                                   error.what());
}

}  // namespace pietra
