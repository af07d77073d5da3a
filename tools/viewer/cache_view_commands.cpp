// The commands of a view, by menu or key: what each does, when it can, and when the menu marks it.
#include <GLFW/glfw3.h>
#include <fmt/format.h>

#include <chrono>
#include <future>
#include <utility>

#include "stream/base/threads.h"
#include "stream/cache/value_histogram.h"
#include "tools/view/edited_function.h"
#include "tools/view/first_view.h"
#include "tools/viewer/cache_view.h"
#include "tools/viewer/navigation.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxIsosurfaces = 16;

/// Ends the window's wait.
struct WakeAtEnd {
  ~WakeAtEnd() { Window::wake(); }
};

}  // namespace

std::span<const CommandAction<CacheView>> CacheView::actions() {
  using View = CacheView;
  constexpr auto kHasSteps = [](const View& v) { return v.playback_.steps() > 1; };
  constexpr auto kHasFilm = [](const View& v) { return v.film_.film() != nullptr; };
  static constexpr CommandAction<View> kActions[] = {
      {Command::kSavePicture, [](View& v) { v.saveTo({}); }},
      {Command::kSavePictureAs,
       [](View& v) { v.dialog_.openToSavePicture(v.name() + ".png", v.picture_size_, v.textSize()); }},
      {Command::kSaveTurnMovie, [](View& v) { v.saveMovieOf(MovieKind::kOneTurn); }},
      {Command::kSaveStepsMovie, [](View& v) { v.saveMovieOf(MovieKind::kAllSteps); }, kHasSteps},
      {Command::kSaveFilmMovie, [](View& v) { v.saveMovieOf(MovieKind::kFilm); }, kHasFilm},
      {Command::kCopyCommand, [](View& v) { v.copyLater(MovieKind::kOnePicture); }},
      {Command::kCopyMovieCommand, [](View& v) { v.copyLater(MovieKind::kOneTurn); }},
      {Command::kCopyFilmCommand, [](View& v) { v.copyLater(MovieKind::kFilm); }, kHasFilm},
      {Command::kUndo,
       [](View& v) {
         v.history_.record(v.state_, v.film_);  // a movement that has not come to rest is undone as a whole
         v.restore(v.history_.undo());
       },
       [](const View& v) { return v.history_.canUndo() || !v.rests_; }},
      {Command::kRedo, [](View& v) { v.restore(v.history_.redo()); },
       [](const View& v) { return v.history_.canRedo(); }},
      {Command::kResetFunction,
       [](View& v) {
         v.chooser_.ask({FunctionChooser::For::kSameScalar, v.state_.variable, v.state_.coloursSheets()});
       }},
      {Command::kSaveView, [](View& v) { v.saveView(fmt::format("view {}", v.views_.size() + 1)); }},
      {Command::kFirstView, [](View& v) { v.lookAsAtFirst(); }},
      {Command::kOtherProjection, [](View& v) { v.moveCamera(Command::kOtherProjection); }, nullptr,
       [](const View& v) { return v.state_.camera.projection == Projection::kPerspective; }},
      {Command::kFly, [](View& v) { v.moveCamera(Command::kFly); }, nullptr,
       [](const View& v) { return v.navigation_.flies(); }},
      {Command::kLight, [](View& v) { v.toggle(v.state_.lit); }, nullptr,
       [](const View& v) { return v.state_.lit; }},
      {Command::kDarkBackground,
       [](View& v) {
         v.toggle(v.state_.dark);
         v.state_.suitBackground();
         ++v.function_version_;
       },
       nullptr, [](const View& v) { return v.state_.dark; }},
      {Command::kScalarBar, [](View& v) { v.toggle(v.state_.annotations.scalar_bar); }, nullptr,
       [](const View& v) { return v.state_.annotations.scalar_bar; }},
      {Command::kAxes, [](View& v) { v.toggle(v.state_.annotations.axes); }, nullptr,
       [](const View& v) { return v.state_.annotations.axes; }},
      {Command::kAxesGrid, [](View& v) { v.toggle(v.state_.annotations.axes_grid); }, nullptr,
       [](const View& v) { return v.state_.annotations.axes_grid; }},
      {Command::kOutline, [](View& v) { v.toggle(v.state_.annotations.outline); }, nullptr,
       [](const View& v) { return v.state_.annotations.outline; }},
      {Command::kPlaneFrames, [](View& v) { v.shows_frames_ = !v.shows_frames_; }, nullptr,
       [](const View& v) { return v.shows_frames_; }},
      {Command::kAddClipPlane, [](View& v) { v.addPlaneTo(v.state_.clip_planes); },
       [](const View& v) { return v.state_.clip_planes.size() < kMaxClipPlanes; }},
      {Command::kAddSlice, [](View& v) { v.addPlaneTo(v.state_.slices); },
       [](const View& v) { return v.state_.slices.size() < kMaxSlices; }},
      {Command::kAddIsosurface, [](View& v) { v.findIsosurface(v.state_.opacityScalar()); },
       [](const View& v) {
         return v.state_.isosurfaces.size() + v.finding_isosurfaces_.size() < kMaxIsosurfaces;
       }},
      {Command::kAddSurfaceFile, [](View& v) { v.dialog_.open(FileDialog::Purpose::kOpenSurface); }},
      {Command::kRemoveMarkers,
       [](View& v) {
         v.state_.markers.clear();
         v.changed_ = true;
       },
       [](const View& v) { return !v.state_.markers.empty(); }},
      {Command::kPlay,
       [](View& v) {
         v.film_.stop();
         v.playback_.toggle();
         v.changed_ = true;
       },
       kHasSteps, [](const View& v) { return v.playback_.isPlaying(); }},
      {Command::kNextStep, [](View& v) { v.goToStep([](Playback& p) { return p.advance(true); }); },
       kHasSteps},
      {Command::kPreviousStep, [](View& v) { v.goToStep([](Playback& p) { return p.advance(false); }); },
       kHasSteps},
      {Command::kFirstStep, [](View& v) { v.goToStep([](Playback& p) { return p.goTo(0); }); }, kHasSteps},
      {Command::kLastStep, [](View& v) { v.goToStep([](Playback& p) { return p.goTo(p.steps() - 1); }); },
       kHasSteps},
  };
  return kActions;
}

