// Which nodes a cache has splats of: a bit a node, in a temporary file, from the node runs of its leaves.
// Nodes that were merged into another one at a seam have no splat of their own, and no bit.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "preprocess/convert/memory_plan.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

class DrawnNodes {
 public:
  /// Decodes the geometry of all leaves, and sorts their runs through a temporary file (16 bytes a run and
  /// one bit a node). Throws Error if a disk fails or a run is not in the grid.
  DrawnNodes(const CacheReader& cache, const MemoryPlan& plan, const std::filesystem::path& temporary_folder,
             Progress& progress);
  /// Removes the file.
  ~DrawnNodes();

  /// Sets blank[n] for each node first + n that is not drawn. Any thread.
  void blankOthers(uint64_t first, std::span<uint8_t> blank) const;

  bool holds(uint64_t node) const;
  /// Not while others read.
  void add(uint64_t node);

 private:
  OutputFile written_;
  InputFile bits_;  // bit n % 8 of byte n / 8
};

}  // namespace curvisplat
