#include "tools/viewer/cache_view.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <fmt/format.h>
#include <imgui.h>

#include <cmath>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/message.h"
#include "tools/viewer/first_view.h"
#include "tools/viewer/picture_layout.h"
#include "tools/viewer/state_files.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr double kIdleWaitSeconds = 0.5;
constexpr double kMovingWaitSeconds = 0.03;  // while flying, and until the camera is at rest

double clockSeconds() {
  return glfwGetTime();
}

bool same(ImageSize a, ImageSize b) {
  return a.width == b.width && a.height == b.height;
}

ImageSize pixelsOf(const Rectangle& place, const Window& window) {
  const auto pixels = [&](double units) {
    return std::max(1, static_cast<int>(std::lround(window.pixelScale() * units)));
  };
  return window.pixels().width > 0 ? ImageSize{pixels(place.width), pixels(place.height)} : ImageSize{0, 0};
}

/// The files that can have further scalars; none of a preview or of a series, to which none can be added.
std::vector<fs::path> sourcesFor(const CacheReader& cache, const ViewerOptions& options) {
  if (options.preview || cache.series().steps.size() > 1 || !options.conversion.sources_of) return {};
  if (!options.grid_files.empty()) return options.grid_files;
  return options.conversion.sources_of(cache.seriesManifest(), cache.cachePath());
}

}  // namespace

CacheView::CacheView(CacheReader cache, const ViewerOptions& options, Window& window, Toasts& toasts,
                     FileDialog& dialog, const WindowLayout& layout)
    : cache_(std::move(cache)),
      target_s_(options.target_s),
      faces_at_(options.faces_at),
      preview_(options.preview),
      grid_files_(options.grid_files),
      window_(window),
      toasts_(toasts),
      dialog_(dialog),
      state_(openingState(options, pixelsOf(layout.picture, window))),
      first_function_(state_.function),
      first_state_(toJson(state_)),
      history_(options.carried ? options.carried->history : History(state_)),
      panels_(cache_),
      playback_(cache_.series().steps.size()),
      backend_(options.backend),
      picture_(window.gl()),
      overlay_(window.gl()),
      views_(savedViewsOf(whole())),
      further_(options.conversion, cache_.cachePath(), sourcesFor(cache_, options), Window::wake),
      probe_(cache_) {
  frames_.emplace(cache_, backend_, Window::wake);
  playback_.goTo(cache_.step());
  navigation_.setBounds(state_.scale * manifest().lower, state_.scale * manifest().upper);
}

ViewState CacheView::openingState(const ViewerOptions& options, ImageSize picture) {
  if (options.carried) {
    ViewState state = options.carried->state;
    if (options.scalar && *options.scalar != state.variable)
      chooseVariable(state, cache_, *options.scalar);
    else if (state.function.isAutomatic())
      state.function = automaticFunction(cache_, state.variable);
    return state;
  }
  ViewState state = firstViewOf(cache_, options.scalar.value_or(""), picture);
  if (options.state) {
    state = viewStateFromJson(readTextFile(*options.state), *options.state, manifest());
  } else if (const auto remembered = rememberedStateOf(whole()); remembered && fs::exists(*remembered)) {
    try {
      ViewState found = viewStateFromJson(readTextFile(*remembered), *remembered, manifest());
      loadSurfaces(found);
      state = std::move(found);
    } catch (const Error& error) {
      printMessage("warning: {}; using the initial view", error.what());
    }
  }
  if (options.scalar && *options.scalar != state.variable) chooseVariable(state, cache_, *options.scalar);
  if (options.memory_bytes) state.memory_bytes = *options.memory_bytes;
  if (options.scene) takeScene(*options.scene, options, state);
  loadSurfaces(state);
  return state;
}

/// Surfaces and slices of the command line take the place of those of the state.
void CacheView::takeScene(const SurfaceScene& scene, const ViewerOptions& options, ViewState& state) const {
  state.surfaces.clear();
  for (size_t n = 0; n < scene.surfaces.size(); ++n)
    state.surfaces.push_back({fs::absolute(options.surface_files.at(n)), scene.surfaces[n].colour,
                              scene.surfaces[n].mesh, scene.surfaces[n].opacity.factor});
  state.faces.clear();
  for (size_t n = 0; n < scene.grid_surfaces.size(); ++n)
    state.faces.push_back({options.face_names.at(n), scene.grid_surfaces[n]});
  state.faces_by = options.faces_by;
  state.isovalues = scene.isovalues;
  state.iso_opacity = scene.iso_opacity;
  state.slices = scene.slices;
  state.slice_opacity = {scene.slice_opacity, scene.slices_by_function};
  state.volume = scene.volume;
}

void CacheView::say(const std::string& text, bool is_error) {
  toasts_.add(text, clockSeconds(), is_error);
}

