#include "tools/viewer/viewer.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/message.h"
#include "stream/base/thread_name.h"
#include "tools/viewer/cache_view.h"
#include "tools/viewer/further_scalar_list.h"
#include "tools/viewer/menus.h"
#include "tools/viewer/opening.h"
#include "tools/viewer/prepared_view.h"
#include "tools/viewer/reports.h"
#include "tools/viewer/state_files.h"
#include "tools/viewer/widget_places.h"
#include "tools/viewer/window.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

// New pictures and input end a wait early. Longer waits leave the processor to the renderer when both share
// it.
constexpr double kIdleWaitSeconds = 0.5;
constexpr int kFramesAfterInput = 2;  // Dear ImGui needs them to settle
constexpr double kTextStep = 1.125;
constexpr size_t kMaxTitle = 60;

class Viewer {
 public:
  Viewer(std::optional<CacheReader> cache, const ViewerOptions& options)
      : options_(options), settings_(readSettings()), window_("curvisplat", options.size) {
    printMessage("window: OpenGL {}", window_.contextName());
    if (settings_.light_theme) window_.setLightTheme(true);
    if (settings_.text_scale != 1) window_.setTextScale(settings_.text_scale);
    if (cache) {
      const fs::path path = fs::absolute(cache->cachePath());
      show(prepareView(std::move(*cache), options, pictureSize()), options, {path});
    }
    if (!options.files.empty()) open(options.files);
  }

