#include "tools/viewer/cache_view.h"

#include <GLFW/glfw3.h>
#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "render/frame/first_picture.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/os.h"
#include "stream/base/text.h"
#include "tools/panels/time_bar.h"
#include "tools/view/first_view.h"
#include "tools/view/picture_layout.h"
#include "tools/view/saved_views.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr double kIdleWaitSeconds = 0.5;
constexpr double kMovingWaitSeconds = 0.03;  // while flying, and until the camera is at rest

double clockSeconds() {
  return glfwGetTime();
}

ImageSize pixelsOf(const Rectangle& place, const Window& window) {
  const auto pixels = [&](double units) {
    return std::max(1, static_cast<int>(std::lround(window.pixelScale() * units)));
  };
  return window.pixels().width > 0 ? ImageSize{pixels(place.width), pixels(place.height)} : ImageSize{0, 0};
}

/// The files that can have further scalars; none of a preview, to which none can be added.
std::vector<fs::path> sourcesFor(const CacheReader& cache, const ViewerOptions& options) {
  if (options.preview || !options.conversion.sources_of) return {};
  if (!options.grid_files.empty()) return options.grid_files;
  return options.conversion.sources_of(cache.seriesManifest(), cache.wholePath());
}

bool hasScalarsOf(const Manifest& manifest, const Manifest& other) {
  return std::ranges::all_of(other.variables,
                             [&](const VariableInfo& one) { return manifest.variable(one.name); });
}

/// [step]: whether the next one has its geometry.
std::vector<bool> joinedSteps(const Series& series) {
  std::vector<bool> joined;
  for (size_t step = 0; step + 1 < series.steps.size(); ++step)
    joined.push_back(series.steps[step].geometry == series.steps[step + 1].geometry);
  return joined;
}

}  // namespace

CacheView::CacheView(const PreparedView& prepared, const ViewerOptions& options, Window& window,
                     Reports& reports, FileDialog& dialog, std::shared_future<void> after)
    : cache_(prepared.cache.atStep(prepared.cache.step())),
      target_s_(options.target_s),
      may_raise_memory_(!options.memory_bytes),
      faces_at_(options.faces.at),
      face_names_(prepared.face_names),
      elsewhere_(prepared.elsewhere),
      preview_(options.preview),
      grid_files_(options.grid_files),
      window_(window),
      reports_(reports),
      dialog_(dialog),
      state_(firstState(prepared, options)),
      first_function_(state_.function),
      first_camera_(prepared.first_camera),
      first_size_(prepared.first_size),
      left_camera_(first_camera_),
      first_state_(options.carried ? "" : toJson(state_)),
      history_(options.carried && options.carried->history ? *options.carried->history : History(state_, {})),
      panels_(cache_),
      playback_(cache_.series().steps.size(), joinedSteps(cache_.series())),
      backend_(options.backend),
      picture_(window.gl()),
      overlay_(window.gl()),
      views_(savedViewsOf(whole())),
      further_(options.conversion, cache_.wholePath(), sourcesFor(cache_, options), Window::wake),
      encodes_movies_(options.encodes_movies),
      probe_(cache_),
      chooser_(cache_, Window::wake) {
  startFrames(std::move(after));
  playback_.goTo(cache_.step());
  setBounds();
  if (options.carried) chooseForSheets();
  if (!prepared.film) return;
  reports_.attempt([&] { takeFilm(*prepared.film); });
  kept_film_ = film_.film();
  if (!options.carried || !options.carried->history) history_ = History(state_, film_);
}

std::string CacheView::name() const {
  const std::vector<std::string>& sources = manifest().sources;
  const std::string& format = manifest().reader;
  const bool is_grid_first = format.starts_with("PLOT3D") || format.starts_with("SU2");
  const bool has_solution = is_grid_first && grid_files_.size() == 2 && sources.size() == 2;
  return (has_solution ? fs::path(sources.back()) : cache_.wholePath()).stem().string();
}

/// Keys show what the clip box leaves.
void CacheView::setBounds() {
  const WorldBox box = leftBy(state_.clip_box, {manifest().lower, manifest().upper});
  navigation_.setBounds(state_.scale * box.lower, state_.scale * box.upper);
}

