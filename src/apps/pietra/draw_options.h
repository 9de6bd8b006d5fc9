#pragma once
// Options of the verbs that draw.

#include <span>
#include <string>

#include "apps/pietra/verb.h"
#include "base/error.h"
#include "gpu/context.h"
#include "multires/cut.h"
#include "store/model_reader.h"

namespace pietra {

/// --cull: what is left out.
class CullOption {
public:
    void declare(OptionSet& options, const char* help);
    Culling culling() const;

private:
    std::string word_ = "all";
};

/// --select: what the tolerance bounds.
class SelectOption {
public:
    void declare(OptionSet& options);
    SelectBy selectBy() const { return word_ == "area" ? SelectBy::kFaceSize : SelectBy::kError; }
    /// Throws UsageError for a model that does not know it.
    SelectBy selectBy(std::span<const ModelReader* const> models) const;
    const std::string& word() const { return word_; }

private:
    std::string word_ = "error";
};

/// --vram.
void declareVram(OptionSet& options, uint64_t& bytes);
/// With --log-level debug: has what OpenGL says logged; else empty.
GlMessageHandler glMessages(const CommonOptions& common);
/// Of a scene that does not fit the limits given; `vram` is 0 where there is none.
std::string memoryMessage(uint64_t ram, uint64_t vram, const MemoryError& error);

}  // namespace pietra
