#include "viewer/panel.h"

#include <fmt/format.h>
#include <imgui.h>

#include <iterator>

#include "base/text.h"

namespace pietra {
namespace {

constexpr const char* kHelp =
    "left drag       turn around the pivot\n"
    "right drag      pan\n"
    "wheel           towards what is under the cursor\n"
    "double click    make that point the pivot\n"
    "middle drag     look around\n"
    "arrows, PgUp/Dn fly\n"
    "F               show the whole\n"
    "T               turntable or trackball\n"
    "[ ]             tolerance\n"
    "1 to 9          shaded, normals, depth, level, patches,\n"
    "                triangles, error, colours, edges\n"
    "W               the triangles' edges\n"
    "A               1 or 4 samples a pixel\n"
    "L + drag        move the light\n"
    "Z               freeze what is selected, and where from\n"
    "O               when frozen: hidden parts red, seen ones green\n"
    "B               bounds of what is drawn: tight, saturated\n"
    "D               measure a distance by two clicks\n"
    "C               record the camera's path\n"
    "P               save a picture\n"
    "drop a file     open a model, or build that of a mesh\n"
    "Tab, F1         this panel, this help\n"
    "Esc             quit";

void text(const std::string& line) {
    ImGui::TextUnformatted(line.c_str());
}

void drawFigures(const FrameFigures& figures) {
    const float last =
        figures.ms[size_t((figures.next + FrameFigures::kHistory - 1) % FrameFigures::kHistory)];
    ImGui::PlotLines("##ms", figures.ms.data(), FrameFigures::kHistory, figures.next, nullptr, 0,
                     100, ImVec2(250, 40));
    text(fmt::format("{:.1f} ms a frame, drawing {:.1f} ms", last, figures.draw_ms));
    if (figures.gpu_ms > 0) text(fmt::format("{:.1f} ms of the GPU", figures.gpu_ms));
    text(fmt::format("{} triangles in {} patches", formatCount(double(figures.triangles)),
                     figures.patches));
    ImGui::PlotLines("##memory", figures.megabytes.data(), FrameFigures::kHistory, figures.next,
                     nullptr, 0, float(figures.ram_bytes) / (1 << 20), ImVec2(250, 25));
    text(fmt::format("memory {} of {}", formatBytes(figures.resident_bytes),
                     formatBytes(figures.ram_bytes)));
    if (figures.vram_bytes > 0)
        text(fmt::format("graphics memory {} of {}", formatBytes(figures.device_bytes),
                         formatBytes(figures.vram_bytes)));
    text(fmt::format("read {}", formatBytes(figures.bytes_read)));
    text(fmt::format("drawn by {}", figures.renderer));
    text(fmt::format("within {:.3g} px{}", figures.tolerance_px,
                     !figures.settled          ? ", loading"
                     : figures.short_of_memory ? ": no memory for more"
                                               : ""));
}

void drawSettings(ViewState& state, const CameraControl& control) {
    float pixels = float(state.pixels);
    ImGui::SetNextItemWidth(150);
    if (ImGui::SliderFloat("tolerance", &pixels, 0.25f, 16, "%.2f px",
                           ImGuiSliderFlags_Logarithmic))
        state.pixels = double(pixels);
    static constexpr const char* kShows[] = {"shaded",    "normals", "depth",   "level", "patches",
                                             "triangles", "error",   "colours", "edges"};
    int show = int(state.show);
    ImGui::SetNextItemWidth(150);
    if (ImGui::Combo("show", &show, kShows, int(std::size(kShows)))) state.show = Show(show);
    bool four = state.samples == 4;
    if (ImGui::Checkbox("4 samples a pixel", &four)) state.samples = four ? 4 : 1;
    ImGui::Checkbox("prefetch", &state.prefetch);
    ImGui::SameLine();
    ImGui::Checkbox("frozen", &state.frozen);
    if (state.frozen) ImGui::Checkbox("hidden parts red, seen ones green", &state.show_hidden);
    text(control.style() == CameraControl::Style::kTurntable ? "turntable" : "trackball");
    if (state.recording) text("recording the path: C ends");
    if (state.measuring)
        text(state.measured_count < 2
                 ? fmt::format("distance: click point {}", state.measured_count + 1)
                 : fmt::format("distance {:.9g}",
                               glm::length(state.measured[1] - state.measured[0])));
}

}  // namespace

void drawPanel(ViewState& state, const FrameFigures& figures, const CameraControl& control,
               const std::vector<std::string>& faults) {
    if (state.show_panel) {
        ImGui::SetNextWindowPos(ImVec2(10, 10), ImGuiCond_Once);
        ImGui::SetNextWindowBgAlpha(0.75f);
        ImGui::Begin("Pietra", &state.show_panel,
                     ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoFocusOnAppearing);
        drawFigures(figures);
        ImGui::Separator();
        drawSettings(state, control);
        if (!state.message.empty()) {
            ImGui::Separator();
            text(state.message);
        }
        for (const std::string& fault : faults) text(fault);
        text("F1: help");
        ImGui::End();
    }
    if (state.show_help) {
        ImGui::SetNextWindowPos(ImVec2(320, 10), ImGuiCond_Once);
        ImGui::SetNextWindowBgAlpha(0.85f);
        ImGui::Begin("Help", &state.show_help, ImGuiWindowFlags_AlwaysAutoResize);
        text(kHelp);
        ImGui::End();
    }
}

void drawFiles(OpenFiles& files) {
    if (files.offers().empty() && files.builds().empty()) return;
    const ImVec2 window = ImGui::GetIO().DisplaySize;
    ImGui::SetNextWindowPos(ImVec2(window.x / 2, window.y / 2), ImGuiCond_Always,
                            ImVec2(0.5f, 0.5f));
    ImGui::SetNextWindowBgAlpha(0.85f);
    ImGui::Begin("Files", nullptr,
                 ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoTitleBar |
                     ImGuiWindowFlags_NoFocusOnAppearing);
    for (const std::string& mesh : files.offers())
        text(fmt::format("{} is a mesh. Its model would be\n{}", mesh, modelPathOf(mesh)));
    if (!files.offers().empty()) {
        if (ImGui::Button("Build (Enter)")) files.acceptOffers();
        ImGui::SameLine();
        if (ImGui::Button("Not now")) files.refuseOffers();
    }
    const BackgroundBuild* stopped = nullptr;
    for (const auto& build : files.builds()) {
        text(fmt::format("building {}", build->model()));
        ImGui::ProgressBar(build->fraction(), ImVec2(320, 0), build->text().c_str());
        ImGui::SameLine();
        ImGui::PushID(build.get());
        if (ImGui::Button("Stop")) stopped = build.get();
        ImGui::PopID();
    }
    files.stopBuild(stopped);
    ImGui::End();
}

}  // namespace pietra
