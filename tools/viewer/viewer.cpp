#include "tools/viewer/viewer.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "render/frame_plan.h"
#include "render/image.h"
#include "stream/error.h"
#include "stream/file.h"
#include "tools/viewer/frame_loop.h"
#include "tools/viewer/navigation.h"
#include "tools/viewer/panels.h"
#include "tools/viewer/picture_texture.h"
#include "tools/viewer/state_files.h"
#include "tools/viewer/view_state.h"
#include "tools/viewer/window.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr double kIdleWait_s = 0.5;
constexpr double kBusyWait_s = 0.05;
constexpr int kFramesAfterInput = 3;  // Dear ImGui settles within them

class Viewer {
 public:
  Viewer(const CacheReader& cache, const ViewerOptions& options)
      : cache_(cache),
        options_(options),
        window_(fmt::format("{} - curvisplat", cache.path().filename().string()), options.size),
        state_(openingState()),
        panels_(cache),
        frames_(cache, options.backend, Window::wake),
        picture_(window_.gl()),
        overlay_(window_.gl()) {
    fmt::print(stderr, "curvisplat: window: OpenGL {}\n", window_.contextName());
    updateBounds();
  }

  void run() {
    int frames_to_settle = kFramesAfterInput;
    while (window_.isOpen()) {
      const bool active = frames_to_settle > 0 || navigation_.isMoving();
      window_.wait(active ? 0.001 : frames_.busy() ? kBusyWait_s : kIdleWait_s);
      frames_to_settle = update() ? kFramesAfterInput : std::max(0, frames_to_settle - 1);
    }
    remember();
  }

 private:
  ViewState openingState() {
    const ImageSize size = pictureSize();
    ViewState state = firstViewOf(cache_.manifest(), size);
    if (options_.state) {
      state = viewStateFromJson(readTextFile(*options_.state), *options_.state, cache_.manifest());
    } else if (const auto remembered = rememberedStateOf(cache_.path());
               remembered && fs::exists(*remembered)) {
      try {
        state = viewStateFromJson(readTextFile(*remembered), *remembered, cache_.manifest());
      } catch (const Error& error) {
        fmt::print(stderr, "curvisplat: warning: {}; the window opens as if for the first time\n",
                   error.what());
      }
    }
    if (options_.scalar && *options_.scalar != state.variable)
      chooseVariable(state, cache_.manifest(), *options_.scalar);
    if (options_.memory_bytes) state.memory_bytes = *options_.memory_bytes;
    return state;
  }

  /// One frame of the window; true if there was anything to react to.
  bool update() {
    window_.beginFrame();
    const ImageSize size = pictureSize();
    bool reacted = takeFrame();
    if (size.width > 0 && size.height > 0) {
      const bool changed = react(size);
      reacted |= changed;
      const bool moving = navigation_.isMoving() || dragging_;
      if (changed || moving != was_moving_ || size.width != asked_.width || size.height != asked_.height) {
        ask(size, moving);
        annotate(size);
        reacted = true;
      }
      showPicture();
      savePictureIfFinal();
    }
    window_.endFrame(glm::vec3(state_.background()));
    return std::exchange(pressed_, false) || reacted || ImGui::IsAnyItemActive();
  }

  /// Of the picture beside the panels, in pixels.
  ImageSize pictureSize() const {
    ImageSize size = window_.pixels();
    const int panel = static_cast<int>(std::lround(window_.pixelScale() * panelWidth()));
    if (size.width > 0) size.width = std::max(1, size.width - panel);  // a strip beside them is always left
    return size;
  }
  float panelWidth() const { return panels_shown_ ? Panels::width() : 0; }

  /// Panels, keys and mouse; true if the picture is to change.
  bool react(ImageSize size) {
    PanelFacts facts;
    facts.statistics = shown_ ? &shown_->statistics : nullptr;
    facts.is_final = shown_ && shown_->is_final && shown_->request == request_;
    facts.busy = frames_.busy();
    facts.flies = navigation_.flies();
    facts.backend = frames_.backendName();
    facts.said = said_;
    PanelWishes wishes;
    window_.setPictureLeft(panelWidth());
    if (panels_shown_) wishes = panels_.draw(state_, variable(), facts);
    dragging_ = wishes.dragging;
    bool changed = wishes.changed;
    updateBounds();
    changed |= navigation_.update(window_, state_.camera, size);
    for (const Window::Key& key : window_.takeKeys()) changed |= press(key, size);
    if (wishes.reset_camera) changed |= press({GLFW_KEY_R}, size);
    if (wishes.other_projection) changed |= press({GLFW_KEY_O}, size);
    if (wishes.toggle_flight) changed |= press({GLFW_KEY_F}, size);
    if (wishes.save_picture) press({GLFW_KEY_P}, size);
    if (wishes.copy_command) press({GLFW_KEY_C}, size);
    if (wishes.function_changed) ++function_version_;
    return changed;
  }