void CacheView::draw(const WindowLayout& layout) {
  takeFrame();
  react(layout);
  const ImageSize size = pixelsOf(layout.picture, window_);
  if (size.width > 0) {
    const bool moving = navigation_.isMoving() || dragging_ || playback_.isPlaying();
    if (changed_ || moving != was_moving_ || !same(size, picture_size_)) {
      picture_size_ = size;
      data_size_ = dataSizeOf(state_, manifest(), size);
      ask(moving);
    }
    showPicture(layout);
    savePictureIfFinal();
    if (std::exchange(copy_requested_, false)) copyCommand(std::exchange(copies_movie_, false));
    probe(layout);
    showPlanesAndMarkers(layout);
    keepHistory();
  }
  drawStatus(layout);
}

void CacheView::takeFrame() {
  if (frames_failed_) return;
  try {
    if (std::optional<ShownFrame> frame = frames_->take()) {
      picture_.set(frame->bytes, frame->image.size);
      shown_ = std::move(frame);
      frame_error_.clear();
      annotate();
    }
    if (std::optional<ShownValues> values = frames_->takeValues()) values_ = std::move(values);
  } catch (const UsageError& error) {
    reportFrame(error);
  } catch (const Error& error) {
    reportFrame(error);
    frames_failed_ = true;
  }
}

/// An error of a picture, such as a disk that is gone: the window and what it shows stay.
void CacheView::reportFrame(const Error& error) {
  if (std::exchange(frame_error_, error.what()) != error.what()) printMessage("warning: {}", error.what());
  say(error.what(), true);
}

/// The loop has ended with an error: what is asked now is tried by a new one, whose requests are counted anew.
void CacheView::restartFrames() {
  frames_.emplace(cache_, backend_, Window::wake);
  frames_failed_ = false;
  if (shown_) shown_->request = 0;
  values_asked_for_ = 0;
}

/// Outline and axes are those of the picture that is shown, not of the camera that it will have next.
void CacheView::annotate() {
  if (!same(shown_->options.size, data_size_)) return;  // the window or the bars have changed meanwhile
  const ShownFunctions functions(state_, manifest());
  const AnnotatedScene scene =
      sceneOf(state_, manifest(), functions, shown_->camera, shown_->options, picture_size_);
  overlay_.set(annotationLayer(state_.annotations, scene), picture_size_);
  shown_strip_ = 1 - static_cast<double>(data_size_.width) / picture_size_.width;
}

/// Applies mouse, panels and playback.
void CacheView::react(const WindowLayout& layout) {
  changed_ |= navigation_.update(window_, state_.camera, data_size_);
  if (layout.shows_panels) drawPanels(layout);
  if (isShown()) changed_ |= playback_.tick(clockSeconds());
  dragging_ |= handles_.isDragging();
  navigation_.setBounds(state_.scale * manifest().lower, state_.scale * manifest().upper);
}

void CacheView::drawPanels(const WindowLayout& layout) {
  PanelFacts facts;
  facts.shown = {shown_ ? &shown_->statistics : nullptr, isFinal(), frames_->busy(), frames_->backendName()};
  facts.flies = navigation_.flies();
  facts.playback = &playback_;
  facts.views = views_;
  facts.place = layout.panels;
  FurtherScalars further = further_.known();
  further.is_busy = adds_scalar_;
  facts.further = &further;
  const PanelActions actions = panels_.draw(state_, facts);
  if (actions.step) changed_ |= playback_.goTo(*actions.step);
  dragging_ = actions.dragging;
  changed_ |= actions.changed;
  if (actions.function_changed) ++function_version_;
  for (const Command command : actions.commands) run(command);
  if (actions.looks_for_scalars) further_.look();
  if (actions.add_scalar) wanted_scalar_ = actions.add_scalar;
  if (actions.load_function) dialog_.open(FileDialog::Purpose::kLoadFunction);
  if (actions.save_function) dialog_.open(FileDialog::Purpose::kSaveFunction, "function.json");
  if (actions.save_view) saveView(*actions.save_view);
  if (actions.load_view) loadView(*actions.load_view);
  if (actions.remove_view) {
    std::error_code ignored;
    fs::remove(savedViewOf(whole(), *actions.remove_view), ignored);
    views_ = savedViewsOf(whole());
  }
  if (!actions.error.empty()) say(actions.error, true);
}

void CacheView::ask(bool moving) {
  const ShownFunctions functions(state_, manifest());
  FrameRequest request{functions.scalars(cache_, state_), function_version_, state_.camera,
                       state_.frameOptions(data_size_)};
  request.moving = moving;
  request.step = playback_.step();
  request.next_step = playback_.next();
  request.faces_at = faces_at_;
  if (frames_failed_) restartFrames();
  request.target_s = target_s_.value_or(frames_->drawsInSoftware() ? 0.1 : 0.033);
  request_ = frames_->request(std::move(request));
  was_moving_ = moving;
  changed_ = false;
  rests_ = false;
  values_.reset();
}