void CacheView::releasePictures() {
  if (save_to_) say("The picture was not saved, because something else has been opened.");
  if (copy_requested_) say("The command was not copied, because something else has been opened.");
  if (wanted_scalar_)
    say(fmt::format("{} was not {}, because something else has been opened.", wanted_scalar_->name,
                    hasElsewhere(wanted_scalar_->name) ? "shown" : "added"));
  picture_.release();
  overlay_.release();
  for (auto& [number, picture] : film_pictures_) picture.release();
}

void CacheView::takePictureOf(CacheView& before) {
  picture_.swap(before.picture_);
  overlay_.swap(before.overlay_);
  shown_strip_ = before.shown_strip_;
  shown_width_ = before.shown_width_;
}

void CacheView::takeRequestsOf(CacheView& before) {
  save_to_ = std::exchange(before.save_to_, std::nullopt);
  copy_requested_ = std::exchange(before.copy_requested_, std::nullopt);
  wanted_scalar_ = std::exchange(before.wanted_scalar_, std::nullopt);
  if (hasScalarsOf(manifest(), before.manifest())) {
    chooser_.takeQuestionsOf(before.chooser_);
    film_ = before.film_;
  }
  if (before.playback_.steps() == playback_.steps()) playback_ = before.playback_;
}

/// The state that the view before has now, if there is one. Reads only where the user has chosen another
/// scalar since the view was prepared.
ViewState CacheView::firstState(const PreparedView& prepared, const ViewerOptions& options) const {
  if (!options.carried) return prepared.state;
  ViewState state = options.carried->state;
  const bool is_other = options.scalar && *options.scalar != state.variable;
  if (is_other) chooseVariable(state, manifest(), *options.scalar);
  if (!is_other && !state.function.isAutomatic()) return state;
  state.function = chosenAnew(state.function, state.variable == prepared.scalar
                                                  ? prepared.automatic
                                                  : automaticFunction(cache_, state.variable, false));
  state.suitBackground();
  return state;
}

void CacheView::draw(const WindowLayout& layout) {
  reports_.attempt([&] { takeFrame(); }, About::kPicture);
  reports_.attempt([&] { takeFunction(); });
  reports_.attempt([&] { takeSurface(); });
  reports_.attempt([&] { takeIsosurfaces(); });
  reports_.attempt([&] { drawFilmPictures(); });
  changed_ |= state_.annotations.text_size != textSize();
  const ImageSize size = pixelsOf(layout.picture, window_);
  const bool resized = size.width > 0 && !same(size, picture_size_);
  if (resized) fitTo(size);  // before the mouse's movements, which are in its pixels
  react(layout);
  if (size.width > 0) {
    const bool moving = navigation_.isMoving() || dragging_ || playback_.isPlaying() || film_.isPlaying();
    // A button that is pressed and has not moved anything asks for nothing: a click for a value is answered at once.
    if (changed_ || (was_moving_ && !moving) || resized) {
      fitTo(size);  // bars may have come or gone
      reports_.attempt([&] { ask(moving); }, About::kPicture);
    }
    showPicture(layout);
    savePictureIfFinal();
    if (copy_requested_ && !chooser_.busy() && finding_isosurfaces_.empty())
      copyCommand(*std::exchange(copy_requested_, std::nullopt));
    probe(layout);
    showPlanesAndMarkers(layout);
    keepHistory();
  }
  drawStatus(layout);
}

/// Zooms out where bars take more of the width than they did when the view was fitted, and in again when they go, so that
/// what is between the picture's sides stays there. The first view, which nobody has turned, is that of another size's.
void CacheView::fitTo(ImageSize size) {
  const double before = zoomForBars();
  const bool is_resized = !same(size, picture_size_), is_first = isSameView(state_.camera, left_camera_);
  picture_size_ = size;
  takeBars();
  if (is_resized && is_first) {
    state_.camera = firstCamera();
    fitted_width_ = data_size_.width;
  } else if (is_resized) {
    fitted_width_ = data_size_.width / before;
  } else if (zoomForBars() != before) {
    state_.camera = zoomed(state_.camera, zoomForBars() / before);
  }
  if (is_first) left_camera_ = state_.camera;
}

double CacheView::zoomForBars() const {
  return fitted_width_ > 0 ? std::min(1.0, data_size_.width / fitted_width_) : 1;
}

