// The caches that a server shows: opened once, before it listens, with the view that each begins with. Pages know a
// cache by its number and its name; where it lies on the machine leaves no function here.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/mutex.h"
#include "stream/cache/cache_reader.h"
#include "tools/serve/client_requests.h"
#include "tools/view/view_state.h"

namespace curvisplat {

class ServedCaches {
 public:
  /// Throws Error as CacheReader; 0.1 to 0.3 s a cache. Requires one path or more.
  /// `faces`: the names of a cache's faces that FrameRequest::faces_at finds; none: pages offer no faces.
  using FacesOf = std::function<std::vector<std::string>(const CacheReader&)>;
  explicit ServedCaches(const std::vector<std::filesystem::path>& paths, const FacesOf& faces = {});

  size_t size() const { return caches_.size(); }
  const CacheReader& reader(size_t cache) const { return caches_[cache].reader; }
  const std::string& name(size_t cache) const { return caches_[cache].name; }

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
  /// Warnings where a view asks for finer differences than the cache stores at the step: finerThanStored(). `number`: of the view's request.
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

 private:
  double aspectOf(size_t cache, ImageSize picture) const;
  struct Served {
    std::string name;
    CacheReader reader;
    ViewState first;
    std::vector<std::string> faces;
  };
  std::vector<Served> caches_;
  mutable Mutex reading_;  // held while a coarse level is read: its memory is not part of a viewer's limit
};

}  // namespace curvisplat