void CacheView::run(Command command) {
  const auto* const action = actionOf(actions(), command);
  action ? action->run(*this) : moveCamera(command);
}

bool CacheView::isEnabled(Command command) const {
  const auto* const action = actionOf(actions(), command);
  return !action || !action->is_enabled || action->is_enabled(*this);
}

bool CacheView::isChecked(Command command) const {
  const auto* const action = actionOf(actions(), command);
  return action && action->is_checked && action->is_checked(*this);
}

void CacheView::toggle(bool& value) {
  value = !value;
  changed_ = true;
}

/// Goes to a step that the user chose. It is to be looked at: playing ends.
void CacheView::goToStep(const std::function<bool(Playback&)>& move) {
  changed_ |= playback_.isPlaying();
  playback_.stop();
  changed_ |= move(playback_);
}

void CacheView::addPlaneTo(std::vector<ListedPlane>& planes) {
  planes.push_back({planeBeforeViewer(manifest(), state_)});
  chooseForSheets();
  changed_ = true;
}

/// Slices and faces show values that the volume hides: a function that is chosen from the data gets colours for them.
void CacheView::chooseForSheets() {
  if (state_.coloursSheets() && state_.function.isAutomatic())
    chooser_.ask({FunctionChooser::For::kSameScalar, state_.variable, true});
}

/// Finds a value of a scalar whose isosurface lies in what is seen, on another thread: it reads the histogram.
void CacheView::findIsosurface(const std::string& scalar, std::optional<uint64_t> replaced) {
  finding_isosurfaces_.push_back(std::async(
      std::launch::async, [cache = cache_.at(playback_.position()), state = state_, scalar, replaced] {
        nameThisThread("isosurface");
        const WakeAtEnd at_the_end;
        return FoundIsosurface{{scalar, firstIsovalue(cache, state, scalar)}, replaced};
      }));
}

void CacheView::takeIsosurfaces() {
  if (finding_isosurfaces_.empty() ||
      finding_isosurfaces_.front().wait_for(std::chrono::seconds(0)) != std::future_status::ready)
    return;
  std::future<FoundIsosurface> done = std::move(finding_isosurfaces_.front());
  finding_isosurfaces_.pop_front();
  const auto [surface, replaced] = done.get();
  std::vector<Isosurface>& list = state_.isosurfaces;
  if (!replaced) {
    list.push_back(surface);
  } else {
    const auto found = std::ranges::find(list, *replaced, &Isosurface::id);
    if (found == list.end()) return;  // it was removed meanwhile
    found->scalar = surface.scalar;
    found->value = surface.value;
  }
  changed_ = true;
}

/// The view before anything was turned, in this window or in one before it, for the picture's size.
Camera CacheView::firstCamera() const {
  constexpr double kAsWide = 0.97;  // bars with text of the panels' size are a little wider or narrower
  const auto aspect = [](ImageSize of) { return static_cast<double>(of.width) / of.height; };
  const bool fits = aspect(data_size_) > kAsWide * aspect(first_size_);
  const Camera camera = fits ? first_camera_ : holding(first_camera_, first_size_, data_size_);
  if (state_.scale == glm::dvec3(1.0)) return camera;
  return refitted(camera, state_.scale * manifest().lower, state_.scale * manifest().upper, data_size_);
}

/// Looks as at the beginning, and flies no more.
void CacheView::lookAsAtFirst() {
  state_.camera = left_camera_ = firstCamera();
  fitted_width_ = data_size_.width;
  navigation_.endFlight();
  film_.stop();
  changed_ = true;
}

void CacheView::moveCamera(Command command) {
  changed_ |= navigation_.run(command, state_.camera, data_size_);
  const bool fits = command >= Command::kFit && command <= Command::kLookIsometric;
  if (fits) fitted_width_ = data_size_.width;
}

}  // namespace curvisplat
