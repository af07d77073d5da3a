// What is open in the window: the view of it, and how another takes its place. Opens caches at once and converts grids in
// the background, shows previews meanwhile, adds scalars to the cache that is shown.
#pragma once

#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/cache_view.h"
#include "tools/viewer/job_display.h"
#include "tools/viewer/opening.h"
#include "tools/viewer/prepared_view.h"
#include "tools/viewer/state_files.h"
#include "tools/viewer/viewer_options.h"

namespace curvisplat {

/// What a view is shown in and reports to.
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
  /// Shows what has been opened since the last call, and begins to add a scalar that the view wants. Between the window's frames.
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
  void add(const std::string& scalar);
  ViewerOptions viewOptions() const;
  void takeOpened();
  void takeWhole();
  void showPreview(const Preview& preview);

  const ViewerOptions options_;
  const ViewSurroundings surroundings_;
  std::unique_ptr<CacheView> view_;
  std::vector<std::filesystem::path> opening_files_;  // that are being opened, or were
  bool opens_command_line_ = false;                   // they are those of the command line
  std::optional<std::string> adds_to_;                // the scalar that is being added instead
  std::shared_ptr<Preparation> preparation_;          // of what is being opened
  std::unique_ptr<Opening> opening_;
  std::future<void> retired_;  // the view before, while it ends
};

}  // namespace curvisplat
