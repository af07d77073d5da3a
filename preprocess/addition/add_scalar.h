// Adds scalars to an existing cache without changing its geometry: reads the grid again with the new scalars,
// and brings each value to the brick that has its splat. The new files have the same bytes as if the cache
// had been converted with all scalars at once.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"
#include "stream/base/ranks.h"

namespace curvisplat {

/// The options of an addition of scalars.
struct AddScalarOptions {
  std::filesystem::path cache;             // that gets the scalars
  std::vector<uint32_t> scalars;           // positions in the source's description
  std::optional<double> blank_value;       // no drawn node may have it
  uint64_t memory_bytes = 0;               // 0: defaultMemory()
  unsigned threads = 0;                    // 0: as many as the machine has
  bool check_disk_space = true;            // before the work
  std::filesystem::path temporary_folder;  // empty: the folder of the cache

  /// Processes that add together: each has the same source and options, and calls addScalars(). Rank 0 alone changes the
  /// cache, and its report counts.
  Ranks* ranks = &oneRank();

  TestLimits limits;
};

/// The results of an addition of scalars.
struct AddScalarReport {
  std::vector<std::string> scalars;  // as the cache calls them
  uint64_t nodes = 0, splats = 0;
  uint64_t temporary_bytes = 0;   // of the scattered values
  unsigned threads = 0;           // that worked
  uint64_t memory_bytes = 0;      // the limit of the addition
  std::vector<FileReport> files;  // the new ones
  std::vector<std::string> warnings;
};

/// Thrown if samples that the cache draws have no value of a scalar.
class LacksValues final : public Error {
 public:
  using Error::Error;
};

/// Adds the scalars. `source` is read twice (a third time if older scalars blanked nodes that the grid does
/// not). Nodes that the cache draws must have the new values; those of other nodes are left out, with a
/// warning. Throws Error if the grid is not the one the cache was made from, or if a file, the disk or memory
/// fails; LacksValues if a value is missing; UsageError if the cache has a scalar of the name. After an
/// exception the cache is as it was. The peak memory of the process, everything included, is
/// options.memory_bytes.
AddScalarReport addScalars(const DataSource& source, const AddScalarOptions& options, Progress& progress);

}  // namespace curvisplat
