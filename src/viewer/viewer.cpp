#include "viewer/viewer.h"

#include <SDL.h>
#include <backends/imgui_impl_sdl.h>
#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <future>
#include <optional>

#include "base/error.h"
#include "base/stopwatch.h"
#include "runtime/camera_path.h"
#include "runtime/pick.h"
#include "runtime/up_axis.h"
#include "viewer/open_files.h"
#include "viewer/panel.h"
#include "viewer/screen.h"
#include "viewer/script.h"

namespace pietra {
namespace {

constexpr double kFluentMs = 40;      // frames in motion may take this long
constexpr double kMostCoarsened = 8;  // by which the tolerance is raised for that, at most
constexpr double kAtRestSeconds = 0.15;
constexpr double kRecordSeconds = 0.1;  // between two keys of a recorded path
constexpr double kZoomStep = 0.85;
constexpr Rgba8 kHiddenTint{255, 90, 80, 255}, kSeenTint{120, 235, 130, 255};

/// A name that is not taken: `stem`-1.`ending` and so on, in the current folder.
std::string freeName(const char* stem, const char* ending) {
    for (int i = 1;; ++i)
        if (std::string name = fmt::format("{}-{}.{}", stem, i, ending);
            !std::filesystem::exists(name))
            return name;
}

class Viewer {
public:
    Viewer(OpenFiles& files, const ViewerSettings& settings)
        : files_(files),
          settings_(settings),
          screen_(openScreen()),
          control_(wholeScene(Box3d{{Vec3d(0)}, {Vec3d(1)}}, UpAxis::kZ)) {
        nothing_.settled = true;
        if (!settings.script.empty()) script_ = Script(settings.script);
        showModels();
        state_.pixels = settings.pixels;
        figures_.ram_bytes = settings.scene.ram_bytes;
        figures_.vram_bytes = sink() != nullptr ? sink()->capacityBytes() : 0;
        figures_.renderer = screen_->rendererName();
    }

    void run() {
        while (!quit_) {
            const Stopwatch watch;
            handleEvents();
            flyByKeys();
            openWhatIsBuilt();
            takePicks();
            if (!ready()) drawScene();
            present();
            screen_->swap();
            last_frame_ = watch.seconds();
            if (!ready()) figures_.add(float(1e3 * last_frame_));
            record();
        }
    }

private:
    std::unique_ptr<Screen> openScreen();
    PageSink* sink() const { return screen_->renderer().sink(); }
    CameraControl wholeScene(const Box3d& bounds, UpAxis up) const;
    void showModels();
    void openWhatIsBuilt();
    void drop(const std::string& file);
    void handleEvents();
    void runScript();
    void handle(const SDL_Event& event);
    void handleKey(SDL_Keycode key);
    void handleDrag(const SDL_MouseMotionEvent& motion);
    void handleClick(const SDL_MouseButtonEvent& button);
    void zoomTo(int steps);
    void flyByKeys();
    void setPixels(double pixels);
    void touch() { touched_.restart(); }
    bool moving() const { return touched_.seconds() < kAtRestSeconds; }
    /// The picture on the screen is the one asked for.
    bool ready() const { return picture_size_.width > 0 && figures_.settled && !moving(); }

    void drawScene();
    std::vector<ModelPatches> drawList(const Camera& camera, const Frame& frame) const;
    bool looksBack() const;
    void lookBack();
    void findHidden(const Frame& frame);
    void markHidden(std::vector<ModelPatches>& list);
    ShadeSettings shade() const;
    void adaptToMotion();
    void present();
    std::optional<Vec3d> pointAt(int x, int y) const;
    void lookUp(const Vec3d& shown);
    void takePicks();
    Vec2d pictureCursor() const;
    std::vector<std::string> faults() const;
    void savePicture();
    void saveWindow(const std::string& file);
    void record();
    void toggleRecording();

