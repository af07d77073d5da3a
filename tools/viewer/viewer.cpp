#include "tools/viewer/viewer.h"

#include <GLFW/glfw3.h>
#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <functional>
#include <memory>
#include <span>
#include <utility>

#include "stream/base/error.h"
#include "tools/view/saved_views.h"
#include "tools/viewer/cache_view.h"
#include "tools/viewer/movie.h"
#include "tools/viewer/opened_view.h"
#include "tools/viewer/welcome_page.h"
#include "tools/window/reports.h"
#include "tools/window/widgets.h"
#include "tools/window/window.h"
#include "tools/window/window_commands.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

// New pictures and input end a wait early. Longer waits leave the processor to the renderer when both share
// it.
constexpr double kNoViewWaitSeconds = 0.5;
constexpr int kFramesAfterInput = 2;  // Dear ImGui needs them to settle
constexpr double kTextStep = 1.125;

class Viewer {
 public:
  Viewer(std::optional<CacheReader> cache, const ViewerOptions& options)
      : options_(options), settings_(readSettings()), window_("curvisplat", options.size) {
    printMessage("window: OpenGL {}", window_.contextName());
    if (settings_.light_theme) window_.setLightTheme(true);
    if (settings_.text_scale != 1) window_.setTextScale(settings_.text_scale);
    if (cache) opened_.show(std::move(*cache));
    if (!options.files.empty()) opened_.open(options.files);
  }

