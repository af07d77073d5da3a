// Jobs beside the window, on threads of low priority: a job with its progress (BackgroundJob), a
// conversion with its messages and previews (Opening), and the search for scalars that a cache's sources
// have and the cache lacks (FurtherScalarList).
//
// Conversion itself is no part of the window: the subcommand supplies it as functions (ConversionServices).
// The objects are for the main thread. Their threads call `wake` when something has changed, which must be
// safe on any thread and outlive them. A destructor stops its job and waits for it, except where its comment
// says otherwise.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/mutex.h"
#include "stream/base/progress.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

struct PreparedView;

/// A coarse cache that is shown while the whole one is made.
struct Preview {
  std::filesystem::path cache, whole;
  std::string what;                                    // "every 4th index plane"
  std::shared_ptr<const void> folder;                  // what keeps `cache` there while this is held
  std::shared_ptr<const PreparedView> view = nullptr;  // for the first time it is shown
};

/// Callbacks of a conversion, called on its thread.
struct OpeningEvents {
  std::function<void(const std::string&)> say;
  std::function<void(Preview)> preview;
};

/// A scalar of a cache's sources that the cache lacks.
struct SourceScalar {
  std::string name, unit;
  bool derived = false;  // computed from others
};

/// A scalar that the shown cache lacks and the user has chosen.
struct WantedScalar {
  std::string name;
  bool for_opacities = false;                         // of the scalar that is shown
  std::optional<uint64_t> isosurface = std::nullopt;  // for the one with this Isosurface::id
  bool for_faces = false;                             // for their colours

  /// Whether it is to be shown itself.
  bool isShown() const { return !for_opacities && !isosurface && !for_faces; }
};

/// The functions of conversion that the window needs. The functions run on threads of their own, except for
/// sources_of, and throw Error; those with a Progress throw Interrupted once it is stopped.
struct ConversionServices {
  using Paths = std::vector<std::filesystem::path>;
  /// Makes a cache of the files of a grid and returns its path; returns the path of a cache as it is.
  std::function<std::filesystem::path(const Paths& files, Progress& progress, const OpeningEvents& events)>
      to_cache;
  /// The files that a cache was made from; empty if one is missing. Fast: for the main thread.
  std::function<Paths(const Manifest& manifest, const std::filesystem::path& cache)> sources_of;
  std::function<std::vector<SourceScalar>(const std::filesystem::path& cache, const Paths& files)>
      further_scalars;
  std::function<void(const std::filesystem::path& cache, const Paths& files, const std::string& scalar,
                     Progress& progress)>
      add_scalar;
  /// Whether a folder is the grid of one format, such as a Zarr store or an OpenFOAM case. Fast.
  std::function<bool(const std::filesystem::path& folder)> is_grid_folder;
  std::vector<std::string> grid_endings = {};  // of names of grids' files: ".vtu"
  /// The files of an example, which to_cache() writes where they are missing.
  std::function<Paths()> example;
};

/// The unit of pictures and of those of a movie, which people count.
inline constexpr const char* kPicturesUnit = "pictures";

/// A job on threads of low priority: its progress, and the file that it makes.
class BackgroundJob {
 public:
  /// Returns the path of what it made.
  using Work = std::function<std::filesystem::path(Progress&)>;

  /// Begins the job. `title` is shown: "opening a.xyz"; so is `phase`, until `work` begins one of its own.
  BackgroundJob(std::string title, std::string phase, Work work, void (*wake)());
  /// Stops it, and waits until it has stopped.
  ~BackgroundJob();
  BackgroundJob(const BackgroundJob&) = delete;
  BackgroundJob& operator=(const BackgroundJob&) = delete;

  const std::string& title() const { return title_; }
  /// The current phase: "sorting splats", or with its pictures "drawing pictures, 12 of 90"; and the part of it that is
  /// done, 0 if that is not known.
  std::string phase() const;
  float part() const;
  bool isDone() const;
  /// The path, once. Throws what the work threw; Interrupted after stopping. Only if isDone().
  std::filesystem::path get() { return made_.get(); }

 private:
  const std::string title_;
  mutable Mutex mutex_;
  std::string phase_ GUARDED_BY(mutex_);
  float part_ GUARDED_BY(mutex_) = 0;
  Progress progress_;
  std::future<std::filesystem::path> made_;
};

/// A conversion in the background: makes a cache of a grid's files, or adds a scalar to one.
class Opening {
 public:
  /// Returns the path of the cache.
  using Work = std::function<std::filesystem::path(Progress&, const OpeningEvents&)>;

  /// Begins the conversion. `title` is shown: "opening a.xyz".
  Opening(std::string title, Work work, void (*wake)());

  const BackgroundJob& job() const { return job_; }
  /// Warnings and notes since the last call.
  std::vector<std::string> takeMessages();
  /// The preview that can be shown already, once.
  std::optional<Preview> takePreview();
  bool isDone() const { return job_.isDone(); }
  /// The cache, once. Throws Error as converting does. Only if isDone().
  std::filesystem::path get() { return job_.get(); }

 private:
  Mutex mutex_;
  std::vector<std::string> messages_ GUARDED_BY(mutex_);
  std::optional<Preview> preview_ GUARDED_BY(mutex_);
  BackgroundJob job_;  // last: its thread uses the others
};

/// The scalars, known so far, that a cache's sources have and the cache lacks.
struct FurtherScalars {
  std::string from;                          // the names of the files; empty: there are none
  bool is_looking = false, is_busy = false;  // busy: one is being added
  std::vector<SourceScalar> scalars;
  std::string error;
  std::string note;  // why there are none and what to do, or empty
};

/// Finds these scalars on a thread of its own when someone asks, since opening the sources can take as long
/// as reading them.
class FurtherScalarList {
 public:
  /// Opens nothing yet. If `files` is empty, there are no further scalars.
  FurtherScalarList(const ConversionServices& services, std::filesystem::path cache,
                    std::vector<std::filesystem::path> files, void (*wake)());
  /// Does not wait for the thread, which may be reading for long: another view is to come at once. Any
  /// thread.
  ~FurtherScalarList();
  FurtherScalarList(const FurtherScalarList&) = delete;
  FurtherScalarList& operator=(const FurtherScalarList&) = delete;
  /// Waits for the threads of all lists that were destroyed. Call it before what `wake` needs ends.
  static void waitForThreads();

  /// Begins to look, unless that was asked for before.
  void look();
  const FurtherScalars& known();
  const std::vector<std::filesystem::path>& files() const { return files_; }

 private:
  const ConversionServices services_;
  const std::filesystem::path cache_;
  const std::vector<std::filesystem::path> files_;
  void (*const wake_)();
  bool asked_ = false;
  FurtherScalars known_;
  std::future<std::vector<SourceScalar>> found_;
};

}  // namespace curvisplat
