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

void SelectOption::declare(OptionSet& options) {
    options.choice("--select", word_, {"error", "area"},
                   "What --pixels bounds: how far the error may show; or, for models of the method "
                   "cluster, how large faces may, in the mean: an area of at most the square of "
                   "so many pixels, whatever the error.");
}

SelectBy SelectOption::selectBy(std::span<const ModelReader* const> models) const {
    for (const ModelReader* model : models)
        if (selectBy() == SelectBy::kFaceSize && !model->info().face_sizes)
            throw UsageError(fmt::format("--select area: {}: does not say how large its faces are",
                                         model->path()));
    return selectBy();
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
