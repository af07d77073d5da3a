#include "tools/viewer/viewer.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "render/frame/frame_plan.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/message.h"
#include "tools/viewer/first_view.h"
#include "tools/viewer/frame_loop.h"
#include "tools/viewer/navigation.h"
#include "tools/viewer/panels.h"
#include "tools/viewer/picture_texture.h"
#include "tools/viewer/playback.h"
#include "tools/viewer/state_files.h"
#include "tools/viewer/view_state.h"
#include "tools/viewer/widget_places.h"
#include "tools/viewer/window.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

// New pictures and input end a wait early. Longer waits leave the processor to the renderer when both share
// it.
constexpr double kIdleWait_s = 0.5;
constexpr double kMovingWait_s = 0.03;  // while flying, and until the camera is at rest
constexpr int kFramesAfterInput = 2;    // Dear ImGui needs them to settle

double clockSeconds() {
  return glfwGetTime();
}

bool same(ImageSize a, ImageSize b) {
  return a.width == b.width && a.height == b.height;
}

class Viewer {
 public:
  Viewer(const CacheReader& cache, const ViewerOptions& options)
      : cache_(cache),
        options_(options),
        window_(fmt::format("{} - curvisplat", cache.cachePath().filename().string()), options.size),
        state_(openingState()),
        panels_(cache),
        playback_(cache.series().steps.size()),
        frames_(cache, options.backend, Window::wake),
        picture_(window_.gl()),
        overlay_(window_.gl()) {
    printMessage("window: OpenGL {}", window_.contextName());
    playback_.goTo(cache.step());
    updateBounds();
    fitData(pictureSize());
  }

  /// Saves the state when the window closes, also when a signal closes it.
  void run(const Progress& stopped) {
    try {
      loop(stopped);
    } catch (const Interrupted&) {
      remember();
      throw;
    }
    remember();
  }

 private:
  void loop(const Progress& stopped) {
    int frames_to_settle = kFramesAfterInput;
    while (window_.isOpen()) {
      stopped.throwIfStopped();
      const bool moving = navigation_.isMoving() || ImGui::IsAnyItemActive();
      const bool step_is_due = playback_.isPlaying() && isShown() && playback_.wait(clockSeconds()) <= 0;
      const bool short_wait = moving || playback_.isPlaying();
      window_.wait(frames_to_settle > 0 || step_is_due ? 0 : short_wait ? kMovingWait_s : kIdleWait_s);
      frames_to_settle = window_.takeInput() ? kFramesAfterInput : std::max(0, frames_to_settle - 1);
      update();
    }
  }

  ViewState openingState() {
    const ImageSize size = pictureSize();
    ViewState state = firstViewOf(cache_, options_.scalar.value_or(""), size);
    if (options_.state) {
      state = viewStateFromJson(readTextFile(*options_.state), *options_.state, cache_.manifest());
    } else if (const auto remembered = rememberedStateOf(cache_.cachePath());
               remembered && fs::exists(*remembered)) {
      try {
        ViewState found = viewStateFromJson(readTextFile(*remembered), *remembered, cache_.manifest());
        loadSurfaces(found);
        state = std::move(found);
      } catch (const Error& error) {
        printMessage("warning: {}; using the initial view", error.what());
      }
    }
    if (options_.scalar && *options_.scalar != state.variable)
      chooseVariable(state, cache_, *options_.scalar);
    if (options_.memory_bytes) state.memory_bytes = *options_.memory_bytes;
    if (options_.scene) takeScene(*options_.scene, state);
    loadSurfaces(state);
    return state;
  }

  /// Surfaces and slices of the command line take the place of those of the state.
  void takeScene(const SurfaceScene& scene, ViewState& state) const {
    state.surfaces.clear();
    for (size_t n = 0; n < scene.surfaces.size(); ++n)
      state.surfaces.push_back(
          {fs::absolute(options_.surface_files.at(n)), scene.surfaces[n].colour, scene.surfaces[n].mesh});
    state.faces.clear();
    for (size_t n = 0; n < scene.grid_surfaces.size(); ++n)
      state.faces.push_back({options_.face_names.at(n), scene.grid_surfaces[n]});
    state.faces_by = options_.faces_by;
    state.isovalues = scene.isovalues;
    state.iso_opacity = scene.iso_opacity;
    state.slices = scene.slices;
    state.slice_opacity = scene.slice_opacity;
    state.volume = scene.volume;
  }

