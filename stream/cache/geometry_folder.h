// The folder of a geometry of a cache (steps_file.h): its octree and geometry streams, and the files of values of
// the steps that share it. Immutable but for the list of open files of values, which are shared by all readers of
// a step while one of them is open.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "stream/base/file.h"
#include "stream/base/mutex.h"
#include "stream/cache/manifest.h"
#include "stream/cache/steps_file.h"
#include "stream/model/brick.h"

namespace curvisplat {

struct ValuesFile {
  InputFile file;
  std::vector<BrickVariable> table;  // [brick]
};

class GeometryFolder {
 public:
  /// `manifest`: that of the folder. Throws Error if the tables are damaged.
  GeometryFolder(std::filesystem::path folder, Manifest manifest);
  /// The folder of a geometry of the cache with this manifest. Throws Error as the constructor, and if the folder
  /// is not the one that the series names.
  static std::shared_ptr<const GeometryFolder> open(const std::filesystem::path& cache,
                                                    const Manifest& manifest, const Series& series,
                                                    uint32_t geometry);

  const std::filesystem::path& path() const { return path_; }
  const Manifest& manifest() const { return manifest_; }
  const std::vector<Brick>& bricks() const { return bricks_; }
  const InputFile& geometry() const { return geometry_; }

  /// A variable of the manifest at a step of this geometry. Any thread. Throws Error if the file is damaged.
  std::shared_ptr<const ValuesFile> values(const Series& series, uint64_t step, size_t variable) const;

 private:
  std::filesystem::path path_;
  Manifest manifest_;
  std::vector<Brick> bricks_;
  InputFile geometry_;
  mutable Mutex opening_;
  mutable std::map<std::pair<uint64_t, size_t>, std::weak_ptr<const ValuesFile>> open_
      GUARDED_BY(opening_);  // [step, variable]
};

/// The manifest of the cache in the folder `cache`. Throws Error that says what the folder is instead.
Manifest readManifest(const std::filesystem::path& cache);

}  // namespace curvisplat