    OpenFiles& files_;
    std::vector<const ModelReader*> models_;
    ViewerSettings settings_;
    ViewState state_;
    std::unique_ptr<Screen> screen_;
    std::optional<Scene> scene_;  // none as long as there are no models
    Frame nothing_;               // of no models
    const Frame* shown_ = nullptr;
    CameraControl control_;
    Script script_;
    FrameFigures figures_;
    Vec3d light_ = ShadeSettings{}.light_direction;
    bool light_key_ = false;
    double motion_factor_ = 1;
    double last_frame_ = 0;
    PictureSize picture_size_{0, 0};  // of the last one drawn
    bool quit_ = false;
    struct Pick {
        std::future<Vec3d> point;
        int measured;  // which end of the distance, or -1
    };
    std::vector<Pick> picks_;
    Stopwatch running_, touched_, last_key_;
    Camera frozen_camera_;
    std::optional<SeenDepth> seen_;               // of the last picture that is known
    std::vector<uint32_t> hidden_;                // ids of patches that others hide from there
    std::vector<std::vector<DrawPatch>> marked_;  // coloured by that
    CameraPath path_;
    double path_start_ = 0;
    int cursor_x_ = 0, cursor_y_ = 0;
};

std::unique_ptr<Screen> Viewer::openScreen() {
    if (settings_.renderer == ViewerRenderer::kCpu) return openCpuScreen(settings_.size);
    const bool insist = settings_.renderer == ViewerRenderer::kGl;
    try {
        return openGlScreen(settings_.size, settings_.vram_bytes, insist, settings_.gl_messages);
    } catch (const UsageError& error) {
        if (insist) throw;
        state_.message = fmt::format("drawing with the processor: {}", error.what());
        if (settings_.tell) settings_.tell(state_.message);
        return openCpuScreen(settings_.size);
    }
}

CameraControl Viewer::wholeScene(const Box3d& bounds, UpAxis up) const {
    return {bounds, up, standardCamera(StandardView::kFront, up, bounds, screen_->size())};
}

/// The models that are open now; the camera stays where it is, but for the first ones.
void Viewer::showModels() {
    const std::vector<const ModelReader*> models = files_.models();
    if (models.empty()) return;
    for (const Pick& pick : picks_) pick.point.wait();  // they read from models
    shown_ = nullptr;
    scene_.reset();  // two would need the memory twice
    SceneSettings settings = settings_.scene;
    settings.sink = sink();
    scene_.emplace(models, settings);
    const Box3d bounds = boundsOf(models);
    if (models_.empty())
        control_ = wholeScene(bounds, settings_.up
                                          ? *settings_.up
                                          : guessUpAxis(coarseSurface(models, settings.open_live)));
    control_.setBounds(bounds);
    models_ = models;
    SDL_SetWindowTitle(screen_->window(),
                       models.size() == 1
                           ? fmt::format("{} - Pietra", models[0]->path()).c_str()
                           : fmt::format("{} models - Pietra", models.size()).c_str());
    touch();
}

void Viewer::openWhatIsBuilt() {
    files_.poll();
    if (files_.models().size() == models_.size()) return;
    try {
        showModels();
    } catch (const MemoryError& error) {
        files_.closeAfter(models_.size(), error.what());
        showModels();
    }
}

void Viewer::drop(const std::string& file) {
    try {
        files_.open(file, true);
    } catch (const Error& error) {
        files_.addFault(error.what());
    }
}

void Viewer::handleEvents() {
    runScript();
    SDL_Event event;
    // At rest there is nothing to do until something happens.
    if (ready() && script_.done() && !state_.recording && SDL_WaitEventTimeout(&event, 100))
        handle(event);
    while (SDL_PollEvent(&event)) handle(event);
}

void Viewer::runScript() {
    if (script_.done()) return;
    const Script::Step step = script_.front();
    if (step.kind != Script::Step::Kind::kEvent && !ready()) return;
    if (step.kind == Script::Step::Kind::kWait && (!files_.builds().empty() || !picks_.empty()))
        return;
    script_.pop();
    if (step.kind == Script::Step::Kind::kScreenshot) saveWindow(step.file);
    if (step.kind == Script::Step::Kind::kEvent) handle(step.event);
}

void Viewer::handle(const SDL_Event& event) {
    ImGui_ImplSDL2_ProcessEvent(&event);
    const ImGuiIO& io = ImGui::GetIO();
    const bool over_panel =
        io.WantCaptureMouse && ImGui::IsWindowHovered(ImGuiHoveredFlags_AnyWindow);
    switch (event.type) {
        case SDL_QUIT:
            quit_ = true;
            break;
        case SDL_WINDOWEVENT:
            touch();
            break;
        case SDL_DROPFILE:
            drop(event.drop.file);
            SDL_free(event.drop.file);
            break;
        case SDL_MOUSEMOTION:
            if (!over_panel) handleDrag(event.motion);
            cursor_x_ = event.motion.x;
            cursor_y_ = event.motion.y;
            break;
        case SDL_MOUSEBUTTONDOWN:
            if (!over_panel) handleClick(event.button);
            break;
        case SDL_MOUSEWHEEL:
            if (!over_panel) zoomTo(event.wheel.y);
            break;
        case SDL_KEYDOWN:
            if (!io.WantTextInput) handleKey(event.key.keysym.sym);
            break;
        case SDL_KEYUP:
            light_key_ &= event.key.keysym.sym != SDLK_l;
            break;
        default:
            break;
    }
}

void Viewer::setPixels(double pixels) {
    state_.pixels = std::clamp(pixels, 0.25, 64.0);
    state_.message = fmt::format("tolerance {:.3g} px", state_.pixels);
}

void Viewer::handleKey(SDL_Keycode key) {
    touch();
    if (key >= SDLK_1 && key <= SDLK_9) state_.show = Show(key - SDLK_1);
    switch (key) {
        case SDLK_ESCAPE:
            quit_ = true;
            break;
        case SDLK_RETURN:
            files_.acceptOffers();
            break;
        case SDLK_f:
            control_.frame(screen_->size());
            break;
        case SDLK_t:
            control_.setStyle(control_.style() == CameraControl::Style::kTurntable
                                  ? CameraControl::Style::kTrackball
                                  : CameraControl::Style::kTurntable);
            break;
        case SDLK_LEFTBRACKET:
            setPixels(state_.pixels / std::sqrt(2.0));
            break;
        case SDLK_RIGHTBRACKET:
            setPixels(state_.pixels * std::sqrt(2.0));
            break;
        case SDLK_a:
            state_.samples = 5 - state_.samples;
            break;
        case SDLK_l:
            light_key_ = true;
            break;
        case SDLK_w:
            state_.show = state_.show == Show::kWire ? Show::kShaded : Show::kWire;
            break;
        case SDLK_b:
            state_.spheres = ShowSpheres((int(state_.spheres) + 1) % 3);
            break;
        case SDLK_z:
            state_.frozen = !state_.frozen;
            break;
        case SDLK_o:
            state_.show_hidden = !state_.show_hidden;
            break;
        case SDLK_d:
            state_.measuring = !state_.measuring;
            state_.measured_count = 0;
            break;
        case SDLK_c:
            toggleRecording();
            break;
        case SDLK_p:
            savePicture();
            break;
        case SDLK_TAB:
            state_.show_panel = !state_.show_panel;
            break;
        case SDLK_F1:
            state_.show_help = !state_.show_help;
            break;
        default:
            break;
    }
}

void Viewer::handleDrag(const SDL_MouseMotionEvent& motion) {
    const double dx = motion.x - cursor_x_, dy = motion.y - cursor_y_;
    if (motion.state == 0 || (dx == 0 && dy == 0)) return;
    const PictureSize size = settings_.size;
    if (motion.state & SDL_BUTTON_LMASK) {
        if (light_key_)
            light_ = glm::normalize(light_ + Vec3d(dx, -dy, 0) * (2.0 / size.height));
        else
            control_.rotate(dx, dy, size);
    } else if (motion.state & SDL_BUTTON_RMASK) {
        control_.pan(dx, dy, size);
    } else {
        control_.look(dx, dy, size);
    }
    touch();
}

/// Window coordinates to pixels of the picture.
Vec2d Viewer::pictureCursor() const {
    int width = 1, height = 1;
    SDL_GetWindowSize(screen_->window(), &width, &height);
    const PictureSize size = screen_->size();
    return {double(cursor_x_) * size.width / width, double(cursor_y_) * size.height / height};
}

/// The surface in the picture there, if any.
std::optional<Vec3d> Viewer::pointAt(int x, int y) const {
    const PictureSize size = picture_size_;  // the window may have another by now
    if (x < 0 || y < 0 || x >= size.width || y >= size.height) return {};
    const float depth = screen_->renderer().depthAt(x, y);
    if (!std::isfinite(depth)) return {};
    return control_.pointUnder(x + 0.5, y + 0.5, double(depth), size);
}

void Viewer::handleClick(const SDL_MouseButtonEvent& button) {
    cursor_x_ = button.x;
    cursor_y_ = button.y;
    if (button.button != SDL_BUTTON_LEFT) return;
    const Vec2d at = pictureCursor();
    const std::optional<Vec3d> point = pointAt(int(at.x), int(at.y));
    if (!point) return;
    if (state_.measuring && button.clicks == 1) {
        if (state_.measured_count == 2) state_.measured_count = 0;
        state_.measured[size_t(state_.measured_count++)] = *point;
        lookUp(*point);
    }
    if (button.clicks == 2) {
        control_.setPivot(*point);
        lookUp(*point);
    }
    touch();
}

/// Looks for the input's own surface behind the pixel that shows `shown`.
void Viewer::lookUp(const Vec3d& shown) {
    const Vec3d eye = control_.camera().eye;
    const int measured = state_.measuring ? state_.measured_count - 1 : -1;
    picks_.push_back({std::async(std::launch::async,
                                 [models = models_, eye, shown] {
                                     return pickFinest(models, eye, shown - eye).value_or(shown);
                                 }),
                      measured});
}

/// What was looked up replaces what was shown.
void Viewer::takePicks() {
    std::erase_if(picks_, [&](Pick& pick) {
        if (pick.point.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
        try {
            const Vec3d p = pick.point.get();
            state_.message = fmt::format("point {:.9g} {:.9g} {:.9g}", p.x, p.y, p.z);
            if (pick.measured >= 0) state_.measured[size_t(pick.measured)] = p;
        } catch (const Error& error) {
            files_.addFault(error.what());
        }
        return true;
    });
}

void Viewer::zoomTo(int steps) {
    const Vec2d at = pictureCursor();
    const PictureSize size = screen_->size();
    const std::optional<Vec3d> surface = pointAt(int(at.x), int(at.y));
    control_.zoom(
        std::pow(kZoomStep, steps),
        surface ? *surface : control_.pointUnder(at.x, at.y, control_.pivotDepth(), size));
    touch();
}

void Viewer::flyByKeys() {
    if (ImGui::GetIO().WantTextInput) return;
    const uint8_t* keys = SDL_GetKeyboardState(nullptr);
    const auto axis = [&](SDL_Scancode plus, SDL_Scancode minus) {
        return double(keys[plus]) - double(keys[minus]);
    };
    const double right = axis(SDL_SCANCODE_RIGHT, SDL_SCANCODE_LEFT);
    const double forward = axis(SDL_SCANCODE_UP, SDL_SCANCODE_DOWN);
    const double up = axis(SDL_SCANCODE_PAGEUP, SDL_SCANCODE_PAGEDOWN);
    if (right == 0 && forward == 0 && up == 0) return;
    const double time = std::clamp(last_frame_, 1.0 / 240, 0.2);
    control_.fly(right * time, up * time, forward * time);
    touch();
}

ShadeSettings Viewer::shade() const {
    ShadeSettings shade;
    shade.show = state_.show;
    shade.light_direction = light_;
    shade.value_min = 0;
    shade.value_max = float(state_.pixels);
    return shade;
}

/// In motion: coarser where frames take too long, finer again where there is time.
void Viewer::adaptToMotion() {
    if (!moving()) {
        motion_factor_ = 1;
        return;
    }
    const double ratio = 1e3 * last_frame_ / kFluentMs;
    if (ratio > 1) motion_factor_ *= 1.15;
    if (ratio < 0.7) motion_factor_ /= 1.1;
    motion_factor_ = std::clamp(motion_factor_, 1.0, kMostCoarsened);
}

void Viewer::drawScene() {
    adaptToMotion();
    const PictureSize size = screen_->size();
    if (!state_.frozen) {
        frozen_camera_ = control_.camera();
        lookBack();
    }
    FrameRequest request;
    request.camera = frozen_camera_;
    request.size = size;
    request.pixels = state_.pixels * motion_factor_;
    request.select = settings_.select;
    request.seconds = running_.seconds();
    request.prefetch = state_.prefetch;
    request.show_error = state_.show == Show::kError;
    request.seen = seen_ ? &*seen_ : nullptr;
    const Frame& frame = scene_ ? scene_->update(request) : nothing_;
    shown_ = &frame;
    const Stopwatch watch;
    const bool show_hidden = state_.frozen && state_.show_hidden;
    if (show_hidden) findHidden(frame);
    std::vector<ModelPatches> list = drawList(control_.camera(), frame);
    if (show_hidden) markHidden(list);
    screen_->renderer().draw(list, {shade(), state_.samples, request.culling.occlusion, nullptr,
                                    looksBack() ? &frozen_camera_ : nullptr});
    figures_.draw_ms = watch.ms();
    figures_.tolerance_px = frame.tolerance_px;
    figures_.settled = frame.settled && motion_factor_ == 1;
    figures_.short_of_memory = frame.raised;
    figures_.triangles = frame.triangles;
    figures_.patches = frame.patch_count;
    figures_.gpu_ms = screen_->renderer().gpuMs();
    figures_.resident_bytes = frame.resident_bytes;
    figures_.device_bytes = frame.device_bytes;
    figures_.bytes_read = frame.bytes_read;
    picture_size_ = size;
}

/// What the last picture hides may be coarser. One model hides little of itself.
bool Viewer::looksBack() const {
    return models_.size() > 1 && state_.samples == 1 && !state_.frozen;
}

void Viewer::lookBack() {
    const SeenDepth* seen = looksBack() ? screen_->renderer().seen() : nullptr;
    seen_ = seen != nullptr ? std::optional(*seen) : std::nullopt;
}

std::vector<ModelPatches> Viewer::drawList(const Camera& camera, const Frame& frame) const {
    static const Lattice none;
    const PictureSize size = screen_->size();
    std::vector<ModelPatches> list;
    for (size_t m = 0; m < models_.size(); ++m) {
        const Lattice& lattice = models_[m]->info().lattice;
        list.push_back({View(camera, size, lattice), &lattice, frame.models[m].patches});
    }
    if (list.empty()) list.push_back({View(camera, size, none), &none, {}});
    return list;
}

/// What others hide from where the selection is frozen: twice, as OpenGL draws all that was not
/// hidden before.
void Viewer::findHidden(const Frame& frame) {
    for (int round = 0; round < 2; ++round) {
        hidden_.clear();
        screen_->renderer().draw(drawList(frozen_camera_, frame),
                                 {.shade = shade(), .hidden = &hidden_});
    }
    std::sort(hidden_.begin(), hidden_.end());
}

void Viewer::markHidden(std::vector<ModelPatches>& list) {
    marked_.clear();
    for (ModelPatches& model : list) {
        std::vector<DrawPatch>& marked = marked_.emplace_back();
        for (DrawPatch patch : model.patches) {
            const bool hidden = std::binary_search(hidden_.begin(), hidden_.end(), patch.id);
            patch.tint = hidden ? kHiddenTint : kSeenTint;
            patch.one_sided = false;  // from the back, too
            marked.push_back(patch);
        }
        model.patches = marked;
    }
}

void Viewer::present() {
    screen_->beginFrame();
    ImGui::NewFrame();
    const ViewState before = state_;
    drawPanel(state_, figures_, control_, faults());
    drawFiles(files_);
    drawOverlay({.camera = control_.camera(),
                 .selected = state_.frozen ? &frozen_camera_ : nullptr,
                 .spheres = state_.spheres,
                 .measured = {state_.measured.data(), size_t(state_.measured_count)},
                 .models = models_,
                 .frame = shown_});
    if (before.pixels != state_.pixels || before.show != state_.show ||
        before.samples != state_.samples || before.frozen != state_.frozen ||
        before.show_hidden != state_.show_hidden)
        touch();
    ImGui::Render();
    screen_->show(*ImGui::GetDrawData());
}

std::vector<std::string> Viewer::faults() const {
    std::vector<std::string> all = files_.faults();
    if (scene_) all.insert(all.end(), scene_->faults().begin(), scene_->faults().end());
    return all;
}

void Viewer::savePicture() {
    if (picture_size_.width == 0) return;
    const std::string name = freeName("pietra", "png");
    try {
        writePng(screen_->renderer().picture(), name, false);
        state_.message = fmt::format("saved {}", name);
    } catch (const std::exception& error) {
        state_.message = error.what();
    }
}

/// The window as it is seen, panels and all.
void Viewer::saveWindow(const std::string& file) {
    present();
    writePng(screen_->read(), file, true);
}

void Viewer::toggleRecording() {
    state_.recording = !state_.recording;
    if (state_.recording) {
        path_ = {};
        path_start_ = running_.seconds();
        state_.message = "recording";
        return;
    }
    if (path_.keys.empty()) return;
    path_.seconds = std::max(path_.keys.back().t, kRecordSeconds);
    const std::string name = freeName("path", "json");
    std::ofstream out(name);
    out << cameraPathText(path_);
    state_.message =
        out.flush() ? fmt::format("saved {}", name) : fmt::format("{} cannot be written", name);
}

void Viewer::record() {
    if (!state_.recording || last_key_.seconds() < kRecordSeconds) return;
    last_key_.restart();
    path_.keys.push_back({running_.seconds() - path_start_, control_.camera()});
}

}  // namespace

void runViewer(const std::vector<std::string>& names, const ViewerSettings& settings) {
    OpenFiles files(settings.program);
    for (const std::string& name : names) files.open(name, false);
    Viewer(files, settings).run();
}

}  // namespace pietra
