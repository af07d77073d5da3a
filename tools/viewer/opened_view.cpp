#include "tools/viewer/opened_view.h"

#include <fmt/format.h>
#include <imgui.h>

#include <exception>
#include <string_view>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"
#include "tools/view/background_jobs.h"
#include "tools/view/saved_views.h"
#include "tools/window/reports.h"
#include "tools/window/widgets.h"

namespace curvisplat {

bool JobDisplay::draw(const BackgroundJob& job, const std::string& name, const std::string& note) {
  const float unit = ImGui::GetFontSize();
  ImGui::SetNextWindowPos(
      {static_cast<float>(picture_.x) + unit, static_cast<float>(picture_.y) + unit + below_});
  ImGui::SetNextWindowSize({26 * unit, 0});
  ImGui::Begin(name.c_str(), nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_AlwaysAutoResize);
  window_.coverCurrent();
  ImGui::TextWrapped("%s", job.title().c_str());
  if (!note.empty()) ImGui::TextDisabled("%s", note.c_str());
  // Dear ImGui's yellow leaves white letters unread.
  ImGui::PushStyleColor(ImGuiCol_PlotHistogram, ImGui::GetStyleColorVec4(ImGuiCol_ButtonActive));
  ImGui::ProgressBar(job.part(), {-1, 0}, job.phase().c_str());
  ImGui::PopStyleColor();
  nameWidget(name);
  const bool stops = ImGui::Button("Stop");
  nameWidget("stop " + name);
  below_ += ImGui::GetWindowSize().y + 0.5f * unit;
  ImGui::End();
  return stops;
}

namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxTitle = 60;

}  // namespace

/// A view of a picture of this size as the thread that opens prepares it.
struct OpenedView::Preparation {
  ViewerOptions options;
  ImageSize picture;
  std::shared_ptr<const PreparedView> prepared;  // once the thread has ended

  void prepare(const fs::path& cache) {
    CacheReader with_scalar = CacheReader::ofScalar(cache, wantedScalar(options));
    prepared = std::make_shared<const PreparedView>(prepareView(std::move(with_scalar), options, picture));
  }
};

OpenedView::OpenedView(const ViewerOptions& options, const ViewSurroundings& surroundings)
    : options_(options), surroundings_(surroundings) {}

OpenedView::~OpenedView() {
  opening_.reset();
  view_.reset();
  retired_ = {};
  FurtherScalarList::waitForThreads();
}

void OpenedView::show(CacheReader cache) {
  const fs::path path = fs::absolute(cache.wholePath());
  show(prepareView(std::move(cache), options_, surroundings_.picture_size()), options_, {path});
}

void OpenedView::show(const PreparedView& prepared, const ViewerOptions& options,
                      const std::vector<fs::path>& files) {
  if (view_) view_->remember();
  std::promise<void> before_has_ended;
  auto view = std::make_unique<CacheView>(prepared, options, surroundings_.window, surroundings_.reports,
                                          surroundings_.dialog, before_has_ended.get_future().share());
  if (options.carried && view_) view->takePictureOf(*view_);
  const auto preview = view_ ? view_->preview() : std::nullopt;
  const fs::path& whole = options.preview ? options.preview->whole : prepared.cache.wholePath();
  if (view_ && (options.carried || (preview && preview->whole == whole))) view->takeRequestsOf(*view_);
  retire(std::exchange(view_, std::move(view)), std::move(before_has_ended));
  surroundings_.window.setTitle(fmt::format("{} - curvisplat", files.front().filename().string()));
  std::vector<std::string> names;
  for (const fs::path& file : files) names.push_back(fs::absolute(file).string());
  surroundings_.settings.opened(std::move(names));
  surroundings_.reports.settle(About::kOpening);
}

/// Ends a view on another thread: what it reads and draws is stopped, but not at once.
void OpenedView::retire(std::unique_ptr<CacheView> view, std::promise<void> has_ended) {
  if (!view) return has_ended.set_value();
  view->releasePictures();
  auto before = std::exchange(retired_, {});  // in a row, so that one at most is kept
  retired_ = std::async(std::launch::async, [view = std::move(view), has_ended = std::move(has_ended),
                                             before = std::move(before)]() mutable {
    nameThisThread("ending a view");
    before = {};
    view.reset();
    has_ended.set_value();
  });
}

void OpenedView::open(const std::vector<fs::path>& files) {
  opening_.reset();              // the one before is given up
  if (view_) view_->remember();  // what is opened may be what is shown
  opening_files_ = files;
  opens_command_line_ = files == options_.files;
  adds_to_.reset();
  preparation_ =
      std::make_shared<Preparation>(Preparation{viewOptions(), surroundings_.picture_size(), nullptr});
  std::string names;
  for (const fs::path& file : files) names += fmt::format(" {}", file.filename().string());
  if (names.size() > kMaxTitle)
    names = fmt::format("{} ... ({} files)", names.substr(0, kMaxTitle), files.size());
  opening_ = std::make_unique<Opening>(
      "opening" + names,
      [to_cache = options_.conversion.to_cache, files, of = preparation_](Progress& progress,
                                                                          const OpeningEvents& events) {
        OpeningEvents with_views = events;
        with_views.preview = [&](Preview preview) {
          Preparation own = *of;
          own.options.preview = preview;
          try {
            own.prepare(preview.cache);
          } catch (const Interrupted&) {
            throw;
          } catch (const Error&) {
            return;  // of the whole it will be said
          }
          preview.view = own.prepared;
          events.preview(std::move(preview));
        };
        const fs::path cache = to_cache(files, progress, with_views);
        of->prepare(cache);
        return cache;
      },
      Window::wake);
}