  ~Viewer() {
    if (movie_) printMessage("{}: stopped, because the window was closed", movie_->title());
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
      window_.wait(frames_to_settle > 0 ? 0 : opened_.view() ? opened_.view()->wait() : kNoViewWaitSeconds);
      frames_to_settle = window_.takeInput() ? kFramesAfterInput : std::max(0, frames_to_settle - 1);
      update();
    }
  }

  ImageSize pictureSize() const {
    const Rectangle picture = layout().picture;
    const auto pixels = [this](double units) {
      return std::max(1, static_cast<int>(std::lround(window_.pixelScale() * units)));
    };
    return {pixels(picture.width), pixels(picture.height)};
  }

  void begin(MovieRequest request) {
    if (movie_) return reports_.say("Something is being saved already: stop it, or wait for its end.");
    saves_picture_ = request.kind == MovieKind::kOnePicture;
    const fs::path name = (saves_picture_ ? request.file : movieNameOf(request.file)).filename();
    movie_ = std::make_unique<BackgroundJob>(
        fmt::format("saving {}", name.string()),
        fmt::format("drawing {} x {}", request.size.width, request.size.height),
        [movie = std::make_shared<MovieRequest>(std::move(request)),
         open = options_.open_movie](Progress& progress) { return drawMovie(*movie, open, progress); },
        Window::wake);
  }

  /// Begins the movie that the view wants, and takes the one that is done. One at a time.
  void updateMovie() {
    CacheView* const view = opened_.view();
    if (std::optional<MovieRequest> wanted = view ? view->takeWantedMovie() : std::nullopt)
      begin(std::move(*wanted));
    if (!movie_ || !movie_->isDone()) return;
    const std::unique_ptr<BackgroundJob> done = std::move(movie_);
    reports_.attempt(
        [&] {
          reports_.say("saved " + fs::absolute(done->get()).string());
          reports_.settle(About::kSaving);
        },
        About::kSaving);
  }

  /// Draws what goes on in the background.
  void drawJobs(const Rectangle& picture) {
    JobDisplay display(picture, window_);
    opened_.drawOpening(display);
    if (!movie_ || !display.draw(*movie_, "movie")) return;
    movie_.reset();
    reports_.say(fmt::format("Stopped. The {} was not saved.", saves_picture_ ? "picture" : "film"));
  }

  WindowLayout layout() const {
    WindowLayout layout;
    const double scale = window_.pixelScale();
    const double width = window_.pixels().width / scale, height = window_.pixels().height / scale;
    const double line = window_.lineHeight();
    const double left = panels_shown_ ? static_cast<double>(Panels::width(window_.textHeight())) : 0;
    layout.shows_panels = panels_shown_;
    layout.panels = {0, line, left, std::max(1.0, height - line)};
    const double of_time = opened_.view() && opened_.view()->isSeries() ? line : 0;
    layout.picture = {left, line, std::max(1.0, width - left), std::max(1.0, height - 2 * line - of_time)};
    layout.time = {left, height - line - of_time, std::max(1.0, width - left), of_time};
    layout.status = {left, height - line, std::max(1.0, width - left), line};
    return layout;
  }

  /// Draws one frame of the window with the effects of all input so far.
  void update() {
    window_.beginFrame();
    pressKeys();  // first: this frame shows what they do to the layout, too
    const WindowLayout place = layout();
    window_.setPicture(place.picture);
    attempt([&] { drawMenuBar(); });
    attempt([&] { opened_.view() ? opened_.view()->draw(place) : drawWelcome(place); });
    drawJobs(place.picture);
    drawKeys(keys_shown_, window_);
    drawMessages(toasts_, messages_shown_, window_);
    drawToasts(toasts_, place.picture, glfwGetTime(), window_);
    std::optional<FileDialog::Chosen> chosen;
    attempt([&] { chosen = dialog_.draw(window_); });
    window_.endFrame(glm::vec3(0.12f), opened_.view() && opened_.view()->expectsMovingPicture());
    writeWidgetPlaces();
    // What replaces the view or the font waits until the frame is over.
    applyLook();
    if (chosen && chosen->purpose == FileDialog::Purpose::kOpenData)
      opened_.open(chosen->files);
    else if (chosen && opened_.view())
      reports_.attempt([&] { opened_.view()->use(*chosen); });
    if (const auto files = std::exchange(to_open_, std::nullopt))
      opened_.open({files->begin(), files->end()});
    if (const auto dropped = window_.takeDropped(); !dropped.empty())
      opened_.open({dropped.begin(), dropped.end()});
    updateMovie();
    opened_.update();
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
    if (CacheView* const view = opened_.view()) view->addTo(facts);
    const MenuChoice choice = drawMenus(facts, window_);
    for (const Command command : choice.commands) run(command);
    if (choice.open) to_open_ = choice.open;
    if (CacheView* const view = opened_.view()) view->choose(choice);
  }

  void drawWelcome(const WindowLayout& place) {
    // In place of the panels, too.
    ImGui::SetNextWindowPos({0, static_cast<float>(place.picture.y)});
    ImGui::SetNextWindowSize({static_cast<float>(place.picture.x + place.picture.width),
                              static_cast<float>(place.picture.height + place.status.height)});
    ImGui::Begin("welcome", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_NoBringToFrontOnFocus);
    window_.coverCurrent();                        // what is clicked here is not for a picture to come
    if (opened_.isOpening()) return ImGui::End();  // its progress is shown in this place
    const WelcomeChoice choice = drawWelcomePage(settings_.recent, options_.conversion.example != nullptr);
    ImGui::End();
    if (choice.opens) run(Command::kOpen);
    if (choice.recent) to_open_ = settings_.recent[*choice.recent];
    if (!choice.example) return;
    to_open_.emplace();
    for (const fs::path& file : options_.conversion.example()) to_open_->push_back(file.string());
  }

  void pressKeys() {
    for (const Window::Key& key : window_.takeKeys()) {
      const auto command = commandOf(key);
      if (dialog_.isOpen()) {
        if (command == Command::kKeys) dialog_.toggleHelp();
        continue;
      }
      if (command && isEnabled(*command)) reports_.attempt([&] { run(*command); });
    }
  }

  /// The commands that are not a view's.
  static std::span<const CommandAction<Viewer>> actions() {
    static constexpr CommandAction<Viewer> kActions[] = {
        {Command::kOpen, [](Viewer& v) { v.dialog_.open(FileDialog::Purpose::kOpenData); }},
        {Command::kQuit, [](Viewer& v) { v.window_.close(); }},
        {Command::kPanels, [](Viewer& v) { v.panels_shown_ = !v.panels_shown_; }, nullptr,
         [](const Viewer& v) { return v.panels_shown_; }},
        {Command::kKeys, [](Viewer& v) { v.keys_shown_ = !v.keys_shown_; }, nullptr,
         [](const Viewer& v) { return v.keys_shown_; }},
        {Command::kMessages, [](Viewer& v) { v.messages_shown_ = !v.messages_shown_; }, nullptr,
         [](const Viewer& v) { return v.messages_shown_; }},
        {Command::kDismissMessages,
         [](Viewer& v) {
           if (!closeLists()) v.toasts_.removeAll();
         }},
        {Command::kLightTheme,
         [](Viewer& v) {
           v.settings_.light_theme = !v.settings_.light_theme;
           v.look_changed_ = true;
         },
         nullptr, [](const Viewer& v) { return v.settings_.light_theme; }},
        {Command::kLargerText, [](Viewer& v) { v.scaleText(kTextStep); }},
        {Command::kSmallerText, [](Viewer& v) { v.scaleText(1 / kTextStep); }},
    };
    return kActions;
  }

  bool isEnabled(Command command) const {
    if (actionOf(actions(), command)) return true;
    const bool is_movie = command == Command::kSaveTurnMovie || command == Command::kSaveStepsMovie ||
                          command == Command::kSaveFilmMovie;
    return !(is_movie && movie_) && opened_.view() && opened_.view()->isEnabled(command);
  }

  bool isChecked(Command command) const {
    if (const auto* const action = actionOf(actions(), command))
      return action->is_checked && action->is_checked(*this);
    return opened_.view() && opened_.view()->isChecked(command);
  }

  void run(Command command) {
    if (const auto* const action = actionOf(actions(), command)) return action->run(*this);
    if (CacheView* const view = opened_.view()) view->run(command);
  }

  void scaleText(double factor) {
    settings_.text_scale = std::clamp(settings_.text_scale * factor, 0.5, 4.0);
    look_changed_ = true;
  }

  void applyLook() {
    if (!std::exchange(look_changed_, false)) return;
    window_.setLightTheme(settings_.light_theme);
    window_.setTextScale(settings_.text_scale);
  }

  void remember() {
    if (const CacheView* const view = opened_.view()) view->remember();
    settings_.data_folder = dialog_.dataFolder().string();
    try {
      writeSettings(settings_);
    } catch (const Error& error) {
      printMessage("warning: cannot save the settings: {}", error.what());
    }
  }

  const ViewerOptions options_;
  bool panels_shown_ = true, keys_shown_ = false, messages_shown_ = false, look_changed_ = false;
  WindowSettings settings_;
  Window window_;
  Toasts toasts_;
  Reports reports_{toasts_, glfwGetTime};
  FileDialog dialog_{options_.conversion.is_grid_folder, options_.conversion.grid_endings,
                     settings_.data_folder};
  OpenedView opened_{options_, {window_, reports_, dialog_, settings_, [this] { return pictureSize(); }}};
  std::unique_ptr<BackgroundJob> movie_;  // that is being drawn
  bool saves_picture_ = false;            // it is one picture
  std::optional<std::vector<std::string>> to_open_;
};

}  // namespace

void runViewer(std::optional<CacheReader> cache, const ViewerOptions& options, const Progress& stopped) {
  Viewer(std::move(cache), options).run(stopped);
}

}  // namespace curvisplat