/// Returns the size of the panels' font, in pixels.
double CacheView::textSize() const {
  return std::round(window_.pixelScale() * window_.fontSize());
}

/// The state's camera is one for the bars that it has.
void CacheView::takeBars() {
  state_.annotations.text_size = textSize();
  data_size_ = dataSizeOf(state_, manifest(), picture_size_);
}

void CacheView::takeFrame() {
  if (frames_failed_) return;
  std::optional<ShownFrame> frame;
  try {
    frame = frames_->poll();
    if (std::optional<ShownValues> values = frames_->takeValues()) values_ = std::move(values);
  } catch (const TooLittleMemory& error) {
    if (giveUpTint() || raiseMemory(error)) return;
    giveUpRequest();
    throw;
  } catch (const UsageError&) {  // of this request only
    if (giveUpTint()) return;
    giveUpRequest();
    throw;
  } catch (...) {
    frames_failed_ = true;
    giveUpRequest();
    throw;
  }
  if (!frame) return;
  reports_.settle(About::kPicture);
  if (!frame->on_card &&
      frame->options.background.a < 1) {  // as frameOptions() has it for what lies behind the data
    const ShownFunctions functions(state_, manifest());
    putBehind(frame->image, state_.annotations,
              sceneOf(state_, functions, *frame, frame->image.size, globe_grid_.boxOf(state_, cache_)));
    frame->bytes = bytesOf(frame->image);
  }
  shown_width_ = 1;
  read_bytes_ += frame->statistics.card_read_bytes;
  if (frame->on_card) {
    picture_.show(frame->on_card);
    shown_width_ = ReducedSize::shownWidth(frame->options.size, frame->on_card->size());
  } else {
    picture_.set(frame->bytes, frame->image.size);
  }
  window_.redraw();
  shown_ = std::move(frame);
  annotate();
  reportDamage();
}

/// Draws again without the faces at which the mouse points, if there are any: pointing has no lasting effects.
bool CacheView::giveUpTint() {
  if (pointed_faces_.empty()) return false;
  not_tinted_.insert(std::exchange(pointed_faces_, {}));
  changed_ = true;
  return true;
}

/// Gives pictures more memory, where programs can have so much, and draws again. Returns whether it did: a limit that was
/// given, or set below the usual one, stays.
bool CacheView::raiseMemory(const TooLittleMemory& error) {
  const uint64_t now = state_.memory_bytes, available = os::availableMemory();
  const uint64_t wanted = std::max(error.least_bytes, now + now / 4);
  if (!may_raise_memory_ || now < ViewState::kMemoryBytes || (available > 0 && wanted > available))
    return false;
  state_.memory_bytes = wanted;
  history_.raiseMemory(wanted);
  changed_ = true;
  say(fmt::format("Pictures may take {} of memory now: this one needs more than {}.", byteText(wanted),
                  byteText(now)));
  return true;
}

/// Neither its picture nor its values will come.
void CacheView::giveUpRequest() {
  giveUpSaving();
  clicked_.reset();  // the next picture's pixels may be others
  values_failed_ = true;
  film_.stop();
  if (!playback_.isPlaying()) return;
  playback_.toggle();
  was_moving_ = false;  // that it rests now is no reason to try again
}

/// Gives up saving: the picture will not come.
void CacheView::giveUpSaving() {
  if (std::exchange(save_to_, std::nullopt)) say("The picture was not saved, because it could not be drawn.");
}

/// Reports each damaged brick of a step once.
void CacheView::reportDamage() {
  const BrickFailure* first = nullptr;
  for (const BrickFailure& failure : shown_->statistics.bricks_unreadable)
    if (damaged_.insert({shown_->step, failure.brick}).second && !first) first = &failure;
  if (!first) return;
  const auto number =
      std::ranges::count(damaged_, shown_->step, [](const auto& damaged) { return damaged.first; });
  reports_.report(fmt::format("{} of {} bricks cannot be read; coarser data is drawn there, or none: {}",
                              number, cache_.bricks().size(), first->reason));
}

std::string CacheView::lacks() const {
  const size_t number = shown_ ? shown_->statistics.bricks_unreadable.size() : 0;
  if (number == 0) return {};
  return fmt::format(", without {} damaged brick{}", number, number == 1 ? "" : "s");
}

