// The caches that a server shows, with the view that each begins with. Pages know a cache by its number and its name;
// where it lies on the machine leaves no function here.
//
//   ServedFolders  --caches(), for each new viewer-->  ServedCaches
//   opens a cache again whose manifest has changed     stays as it is: the viewer keeps it
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/mutex.h"
#include "stream/base/watched_file.h"
#include "stream/cache/cache_reader.h"
#include "tools/serve/client_requests.h"
#include "tools/view/view_state.h"

namespace curvisplat {

/// A cache as it was when it was opened.
struct ServedCache {
  std::string name;
  CacheReader reader;
  ViewState first;
  std::vector<std::string> faces;
};

/// The caches that a viewer is shown. Every function with a cache's number throws UsageError if there is no such cache.
class ServedCaches {
 public:
  using All = std::vector<std::shared_ptr<const ServedCache>>;
  /// `reading` is held while a coarse level is read: its memory is not part of a viewer's limit. Outlives this.
  ServedCaches(All caches, Mutex& reading) : caches_(std::move(caches)), reading_(reading) {}

  size_t size() const { return caches_.size(); }
  const CacheReader& reader(size_t cache) const { return at(cache).reader; }

  /// The view of a cache before anything is chosen, for a picture of this size. Any thread.
  ViewState firstView(size_t cache, ImageSize size) const;

  // Texts for pages, JSON. Those that read the cache do so one after the other, for all viewers. Any thread.

  /// The names of all caches and colour maps.
  std::string helloText() const;
  /// The facts about a cache that a page needs, and the first view.
  std::string cacheText(const OpenRequest& request) const;
  /// Throw UsageError for a scalar or map that does not exist, Error as reading does.
  std::string functionText(const FunctionRequest& request) const;
  std::string histogramText(const HistogramRequest& request) const;
  /// The value of a scalar at a step, at a point of the picture if there is one: a "marker", which is UsageError outside
  /// of the data; or for a mouse that rests a "value", which is null there.
  struct MarkedScalar {
    std::string name;
    uint64_t step = 0;
    bool hovers = false;
    double x = 0, y = 0;  // of the request, for the answer
  };
  std::string markerText(size_t cache, const MarkedScalar& scalar,
                         const std::optional<glm::dvec3>& point) const;
  /// Warnings where a view asks for finer differences than the cache stores at the step: finerThanStored(). `number`: of the view's
  /// request.
  struct AskedStep {
    size_t cache = 0;
    uint64_t step = 0;
    AskedDifferences differences;
    bool operator==(const AskedStep&) const = default;
  };
  std::string finerText(uint64_t number, const AskedStep& asked) const;
  static std::string coloursText(const ColoursRequest& request);
  std::string isosurfaceText(const IsosurfaceRequest& request) const;
  /// The `curvisplat render` command that draws a view, for a folder that has the cache, and the files of functions that its
  /// options cannot state. Throws Error for a state that is not one of this cache.
  std::string commandText(const CommandRequest& request) const;

  /// An error for a page: `text` without paths of this machine.
  std::string errorText(std::string text) const;
  /// An error for a page, of a text that has no paths. `reduced`: the picture follows with fewer pixels than were asked for; a page that
  /// saves it goes on waiting.
  static std::string refusalText(const std::string& text, bool reduced = false);

 private:
  const ServedCache& at(size_t cache) const;
  double aspectOf(size_t cache, ImageSize picture) const;

  const All caches_;
  Mutex& reading_;
};

/// The folders of the caches, which may get time steps and scalars, or be replaced, while they are served.
class ServedFolders {
 public:
  /// The names of a cache's faces that FrameRequest::faces_at finds; none: pages offer no faces.
  using FacesOf = std::function<std::vector<std::string>(const CacheReader&)>;
  /// Throws Error as CacheReader; 0.1 to 0.3 s a cache. Requires one path or more.
  explicit ServedFolders(const std::vector<std::filesystem::path>& paths, FacesOf faces = {});

  /// The caches as they are now. Opens those again whose manifests have changed; one that cannot be opened stays as it
  /// was, with a message. Any thread; must outlive what it returns.
  std::shared_ptr<const ServedCaches> caches();

 private:
  struct Folder {
    std::filesystem::path path;
    std::string name;
    FileState manifest;        // when it was opened
    ServedCaches::All caches;  // the cache, and those of scalars with blanks of their own
  };
  void open(Folder& folder) const;

  const FacesOf faces_;
  Mutex opening_, reading_;
  std::vector<Folder> folders_ GUARDED_BY(opening_);
};

}  // namespace curvisplat