void CacheView::run(Command command) {
  const auto toggle = [&](bool& value) {
    value = !value;
    changed_ = true;
  };
  switch (command) {
    case Command::kSavePicture:
      save_to_ = fs::path();
      return;
    case Command::kSavePictureAs:
      return dialog_.open(FileDialog::Purpose::kSavePicture, cache_.cachePath().stem().string() + ".png");
    case Command::kCopyCommand:
    case Command::kCopyMovieCommand:
      copy_requested_ = true;
      copies_movie_ = command == Command::kCopyMovieCommand;
      return;
    case Command::kUndo:
      return restore(history_.undo());
    case Command::kRedo:
      return restore(history_.redo());
    case Command::kResetFunction:
      state_.function = automaticFunction(cache_, state_.variable);
      ++function_version_;
      changed_ = true;
      return;
    case Command::kSaveView:
      return saveView(fmt::format("view {}", views_.size() + 1));
    case Command::kLight:
      return toggle(state_.lit);
    case Command::kDarkBackground:
      return toggle(state_.dark);
    case Command::kScalarBar:
      return toggle(state_.annotations.scalar_bar);
    case Command::kAxes:
      return toggle(state_.annotations.axes);
    case Command::kAxesGrid:
      return toggle(state_.annotations.axes_grid);
    case Command::kOutline:
      return toggle(state_.annotations.outline);
    case Command::kAddClipPlane:
    case Command::kAddSlice: {
      auto& planes = command == Command::kAddSlice ? state_.slices : state_.clip_planes;
      planes.push_back(planeBeforeViewer(manifest(), state_));
      changed_ = true;
      return;
    }
    case Command::kRemoveMarkers:
      state_.markers.clear();
      changed_ = true;
      return;
    case Command::kPlay:
      playback_.toggle();
      changed_ = true;
      return;
    case Command::kNextStep:
    case Command::kPreviousStep:
      changed_ |= playback_.advance(command == Command::kNextStep);
      return;
    default:
      changed_ |= navigation_.run(command, state_.camera, data_size_);
  }
}

bool CacheView::isEnabled(Command command) const {
  switch (command) {
    case Command::kUndo:
      return history_.canUndo();
    case Command::kRedo:
      return history_.canRedo();
    case Command::kPlay:
    case Command::kNextStep:
    case Command::kPreviousStep:
      return playback_.steps() > 1;
    case Command::kAddClipPlane:
      return state_.clip_planes.size() < kMaxClipPlanes;
    case Command::kAddSlice:
      return state_.slices.size() < kMaxSlices;
    case Command::kRemoveMarkers:
      return !state_.markers.empty();
    default:
      return true;
  }
}

bool CacheView::isChecked(Command command) const {
  switch (command) {
    case Command::kLight:
      return state_.lit;
    case Command::kDarkBackground:
      return state_.dark;
    case Command::kScalarBar:
      return state_.annotations.scalar_bar;
    case Command::kAxes:
      return state_.annotations.axes;
    case Command::kAxesGrid:
      return state_.annotations.axes_grid;
    case Command::kOutline:
      return state_.annotations.outline;
    case Command::kOtherProjection:
      return state_.camera.projection == Projection::kPerspective;
    case Command::kFly:
      return navigation_.flies();
    case Command::kPlay:
      return playback_.isPlaying();
    default:
      return false;
  }
}

double CacheView::wait() const {
  if (playback_.isPlaying() && isShown() && playback_.wait(clockSeconds()) <= 0) return 0;
  const bool short_wait =
      navigation_.isMoving() || ImGui::IsAnyItemActive() || playback_.isPlaying() || probe_.busy();
  return short_wait ? kMovingWaitSeconds : kIdleWaitSeconds;
}

/// A state at which the user rests is one to go back to.
void CacheView::keepHistory() {
  if (rests_ || changed_ || was_moving_ || ImGui::IsAnyItemActive()) return;
  rests_ = true;
  history_.record(state_);
}

void CacheView::restore(const ViewState* state) {
  if (!state) return;
  state_ = *state;
  ++function_version_;
  changed_ = true;
}

std::shared_ptr<const CarriedView> CacheView::carried() const {
  if (isUntouchedPreview()) return nullptr;
  return std::make_shared<const CarriedView>(CarriedView{state_, history_});
}

std::optional<std::string> CacheView::takeWantedScalar(bool is_busy) {
  adds_scalar_ = is_busy;
  return std::exchange(wanted_scalar_, std::nullopt);
}

void CacheView::remember() const {
  if (isUntouchedPreview()) return;
  const auto file = rememberedStateOf(whole());
  if (!file) return;
  try {
    writeState(*file, toJson(state_));
  } catch (const Error& error) {
    printMessage("warning: cannot save the view: {}", error.what());
  }
}

}  // namespace curvisplat