/// Pictures of compute shaders are shown where they are drawn. Where the window is software's, no card draws as well as the
/// window, and nothing is made for it unless EGL was asked for.
void CacheView::startFrames(std::shared_future<void> after) {
  const bool may_share = backend_ == Backend::kEgl || backend_ == Backend::kAutomatic;
  const bool shares = backend_ == Backend::kEgl || !window_.isSoftware();
  frames_.emplace(cache_, backend_, Window::wake, std::move(after),
                  may_share ? &window_.sharing(shares) : nullptr);
}

/// The loop has ended with an error: what is asked now is tried by a new one, whose requests are counted anew.
void CacheView::restartFrames() {
  startFrames();
  frames_failed_ = false;
  if (shown_) shown_->request = 0;
  values_asked_for_ = 0;
}

/// Outline and axes are those of the picture that is shown, not of the camera that it will have next.
void CacheView::annotate() {
  if (!same(shown_->options.size, data_size_)) return;  // the window or the bars have changed meanwhile
  const ShownFunctions functions(state_, manifest());
  const AnnotatedScene scene =
      sceneOf(state_, functions, *shown_, picture_size_, globe_grid_.boxOf(state_, cache_));
  overlay_.set(annotationLayer(state_.annotations, scene), picture_size_);
  axis_names_ = axisNames(scene);
  window_.redraw();
  shown_strip_ = 1 - static_cast<double>(data_size_.width) / picture_size_.width;
}

/// Applies mouse, panels and playback.
void CacheView::react(const WindowLayout& layout) {
  const bool navigated = navigation_.update(window_, state_.camera, data_size_);
  if (navigated) film_.stop();
  changed_ |= navigated;
  PanelActions actions;
  if (layout.shows_panels) actions = drawPanels(layout);
  if (isSeries()) drawTimeBar(cache_, playback_, layout.time, actions);
  reports_.attempt([&] { apply(actions); });
  reports_.attempt([&] { film_.follow(state_.scale); });  // which panels and saved views may have changed
  if (isShown()) changed_ |= playback_.tick(clockSeconds());
  if (isShown() && film_.tick(clockSeconds()))
    reports_.attempt([&] { showFilm(film_.film()->functionsChange()); });
  dragging_ |= handles_.isDragging();
  setBounds();
}

PanelActions CacheView::drawPanels(const WindowLayout& layout) {
  PanelFacts facts;
  facts.shown = {shown_ ? &shown_->statistics : nullptr, isFinal(), isRefining(), frames_->backendName()};
  facts.flies = navigation_.flies();
  facts.shows_frames = shows_frames_;
  facts.playback = &playback_;
  facts.views = views_;
  facts.faces = &face_names_;
  facts.elsewhere = &elsewhere_;
  facts.place = layout.panels;
  facts.film = &film_;
  facts.film_pictures = [this](uint64_t number) {
    const auto picture = film_pictures_.find(number);
    const bool is_there = picture != film_pictures_.end() && !picture->second.isEmpty();
    return is_there ? picture->second.id() : nullptr;
  };
  const FurtherScalars further = furtherScalars();
  facts.further = &further;
  return panels_.draw(state_, facts);
}

void CacheView::apply(const PanelActions& actions) {
  if (actions.time) goToStep([&](Playback& playback) { return playback.goTo(*actions.time); });
  if (actions.interpolates) changed_ |= playback_.setInterpolates(*actions.interpolates);
  dragging_ = actions.dragging;
  changed_ |= actions.changed;
  if (actions.function_changed) ++function_version_;
  for (const Command command : actions.commands) run(command);
  if (actions.scalar) chooseScalar(*actions.scalar);
  if (actions.opacity_scalar) chooseOpacityScalar(*actions.opacity_scalar);
  if (actions.automatic_function) run(Command::kResetFunction);
  if (actions.automatic_opacities)
    chooser_.ask(state_.opacity_by ? FunctionChooser::Question{FunctionChooser::For::kOpacities,
                                                               state_.opacity_by->variable}
                                   : FunctionChooser::Question{FunctionChooser::For::kSameColours,
                                                               state_.variable, state_.coloursSheets()});
  if (actions.add_faces) addFaces(*actions.add_faces);
  // What is saved has no tint.
  const bool tints = !save_to_ && !actions.add_faces && !not_tinted_.contains(actions.pointed_faces);
  const std::string pointed = tints ? actions.pointed_faces : "";
  changed_ |= pointed != std::exchange(pointed_faces_, pointed);
  if (actions.colour_faces) colourFaces(*actions.colour_faces);
  if (actions.isosurface_scalar)
    findIsosurface(actions.isosurface_scalar->second, actions.isosurface_scalar->first);
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
  apply(actions.film);
  if (actions.function_changed) reports_.settle(About::kFunction);
  if (!actions.error.empty()) reports_.report(actions.error, About::kFunction);
}