  /// Draws one frame of the window with the effects of all input so far.
  void update() {
    window_.beginFrame();
    takeFrame();
    const bool changed = react();
    const ImageSize size = pictureSize();
    if (size.width > 0 && size.height > 0) {
      const bool moving = navigation_.isMoving() || dragging_ || playback_.isPlaying();
      if (changed || moving != was_moving_ || !same(size, picture_size_) || request_ == 0) {
        fitData(size);
        ask(moving);
        annotate();
      }
      showPicture();
      savePictureIfFinal();
      if (std::exchange(copy_requested_, false)) copyCommand();
    }
    window_.endFrame(glm::vec3(state_.background()));
    writeWidgetPlaces();
  }

  /// Size in pixels of the picture beside the panels.
  ImageSize pictureSize() const {
    ImageSize size = window_.pixels();
    const int panel = static_cast<int>(std::lround(window_.pixelScale() * panelWidth()));
    if (size.width > 0) size.width = std::max(1, size.width - panel);  // even if the panels fill the window
    return size;
  }
  float panelWidth() const { return panels_shown_ ? Panels::width() : 0; }

  /// Divides the picture into the data's part and the scalar bar.
  void fitData(ImageSize picture) {
    picture_size_ = picture;
    data_size_ = dataSize(state_.annotations, picture, state_.function.function());
  }

  /// Applies keys, mouse and panels. Returns true if the picture must be drawn again.
  bool react() {
    bool changed = navigation_.update(window_, state_.camera, data_size_);
    if (!window_.showsClick()) changed |= pressKeys();
    PanelFacts facts;
    facts.statistics = shown_ ? &shown_->statistics : nullptr;
    facts.is_final = shown_ && shown_->is_final && shown_->request == request_;
    facts.busy = frames_.busy();
    facts.flies = navigation_.flies();
    facts.backend = frames_.backendName();
    facts.message = message_;
    PanelActions actions;
    facts.playback = &playback_;
    window_.setPictureLeft(panelWidth());
    if (panels_shown_) actions = panels_.draw(state_, variable(), facts);
    if (actions.step) changed |= playback_.goTo(*actions.step);
    if (actions.toggle_play) changed |= press({GLFW_KEY_SPACE});
    if (isShown()) changed |= playback_.tick(clockSeconds());
    dragging_ = actions.dragging;
    changed |= actions.changed;
    updateBounds();
    if (actions.reset_camera) changed |= press({GLFW_KEY_R});
    if (actions.other_projection) changed |= press({GLFW_KEY_O});
    if (actions.toggle_flight) changed |= press({GLFW_KEY_F});
    if (actions.save_picture) press({GLFW_KEY_P});
    if (actions.copy_command) press({GLFW_KEY_C});
    if (actions.function_changed) ++function_version_;
    if (window_.showsClick()) changed |= pressKeys();
    return changed;
  }

  /// Whether a picture of the newest request is in the window.
  bool isShown() const { return shown_ && shown_->request == request_; }

  bool pressKeys() {
    bool changed = false;
    for (const Window::Key& key : window_.takeKeys()) changed |= press(key);
    return changed;
  }

  bool press(const Window::Key& key) {
    switch (key.code) {
      case GLFW_KEY_P:
        save_requested_ = true;
        message_ = "the picture will be saved when it is final";
        return false;
      case GLFW_KEY_C:
        copy_requested_ = true;
        return false;
      case GLFW_KEY_SPACE:
        playback_.toggle();
        return true;
      case GLFW_KEY_PERIOD:
        return playback_.advance(true);
      case GLFW_KEY_COMMA:
        return playback_.advance(false);
      case GLFW_KEY_H:
        panels_shown_ = !panels_shown_;
        return false;
      case GLFW_KEY_ESCAPE:
        window_.close();
        return false;
      default:
        return navigation_.press(key, state_.camera, data_size_);
    }
  }

  size_t variable() const { return cache_.variableNamed(state_.variable); }

  void updateBounds() {
    const Manifest& manifest = cache_.manifest();
    navigation_.setBounds(state_.scale * manifest.lower, state_.scale * manifest.upper);
  }

