// The conversion behind a kept cache (kept_caches.h): with all default options of `convert` but the
// precision. Before it converts a large grid, it converts a coarse sample, which can be shown within a
// second.
//
// A preview's folder exists as long as someone holds it: the conversion, or a view, which opens the cache's
// files by their paths. makeKeptCache() runs on the caller's thread and on TBB's; the folder may be released
// on any thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/codec/values_codec.h"

namespace curvisplat {

/// The folder of a cache that is shown before the whole one is complete.
class PreviewFolder {
 public:
  /// Makes `place`/`name`.<process number>.<n>, which no other has, and locks it. Throws Error if it cannot.
  PreviewFolder(const std::filesystem::path& place, const std::string& name);
  /// Removes the folder with everything in it, unless keep() was called.
  ~PreviewFolder();
  PreviewFolder(const PreviewFolder&) = delete;
  PreviewFolder& operator=(const PreviewFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  void keep() { keep_ = true; }

  /// Removes the folders of `name` in `place` whose process has ended. Do not call it while another process
  /// makes one there.
  static void removeLeftOnes(const std::filesystem::path& place, const std::string& name);

 private:
  const std::filesystem::path path_;
  bool keep_ = false;
  int lock_ = -1;
};

/// Something to show before the cache is complete.
struct KeptPreview {
  std::filesystem::path cache, whole;  // what there is now, and what it will be
  uint64_t stride = 1;                 // it is of every stride-th index plane; 1: of all of them
  uint64_t lattice = 0;     // of a mesh: nodes of the lattice that stands for it along each axis; else 0
  bool first_step = false;  // of a series
  std::shared_ptr<const PreviewFolder> folder;  // of `cache`, which is there while this is held
};

/// Callbacks of a conversion, called on the thread that converts.
struct KeptCacheEvents {
  std::function<void(const std::string&)> say = [](const std::string&) {};  // warnings and notes
  std::function<void(const KeptPreview&)> preview = {};                     // empty: none is made
};

/// The files hold a grid alone, and no scalar but those that can be computed from its coordinates.
class LoneGrid : public Error {
 public:
  using Error::Error;
};

/// Grids with more nodes or cells than this get a preview of about a quarter of this number, which takes a
/// second at most.
inline constexpr uint64_t kNodesWithoutPreview = 1'000'000;

/// Converts the grid or the series of time steps in `files` to `output`, which is complete or does not
/// exist. Previews and scratch files are in the same folder; a preview stays while it is held. A series
/// stays in the folder of its preview, and `output` links to it. Previews of a series show its first step: a
/// coarse one if the step is large, then the step as converted. If the files hold a grid alone, those of `scalars` that can be computed
/// from it are converted; other names are passed over. Files with several time steps give the first, or the last if all scalars
/// of the first are constant; where the default scalars are constant, others take their place. Throws Error as
/// opening and converting do, LoneGrid if none can, Interrupted once `progress` is stopped.
void makeKeptCache(const std::vector<std::filesystem::path>& files, const std::filesystem::path& output,
                   Progress& progress, const KeptCacheEvents& events, const std::vector<std::string>& scalars,
                   ValuePrecision precision);

}  // namespace curvisplat