/// Shows a scalar that the shown cache lacks: the whole cache has it, or it is added to that from the sources.
void OpenedView::add(const WantedScalar& wanted) {
  const std::string& scalar = wanted.name;
  adds_to_ = wanted;
  preparation_ =
      std::make_shared<Preparation>(Preparation{viewOptions(), surroundings_.picture_size(), nullptr});
  preparation_->options.scalar = wanted.isShown() ? scalar : view_->scalar();
  preparation_->options.preview = view_->preview();
  const bool is_there = view_->hasElsewhere(scalar);
  opening_ = std::make_unique<Opening>(
      (is_there ? "opening " : "adding ") + scalar,
      [add = options_.conversion.add_scalar, is_there, scalar, cache = view_->wholePath(),
       files = view_->sources(), of = preparation_](Progress& progress, const OpeningEvents&) {
        if (!is_there) add(cache, files, scalar, progress);
        of->prepare(cache);
        return cache;
      },
      Window::wake);
}

/// The options of a view of what is opened now.
ViewerOptions OpenedView::viewOptions() const {
  ViewerOptions options;
  if ((!view_ || view_->preview()) && opens_command_line_) options = options_;
  options.backend = options_.backend;
  options.target_s = options_.target_s;
  options.memory_bytes = options_.memory_bytes;
  options.conversion = options_.conversion;
  options.faces = options_.faces;
  options.encodes_movies = options_.encodes_movies;
  if (view_) options.dark = view_->isDark();
  return options;
}

void OpenedView::update() {
  const bool is_busy = opening_ != nullptr;
  if (view_)
    if (const auto scalar = view_->takeWantedScalar(is_busy)) add(*scalar);
  takeOpened();
}

void OpenedView::takeOpened() {
  if (!opening_) return;
  for (const std::string& text : opening_->takeMessages()) surroundings_.reports.say(inWindowsWords(text));
  const bool is_done = opening_->isDone();
  if (auto preview = opening_->takePreview(); preview && !is_done) showPreview(*preview);
  if (is_done) takeWhole();
}

void OpenedView::takeWhole() {
  const std::unique_ptr<Opening> done = std::move(opening_);
  const std::shared_ptr<Preparation> preparation = std::move(preparation_);
  try {
    const fs::path cache = done->get();
    ViewerOptions options = viewOptions();
    if (adds_to_) {
      options.grid_files = view_->gridFiles();
      options.carried = view_->carriedTo(*preparation->prepared);
      if (adds_to_->isShown()) options.scalar = adds_to_->name;
      options.preview = view_->preview();
      show(*preparation->prepared, options,
           options.grid_files.empty() ? std::vector{cache} : options.grid_files);
      if (!adds_to_->isShown()) view_->useScalar(*adds_to_);
      return;
    }
    const bool is_kept = opening_files_.size() > 1 || opening_files_.front() != cache;
    if (is_kept) options.grid_files = opening_files_;
    const auto preview = view_ ? view_->preview() : std::nullopt;
    const bool follows_preview = preview && preview->whole == cache;
    // What the user changed in a preview is kept, and so it is where an open cache is opened again.
    if (follows_preview || (view_ && view_->isOf(preparation->prepared->cache)))
      options.carried = view_->carriedTo(*preparation->prepared);
    if (options.carried) options.scalar.reset();  // the user has chosen since
    show(*preparation->prepared, options, opening_files_);
  } catch (const Interrupted&) {
  } catch (const Error& error) {
    surroundings_.reports.report(error, About::kOpening);
    // Who looks at a preview by now is not disturbed.
    if (!adds_to_ && !(view_ && view_->preview()))
      surroundings_.dialog.openAgain(opening_files_, inWindowsWords(error.what()));
  } catch (const std::exception& error) {  // a lack of memory, too, ends the opening only
    surroundings_.reports.report(error, About::kOpening);
  }
}

/// A coarse cache of what is being opened, until it is complete; it may follow a coarser one.
void OpenedView::showPreview(const Preview& preview) {
  try {
    ViewerOptions options = viewOptions();
    options.grid_files = opening_files_;
    options.preview = preview;
    options.preview->view.reset();
    if (view_ && view_->preview() && view_->preview()->whole == preview.whole)
      options.carried = view_->carriedTo(*preview.view);
    if (options.carried) options.scalar.reset();
    show(*preview.view, options, opening_files_);
    surroundings_.reports.say(fmt::format("A preview of {}; the whole follows.", preview.what));
  } catch (const std::exception& error) {
    surroundings_.reports.say(fmt::format("no preview: {}", error.what()));
  }
}

void OpenedView::drawOpening(JobDisplay& display) {
  if (!opening_) return;
  const bool shows_preview = view_ && view_->preview();
  const std::string note =
      shows_preview && !adds_to_ ? "what is shown is a preview: " + view_->preview()->what : "";
  if (!display.draw(opening_->job(), "opening", note)) return;
  opening_.reset();
  if (shows_preview)
    surroundings_.reports.say(
        fmt::format("Stopped. What is shown is a preview of {}.", view_->preview()->what));
}

}  // namespace curvisplat
