// Converts a grid of any size to a splat cache, in bounded memory (DESIGN.md, "Conversion"), and estimates
// what a conversion will take on disk, by converting a sample of the grid. One thread calls.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// Converts a structured grid (GridSource) or an unstructured one (MeshSource). A structured grid is read at
/// least twice, by scan and scatter, and once more for surfaces; overlapping blocks, and a sample of the
/// positions that does not fit in memory, add passes. The bytes of the cache depend on the source and on
/// options that say what the cache holds, not on threads, memory or ranks. The process, everything included,
/// takes at most options.memory_bytes.
///
/// Throws Error (and UsageError) if input, disk or options are at fault. Then no temporary file and no
/// partial cache is left, and an existing output is unchanged.
///
/// After SIGKILL, or a crash of the machine, a partial folder is left, which is not a cache; `resume`
/// continues from it. progress.stop() leaves one too (convert() then throws Interrupted), as does an Error if
/// `resume` is set. If there is such a folder, a conversion to the same output throws Error unless
/// `resume` is set, or `overwrite`, which starts anew. An interruption before there is anything worth
/// resuming removes all files.
///
/// Several ranks share the work of all passes; only the splats of an unstructured grid are made by rank 0
/// alone. Scratch folder and output must be on a file system that all ranks share. Rank 0 returns the report
/// of the whole. Each rank keeps to options.memory_bytes. When a rank throws, the others do not end by
/// themselves: whoever started them has to end them. What rank 0 leaves is as described above.
ConvertReport convert(const DataSource& source, const ConvertOptions& options, Progress& progress);

/// The number of nodes of a sample, for sampledNeeds() and `--dry-run`. Smaller samples have too few bricks of
/// coarser levels, which take a third of the bytes of a large grid's cache: samples of 1 million of 27 million
/// nodes gave 0.57 to 0.84 of the true sizes.
inline constexpr uint64_t kSampledNodes = 8'000'000;

/// Estimates what convert() will take on disk from a sample of about `nodes` nodes, which is converted within
/// `folder`; the folder is made and removed. The estimate is right within a factor of 1.5. Throws Error if
/// the sample cannot be converted, Interrupted once `progress` is stopped.
DiskNeeds sampledNeeds(const GridSource& grid, const ConvertOptions& options,
                       const std::filesystem::path& folder, const Progress& progress,
                       uint64_t nodes = kSampledNodes);

/// count * factor, rounded.
uint64_t times(uint64_t count, double factor);

/// How much larger a structured grid is than its sample: for sampledNeeds(), and for `convert --dry-run`.
struct SampleScale {
  double volume = 1, faces = 1;  // ratios of the numbers of nodes, and of the bytes of faces

  /// `options`: those of the whole grid.
  static SampleScale of(const GridDescription& whole, const GridDescription& sample,
                        const ConvertOptions& options);
  /// Bytes of the whole grid's cache, from the files of the sample's.
  uint64_t bytesOf(const std::vector<FileReport>& files) const;
};

/// The options for a sample, which is converted within `folder`.
ConvertOptions optionsOfSample(const ConvertOptions& options, const std::filesystem::path& folder);

}  // namespace curvisplat