  ~Viewer() {
    opening_.reset();
    view_.reset();
    retired_ = {};
    FurtherScalarList::waitForThreads();
  }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

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
      window_.wait(frames_to_settle > 0 ? 0 : view_ ? view_->wait() : kIdleWaitSeconds);
      frames_to_settle = window_.takeInput() ? kFramesAfterInput : std::max(0, frames_to_settle - 1);
      update();
    }
  }

  void show(const PreparedView& prepared, const ViewerOptions& options, const std::vector<fs::path>& files) {
    if (view_) view_->remember();
    std::promise<void> before_has_ended;
    auto view = std::make_unique<CacheView>(prepared, options, window_, reports_, dialog_,
                                            before_has_ended.get_future().share());
    if (options.carried && view_) view->takePictureOf(*view_);
    const auto preview = view_ ? view_->preview() : std::nullopt;
    if (view_ && (options.carried || (preview && preview->whole == prepared.cache.cachePath())))
      view->takeRequestsOf(*view_);
    retire(std::exchange(view_, std::move(view)), std::move(before_has_ended));
    window_.setTitle(fmt::format("{} - curvisplat", files.front().filename().string()));
    std::vector<std::string> names;
    for (const fs::path& file : files) names.push_back(fs::absolute(file).string());
    settings_.opened(std::move(names));
  }

  /// Ends a view on another thread: what it reads and draws is stopped, but not at once.
  void retire(std::unique_ptr<CacheView> view, std::promise<void> has_ended) {
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

  ImageSize pictureSize() const {
    const Rectangle picture = layout().picture;
    const auto pixels = [this](double units) {
      return std::max(1, static_cast<int>(std::lround(window_.pixelScale() * units)));
    };
    return {pixels(picture.width), pixels(picture.height)};
  }

  /// Of this size; where the view prepares on the thread that opens.
  struct Preparation {
    ViewerOptions options;
    ImageSize picture;
    std::shared_ptr<const PreparedView> prepared;  // once the thread has ended

    void prepare(const fs::path& cache) {
      prepared = std::make_shared<const PreparedView>(prepareView(CacheReader(cache), options, picture));
    }
  };

  /// What was chosen in a dialog or a menu, or dropped: a cache at once, a grid when it is converted.
  void open(const std::vector<fs::path>& files) {
    opening_.reset();              // the one before is given up
    if (view_) view_->remember();  // what is opened may be what is shown
    opening_files_ = files;
    opens_command_line_ = files == options_.files;
    adds_to_.reset();
    preparation_ = std::make_shared<Preparation>(Preparation{viewOptions(), pictureSize(), nullptr});
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

  /// Adds a scalar of the sources to the cache that is shown.
  void add(const std::string& scalar) {
    if (opening_) return;
    adds_to_ = scalar;
    preparation_ = std::make_shared<Preparation>(Preparation{viewOptions(), pictureSize(), nullptr});
    preparation_->options.scalar = scalar;
    opening_ = std::make_unique<Opening>(
        "adding " + scalar,
        [this, scalar, cache = view_->cachePath(), files = view_->sources(), of = preparation_](
            Progress& progress, const OpeningEvents&) {
          options_.conversion.add_scalar(cache, files, scalar, progress);
          of->prepare(cache);
          return cache;
        },
        Window::wake);
  }

  /// The options of a view of what is opened now.
  ViewerOptions viewOptions() const {
    ViewerOptions options;
    if ((!view_ || view_->preview()) && opens_command_line_) options = options_;
    options.backend = options_.backend;
    options.target_s = options_.target_s;
    options.memory_bytes = options_.memory_bytes;
    options.conversion = options_.conversion;
    return options;
  }

  /// Shows what has been opened.
  void takeOpened() {
    if (!opening_) return;
    for (const std::string& text : opening_->takeMessages()) reports_.say(text);
    if (auto files = opening_->takeFiles(); !files.empty()) opening_files_ = std::move(files);
    const bool is_done = opening_->isDone();
    if (auto preview = opening_->takePreview(); preview && !is_done) showPreview(*preview);
    if (!is_done) return;
    const std::unique_ptr<Opening> done = std::move(opening_);
    const std::shared_ptr<Preparation> preparation = std::move(preparation_);
    try {
      const fs::path cache = done->take();
      ViewerOptions options = viewOptions();
      if (adds_to_) {
        options.grid_files = view_->gridFiles();
        options.carried = view_->carried();
        options.scalar = adds_to_;
        return show(*preparation->prepared, options,
                    options.grid_files.empty() ? std::vector{cache} : options.grid_files);
      }
      const bool is_kept = opening_files_.size() > 1 || opening_files_.front() != cache;
      if (is_kept) options.grid_files = opening_files_;
      const auto preview = view_ ? view_->preview() : std::nullopt;
      const bool follows_preview = preview && preview->whole == cache;
      // Of one that is opened again, too, what the user has changed while it opened.
      if (follows_preview || (view_ && view_->isOf(preparation->prepared->cache)))
        options.carried = view_->carried();
      if (options.carried) options.scalar.reset();  // the user has chosen since
      show(*preparation->prepared, options, opening_files_);
    } catch (const Interrupted&) {
    } catch (const std::exception& error) {  // a lack of memory, too, ends the opening only
      reports_.report(error);
    }
  }

  /// A coarse cache of what is being opened, until it is complete.
  void showPreview(const Preview& preview) {
    try {
      ViewerOptions options = viewOptions();
      options.grid_files = opening_files_;
      options.preview = preview;
      options.preview->view.reset();
      show(*preview.view, options, opening_files_);
      reports_.say(fmt::format("A preview of {}; the whole follows.", preview.what));
    } catch (const std::exception& error) {
      reports_.say(fmt::format("no preview: {}", error.what()));
    }
  }

  /// In the corner of the picture, where it hides nothing that is looked at.
  void drawOpening(const Rectangle& picture) {
    if (!opening_) return;
    const float unit = ImGui::GetFontSize();
    ImGui::SetNextWindowPos({static_cast<float>(picture.x) + unit, static_cast<float>(picture.y) + unit});
    ImGui::SetNextWindowSize({26 * unit, 0});
    ImGui::Begin("opening", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_AlwaysAutoResize);
    window_.coverCurrent();
    ImGui::TextUnformatted(opening_->title().c_str());
    if (view_ && view_->preview() && !adds_to_)
      ImGui::TextDisabled("what is shown is a preview: %s", view_->preview()->what.c_str());
    ImGui::ProgressBar(opening_->part(), {-1, 0}, opening_->phase().c_str());
    nameWidget("opening");
    const bool stops = ImGui::Button("stop");
    nameWidget("stop opening");
    ImGui::End();
    if (stops) opening_.reset();
    if (stops && view_ && view_->preview())
      reports_.say(fmt::format("Stopped. What is shown is a preview of {}.", view_->preview()->what));
  }

  WindowLayout layout() const {
    WindowLayout layout;
    const double scale = window_.pixelScale();
    const double width = window_.pixels().width / scale, height = window_.pixels().height / scale;
    const double line = window_.lineHeight();
    const double left = panels_shown_ ? static_cast<double>(Panels::width(window_.textHeight())) : 0;
    layout.shows_panels = panels_shown_;
    layout.panels = {0, line, left, std::max(1.0, height - line)};
    layout.picture = {left, line, std::max(1.0, width - left), std::max(1.0, height - 2 * line)};
    layout.status = {left, height - line, std::max(1.0, width - left), line};
    return layout;
  }

  /// Draws one frame of the window with the effects of all input so far.
  void update() {
    window_.beginFrame();
    const WindowLayout place = layout();
    window_.setPicture(place.picture);
    if (!window_.showsClick()) pressKeys();
    attempt([&] { drawMenuBar(); });
    attempt([&] { view_ ? view_->draw(place) : drawWelcome(place); });
    drawOpening(place.picture);
    drawKeys(keys_shown_, window_);
    drawMessages(toasts_, messages_shown_, window_);
    drawToasts(toasts_, place.picture, glfwGetTime(), window_);
    std::optional<FileDialog::Chosen> chosen;
    attempt([&] { chosen = dialog_.draw(window_); });
    if (window_.showsClick()) pressKeys();
    window_.endFrame(glm::vec3(0.12f));
    writeWidgetPlaces();
    // What replaces the view or the font waits until the frame is over.
    applyLook();
    if (chosen && chosen->purpose == FileDialog::Purpose::kOpenData)
      open(chosen->files);
    else if (chosen && view_)
      reports_.attempt([&] { view_->take(*chosen); });
    if (const auto files = std::exchange(to_open_, std::nullopt)) open({files->begin(), files->end()});
    if (const auto dropped = window_.takeDropped(); !dropped.empty()) open({dropped.begin(), dropped.end()});
    const bool is_busy = opening_ != nullptr;
    if (view_)
      if (const auto scalar = view_->takeWantedScalar(is_busy)) add(*scalar);
    takeOpened();
  }

  /// Does a part of a frame; an error of it is reported, and ends only this part.
  void attempt(const std::function<void()>& part) {
    if (!reports_.attempt(part)) window_.closeWidgets();
  }

  void drawMenuBar() {
    MenuFacts facts;
    facts.is_enabled = [this](Command command) { return isEnabled(command); };
    facts.is_checked = [this](Command command) { return isChecked(command); };
    facts.recent = settings_.recent;
    if (view_) view_->addTo(facts);
    const MenuChoice choice = drawMenus(facts, window_);
    for (const Command command : choice.commands) run(command);
    if (choice.open) to_open_ = choice.open;
    if (view_) view_->choose(choice);
  }

  void drawWelcome(const WindowLayout& place) {
    ImGui::SetNextWindowPos({static_cast<float>(place.picture.x), static_cast<float>(place.picture.y)});
    ImGui::SetNextWindowSize({static_cast<float>(place.picture.width),
                              static_cast<float>(place.picture.height + place.status.height)});
    ImGui::Begin("welcome", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_NoBringToFrontOnFocus);
    window_.coverCurrent();             // what is clicked here is not for a picture to come
    if (opening_) return ImGui::End();  // its progress is shown in this place
    ImGui::TextUnformatted("Drop a cache or a grid with its solution here, or");
    if (ImGui::Button("open...")) run(Command::kOpen);
    nameWidget("open");
    if (!settings_.recent.empty()) ImGui::TextUnformatted("\nopened before:");
    for (size_t n = 0; n < settings_.recent.size(); ++n) {
      std::string label;
      for (const std::string& file : settings_.recent[n]) label += file + " ";
      if (ImGui::Selectable(fmt::format("{}##{}", label, n).c_str())) to_open_ = settings_.recent[n];
      nameWidget(fmt::format("recent {}", n + 1));
    }
    ImGui::End();
  }

  void pressKeys() {
    for (const Window::Key& key : window_.takeKeys()) {
      if (dialog_.isOpen()) continue;
      const auto command = commandOf(key);
      if (command && isEnabled(*command)) reports_.attempt([&] { run(*command); });
    }
  }

  bool isEnabled(Command command) const {
    switch (command) {
      case Command::kOpen:
      case Command::kQuit:
      case Command::kKeys:
      case Command::kMessages:
      case Command::kDismissMessages:
      case Command::kLightTheme:
      case Command::kLargerText:
      case Command::kSmallerText:
      case Command::kPanels:
        return true;
      default:
        return view_ && view_->isEnabled(command);
    }
  }

  bool isChecked(Command command) const {
    switch (command) {
      case Command::kPanels:
        return panels_shown_;
      case Command::kLightTheme:
        return settings_.light_theme;
      case Command::kKeys:
        return keys_shown_;
      case Command::kMessages:
        return messages_shown_;
      default:
        return view_ && view_->isChecked(command);
    }
  }

  void run(Command command) {
    switch (command) {
      case Command::kOpen:
        return dialog_.open(FileDialog::Purpose::kOpenData);
      case Command::kQuit:
        return window_.close();
      case Command::kPanels:
        panels_shown_ = !panels_shown_;
        return;
      case Command::kKeys:
        keys_shown_ = !keys_shown_;
        return;
      case Command::kMessages:
        messages_shown_ = !messages_shown_;
        return;
      case Command::kDismissMessages:
        toasts_.removeAll();
        return;
      case Command::kLightTheme:
        settings_.light_theme = !settings_.light_theme;
        look_changed_ = true;
        return;
      case Command::kLargerText:
      case Command::kSmallerText: {
        const double factor = command == Command::kLargerText ? kTextStep : 1 / kTextStep;
        settings_.text_scale = std::clamp(settings_.text_scale * factor, 0.5, 4.0);
        look_changed_ = true;
        return;
      }
      default:
        if (view_) view_->run(command);
    }
  }

  void applyLook() {
    if (!std::exchange(look_changed_, false)) return;
    window_.setLightTheme(settings_.light_theme);
    window_.setTextScale(settings_.text_scale);
  }

  void remember() {
    if (view_) view_->remember();
    try {
      writeSettings(settings_);
    } catch (const Error& error) {
      printMessage("warning: cannot save the settings: {}", error.what());
    }
  }

  const ViewerOptions options_;
  WindowSettings settings_;
  Window window_;
  Toasts toasts_;
  Reports reports_{toasts_, glfwGetTime};
  FileDialog dialog_;
  std::unique_ptr<CacheView> view_;
  std::vector<fs::path> opening_files_;       // that are being opened, or were
  bool opens_command_line_ = false;           // they are those of the command line
  std::optional<std::string> adds_to_;        // the scalar that is being added instead
  std::shared_ptr<Preparation> preparation_;  // of what is being opened
  std::unique_ptr<Opening> opening_;
  std::future<void> retired_;  // the view before, while it ends
  bool panels_shown_ = true, keys_shown_ = false, messages_shown_ = false, look_changed_ = false;
  std::optional<std::vector<std::string>> to_open_;
};

}  // namespace

void runViewer(std::optional<CacheReader> cache, const ViewerOptions& options, const Progress& stopped) {
  Viewer(std::move(cache), options).run(stopped);
}

}  // namespace curvisplat
