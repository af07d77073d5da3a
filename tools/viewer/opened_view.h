// The view that is open in the window, and how another takes its place. OpenedView opens caches at once and
// converts grids in the background, shows previews meanwhile, and adds scalars to the cache that is shown.
// JobDisplay shows such jobs.
//
// For the main thread. A view that is replaced ends on a thread of its own, and the new one draws when its
// memory is free.
#pragma once

#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/view/background_jobs.h"
#include "tools/view/saved_views.h"
#include "tools/viewer/cache_view.h"
#include "tools/viewer/prepared_view.h"
#include "tools/window/window.h"

namespace curvisplat {

/// Jobs in the background, in the corner of the picture, where they hide nothing that is looked at: what is
/// done, how far it is, and a button that stops it.
class JobDisplay {
 public:
  JobDisplay(const Rectangle& picture, Window& window) : picture_(picture), window_(window) {}

  /// Draws a job below those before. `name` is the name of its widgets: "opening", "stop opening". `note`
  /// may be empty. Returns whether the user stops the job.
  bool draw(const BackgroundJob& job, const std::string& name, const std::string& note = {});

 private:
  const Rectangle picture_;
  Window& window_;
  float below_ = 0;  // of those before
};

/// The objects that a view is shown in and reports to.
struct ViewSurroundings {
  Window& window;
  Reports& reports;
  FileDialog& dialog;
  WindowSettings& settings;  // which remember what was opened
  std::function<ImageSize()> picture_size;
};

class OpenedView {
 public:
  /// Shows nothing yet. `options` are those of the command line.
  OpenedView(const ViewerOptions& options, const ViewSurroundings& surroundings);
  /// Stops what is being opened and drawn.
  ~OpenedView();
  OpenedView(const OpenedView&) = delete;
  OpenedView& operator=(const OpenedView&) = delete;

  /// Shows a cache that is open. Throws Error as preparing a view of it does.
  void show(CacheReader cache);
  /// Opens what was chosen in a dialog or a menu, or dropped: a cache at once, a grid when it is converted.
  void open(const std::vector<std::filesystem::path>& files);
  /// Shows what has been opened since the last call, and begins to add a scalar that the view wants. Call it
  /// between the window's frames.
  void update();
  /// Draws what is being opened, and stops it if the user says so.
  void drawOpening(JobDisplay& display);
  bool isOpening() const { return opening_ != nullptr; }
  /// nullptr if nothing is open yet.
  CacheView* view() { return view_.get(); }
  const CacheView* view() const { return view_.get(); }

 private:
  struct Preparation;

  void show(const PreparedView& prepared, const ViewerOptions& options,
            const std::vector<std::filesystem::path>& files);
  void retire(std::unique_ptr<CacheView> view, std::promise<void> has_ended);
  void add(const WantedScalar& wanted);
  ViewerOptions viewOptions() const;
  void takeOpened();
  void takeWhole();
  void showPreview(const Preview& preview);

  const ViewerOptions options_;
  const ViewSurroundings surroundings_;
  std::unique_ptr<CacheView> view_;
  std::vector<std::filesystem::path> opening_files_;  // that are being opened, or were
  bool opens_command_line_ = false;                   // they are those of the command line
  std::optional<WantedScalar> adds_to_;               // the scalar that is being added instead
  std::shared_ptr<Preparation> preparation_;          // of what is being opened
  std::unique_ptr<Opening> opening_;
  std::future<void> retired_;  // the view before, while it ends
};

}  // namespace curvisplat