  bool press(const Window::Key& key, ImageSize size) {
    pressed_ = true;
    switch (key.code) {
      case GLFW_KEY_P:
        save_wanted_ = true;
        said_ = "the picture is saved as soon as it is final";
        return false;
      case GLFW_KEY_C:
        copyCommand(size);
        return false;
      case GLFW_KEY_H:
        panels_shown_ = !panels_shown_;
        return false;
      case GLFW_KEY_ESCAPE:
        window_.close();
        return false;
      default:
        return navigation_.press(key, state_.camera, size);
    }
  }

  size_t variable() const { return cache_.variableNamed(state_.variable); }

  void updateBounds() {
    const Manifest& manifest = cache_.manifest();
    navigation_.setBounds(state_.scale * manifest.lower, state_.scale * manifest.upper);
  }

  void ask(ImageSize size, bool moving) {
    FrameRequest request{variable(), function_version_, state_.function.function(), state_.camera,
                         state_.frameOptions(size)};
    request.moving = moving;
    request.target_s = options_.target_s.value_or(software_ ? 0.1 : 0.033);
    request_ = frames_.request(std::move(request));
    was_moving_ = moving;
    asked_ = size;
  }

  bool takeFrame() {
    std::optional<ShownFrame> frame;
    try {
      frame = frames_.take();
    } catch (const UsageError& error) {
      if (said_ != error.what()) fmt::print(stderr, "curvisplat: warning: {}\n", error.what());
      said_ = error.what();
      return true;
    }
    if (!frame) return false;
    software_ = !frames_.backendName().starts_with("EGL") ||
                frames_.backendName().find("llvmpipe") != std::string::npos;
    picture_.set(frame->image);
    shown_ = std::move(frame);
    return true;
  }

  AnnotatedScene sceneFor(const TransferFunction& function, ImageSize size) const {
    const Manifest& manifest = cache_.manifest();
    const VariableInfo& info = manifest.variables[variable()];
    return {screenViewOf(manifest, state_.camera, state_.frameOptions(size), size),
            function,
            scalarTitle(info.name, info.unit),
            manifest.lower,
            manifest.upper,
            state_.background()};
  }

  void annotate(ImageSize size) {
    const TransferFunction function = state_.function.function();
    overlay_.set(annotationLayer(state_.annotations, sceneFor(function, size)), size);
  }

  void showPicture() {
    ImDrawList* const list = ImGui::GetBackgroundDrawList();
    const ImVec2 lower(panelWidth(), 0), upper = ImGui::GetIO().DisplaySize;
    if (!picture_.isEmpty()) list->AddImage(picture_.id(), lower, upper);
    if (!overlay_.isEmpty()) list->AddImage(overlay_.id(), lower, upper);
  }

  void savePictureIfFinal() {
    if (!save_wanted_ || !shown_ || !shown_->is_final || shown_->request != request_) return;
    save_wanted_ = false;
    fs::path file;
    for (int number = 1; file.empty() || fs::exists(file); ++number)
      file = fmt::format("{}_{:04}.png", cache_.path().stem().string(), number);
    try {
      Image image = shown_->image;
      const TransferFunction function = state_.function.function();
      curvisplat::annotate(image, state_.annotations, sceneFor(function, image.size));
      writeImage(image, file);
      said_ = "saved " + fs::absolute(file).string();
    } catch (const Error& error) {
      said_ = error.what();
    }
  }

  void copyCommand(ImageSize size) {
    try {
      fs::path function_file;
      if (state_.function.preset().empty())
        function_file = keepFunction(toParaViewPreset(state_.function.definition()));
      const std::string command = renderCommand(state_, fs::absolute(cache_.path()), size, function_file);
      window_.setClipboard(command);
      fmt::print("{}\n", command);
      std::fflush(stdout);
      said_ = "copied: " + command;
    } catch (const Error& error) {
      said_ = error.what();
    }
  }

  void remember() const {
    const auto file = rememberedStateOf(cache_.path());
    if (!file) return;
    try {
      writeState(*file, toJson(state_));
    } catch (const Error& error) {
      fmt::print(stderr, "curvisplat: warning: the view is not remembered: {}\n", error.what());
    }
  }

  const CacheReader& cache_;
  const ViewerOptions& options_;
  bool panels_shown_ = true;
  Window window_;
  ViewState state_;
  Panels panels_;
  Navigation navigation_;
  FrameLoop frames_;
  PictureTexture picture_, overlay_;

  uint64_t function_version_ = 1;
  uint64_t request_ = 0;  // the newest
  ImageSize asked_{0, 0};
  std::optional<ShownFrame> shown_;
  bool was_moving_ = false, dragging_ = false;
  bool save_wanted_ = false;
  bool pressed_ = false;  // a key, since the last frame
  bool software_ = true;
  std::string said_;
};

}  // namespace

void runViewer(const CacheReader& cache, const ViewerOptions& options) {
  Viewer(cache, options).run();
}

}  // namespace curvisplat