void CacheView::ask(bool moving, bool only_final) {
  was_moving_ = moving;
  changed_ = false;  // what cannot be drawn is not tried again before it changes
  rests_ = false;
  const ViewState& drawn = pointed_faces_.empty() ? state_ : state_.withTinted(pointed_faces_);
  const ShownFunctions functions(state_, manifest());
  FrameRequest request{functions.scalars(cache_, state_), function_version_, state_.camera,
                       drawn.frameOptions(data_size_, manifest())};
  request.moving = moving;
  request.only_final = only_final;
  request.step = playback_.step();
  request.part = playback_.position().part;
  request.next = playback_.next();
  request.faces = drawn.faceNames();
  request.faces_at = faces_at_;
  // The processor saves pictures, and puts what lies behind the data there.
  request.may_stay_on_card = !save_to_ && request.options.background.a >= 1;
  if (frames_failed_) restartFrames();
  // With a conversion beside the window, a picture can take more than twice as long as the one before it.
  request.target_s = (preview_ || adds_scalar_ ? 0.5 : 1.0) * target_s_;
  request_ = frames_->request(std::move(request));
  values_.reset();
  values_failed_ = false;
}

double CacheView::wait() const {
  if (playback_.isPlaying() && isShown() && playback_.wait(clockSeconds()) <= 0) return 0;
  const bool short_wait = navigation_.isMoving() || ImGui::IsAnyItemActive() || playback_.isPlaying() ||
                          film_.isPlaying() || probe_.busy() || chooser_.busy() || reading_surface_.valid() ||
                          !finding_isosurfaces_.empty();
  return short_wait ? kMovingWaitSeconds : kIdleWaitSeconds;
}

/// A state at which the user rests is one to go back to.
void CacheView::keepHistory() {
  if (rests_ || changed_ || was_moving_ || ImGui::IsAnyItemActive()) return;
  rests_ = true;
  history_.record(state_, film_);
}

void CacheView::restore(const ViewState& state) {
  chooser_.drop();
  state_ = state;
  takeBars();
  ++function_version_;
  changed_ = true;
}

void CacheView::restore(const History::Entry* entry) {
  if (!entry) return;
  film_.goBackTo(*entry->film);
  restore(entry->state);
}

std::shared_ptr<const CarriedView> CacheView::carriedTo(const PreparedView& next) const {
  if (isUntouchedPreview()) return nullptr;
  if (hasScalarsOf(next.cache.manifest(), manifest()))
    return std::make_shared<const CarriedView>(CarriedView{state_, history_});
  ViewState state = state_;
  leaveOtherScalars(state, next.cache.manifest(), next.scalar);
  return std::make_shared<const CarriedView>(CarriedView{state, std::nullopt});
}

bool CacheView::isOf(const CacheReader& cache) const {
  const auto same_name = [](const VariableInfo& a, const VariableInfo& b) { return a.name == b.name; };
  return cache.cachePath() == cache_.cachePath() &&
         std::ranges::equal(cache.manifest().variables, manifest().variables, same_name);
}

std::optional<WantedScalar> CacheView::takeWantedScalar(bool is_busy) {
  adds_scalar_ = is_busy;
  if (is_busy) return std::nullopt;
  std::optional<WantedScalar> wanted = std::exchange(wanted_scalar_, std::nullopt);
  const auto is_wanted = [&](const VariableInfo& one) { return one.name == wanted->name; };
  if (!wanted || std::ranges::none_of(manifest().variables, is_wanted)) return wanted;
  reports_.attempt([&] {  // it has been added meanwhile
    wanted->isShown() ? chooseScalar(wanted->name) : useScalar(*wanted);
  });
  return std::nullopt;
}

void CacheView::remember() const {
  rememberFilm();
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