  void ask(bool moving) {
    FrameRequest request{variable(), function_version_, state_.function.function(), state_.camera,
                         state_.frameOptions(data_size_)};
    request.moving = moving;
    request.step = playback_.step();
    request.next_step = playback_.next();
    request.target_s = options_.target_s.value_or(frames_.drawsInSoftware() ? 0.1 : 0.033);
    request_ = frames_.request(std::move(request));
    was_moving_ = moving;
  }

  void takeFrame() {
    try {
      std::optional<ShownFrame> frame = frames_.take();
      if (!frame) return;
      picture_.set(frame->bytes, frame->image.size);
      shown_ = std::move(frame);
    } catch (const UsageError& error) {
      if (message_ != error.what()) printMessage("warning: {}", error.what());
      message_ = error.what();
    }
  }

  AnnotatedScene sceneFor(const TransferFunction& function) const {
    const Manifest& manifest = cache_.manifest();
    const VariableInfo& info = manifest.variables[variable()];
    return {picture_size_,
            screenViewOf(manifest, state_.camera, state_.frameOptions(data_size_), data_size_),
            {{&function, scalarTitle(info.name, info.unit)}},
            manifest.lower,
            manifest.upper,
            state_.background()};
  }

  void annotate() {
    const TransferFunction function = state_.function.function();
    overlay_.set(annotationLayer(state_.annotations, sceneFor(function)), picture_size_);
  }

  void showPicture() {
    ImDrawList* const list = ImGui::GetBackgroundDrawList();
    const ImVec2 lower(panelWidth(), 0), upper = ImGui::GetIO().DisplaySize;
    const float strip = static_cast<float>((picture_size_.width - data_size_.width) / window_.pixelScale());
    if (!picture_.isEmpty()) list->AddImage(picture_.id(), lower, {upper.x - strip, upper.y});
    if (!overlay_.isEmpty()) list->AddImage(overlay_.id(), lower, upper);
  }

  void savePictureIfFinal() {
    if (!save_requested_ || !shown_ || !shown_->is_final || shown_->request != request_) return;
    save_requested_ = false;
    fs::path file;
    for (int number = 1; file.empty() || fs::exists(file); ++number)
      file = fmt::format("{}_{:04}.png", cache_.cachePath().stem().string(), number);
    try {
      const TransferFunction function = state_.function.function();
      writeImage(annotated(shown_->image, state_.annotations, sceneFor(function)), file);
      message_ = "saved " + fs::absolute(file).string();
    } catch (const Error& error) {
      message_ = error.what();
    }
  }

  void copyCommand() {
    try {
      fs::path function_file;
      if (!state_.function.isPreset())
        function_file = keepFunction(toParaViewPreset(state_.function.definition()));
      const std::string command =
          renderCommand(state_, fs::absolute(cache_.cachePath()), picture_size_, function_file) +
          (playback_.steps() > 1 ? fmt::format(" --step {}", playback_.step()) : "");
      window_.setClipboard(command);
      fmt::print("{}\n", command);
      std::fflush(stdout);
      message_ = "copied: " + command;
    } catch (const Error& error) {
      message_ = error.what();
    }
  }

  void remember() const {
    const auto file = rememberedStateOf(cache_.cachePath());
    if (!file) return;
    try {
      writeState(*file, toJson(state_));
    } catch (const Error& error) {
      printMessage("warning: cannot save the view: {}", error.what());
    }
  }

  const CacheReader& cache_;
  const ViewerOptions& options_;
  bool panels_shown_ = true;
  Window window_;
  ViewState state_;
  Panels panels_;
  Playback playback_;
  Navigation navigation_;
  FrameLoop frames_;
  PictureTexture picture_, overlay_;

  uint64_t function_version_ = 1;
  uint64_t request_ = 0;                            // number of the newest request
  ImageSize picture_size_{0, 0}, data_size_{0, 0};  // of the newest request
  std::optional<ShownFrame> shown_;
  bool was_moving_ = false, dragging_ = false;
  bool save_requested_ = false, copy_requested_ = false;
  std::string message_;
};

}  // namespace

void runViewer(const CacheReader& cache, const ViewerOptions& options, const Progress& stopped) {
  Viewer(cache, options).run(stopped);
}

}  // namespace curvisplat
