// pietra view: a window that looks at models.

#include <fmt/format.h>

#include "apps/pietra/draw_options.h"
#include "apps/pietra/limits.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/verbs.h"
#include "base/budget.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/text.h"
#include "io/triangle_source.h"
#include "methods/method_table.h"
#include "store/model_reader.h"
#include "viewer/viewer.h"

namespace pietra {

namespace {

class ViewVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    std::vector<std::string> files_;
    PictureSize size_{1280, 800};
    double pixels_ = 1;
    SelectOption select_;
    std::string renderer_ = "auto";
    std::string up_ = "auto";
    std::string script_;
    uint64_t ram_ = uint64_t(1) << 30, vram_ = uint64_t(1) << 30;
    std::optional<uint64_t> jobs_;
};

VerbText ViewVerb::text() const {
    return {
        "view",
        "look at models in a window",
        {"FILE... [options]"},
        {"Opens a window at once, and shows the models as finely as --pixels asks for. What has "
         "not been loaded yet is drawn coarser, without holes. A graphics card with OpenGL 4.5 "
         "draws where there is one, else the processor.",
         "A mesh is offered to be built first: its model is put beside it, or into the user's "
         "cache where that folder cannot be written. Files dropped on the window are added, "
         "meshes built in the background.",
         "F1 in the window lists what mouse and keys do."},
        {{"look at a model", "pietra view moon.pietra"},
         {"two models in one scene, within 512 MB", "pietra view a.pietra b.pietra --ram 512M"}}};
}

void ViewVerb::declare(OptionSet& options) {
    options.files("FILE", files_, "Models, or meshes.").require();
    options.pictureSize("--size", size_, "Of the window, in pixels.");
    options.number("--pixels", "T", pixels_, {.min = 0.25, .max = 64}, "Tolerance in pixels.");
    select_.declare(options);
    options.choice("--renderer", renderer_, {"auto", "gl", "cpu"},
                   "What draws; auto: OpenGL where a graphics card does it, else the processor.");
    options.choice("--up", up_, {"auto", "y", "z"},
                   "Which axis points up; auto: what the models seem to stand on.");
    options.size("--ram", ram_, "Most memory for what is loaded.");
    declareVram(options, vram_);
    options.text(
        "--script", "FILE", script_,
        "Do what the file says as if a user did, a command a line: wait, key F, drag left "
        "X0 Y0 X1 Y1, click left X Y, double X Y, wheel N X Y, screenshot FILE.png, quit.");
    options.count("-j,--jobs", "N", jobs_, {.min = 1, .max = 1024}, "Threads to work with.")
        .defaultsTo("all cores");
}

int ViewVerb::run(const RunContext& context) {
    shareHeap();
    const ThreadLimit threads(Limits{{}, jobs_}.threads());
    for (const std::string& file : files_)
        if (!isModelFile(file)) checkMeshFormat(file);
    ViewerSettings settings;
    settings.size = size_;
    settings.pixels = pixels_;
    settings.select = select_.selectBy();
    if (up_ != "auto") settings.up = up_ == "y" ? UpAxis::kY : UpAxis::kZ;
    settings.scene.ram_bytes = size_t(ram_);
    settings.scene.open_live = openLive;
    settings.vram_bytes = size_t(vram_);
    settings.renderer = renderer_ == "auto" ? ViewerRenderer::kAuto
                        : renderer_ == "gl" ? ViewerRenderer::kGl
                                            : ViewerRenderer::kCpu;
    settings.tell = logInfo;
    settings.gl_messages = glMessages(context.common);
    settings.script = script_;
    try {
        runViewer(files_, settings);
    } catch (const MemoryError& error) {
        throw MemoryError(memoryMessage(ram_, renderer_ == "cpu" ? 0 : vram_, error));
    } catch (const UsageError& error) {
        if (renderer_ != "gl") throw;
        throw UsageError(fmt::format("--renderer {}: {}", renderer_, error.what()));
    }
    return 0;
}

}  // namespace

std::unique_ptr<Verb> makeViewVerb() {
    return std::make_unique<ViewVerb>();
}

}  // namespace pietra
