// Conversion: a grid of any size becomes a splat cache, in bounded memory. DESIGN.md, "Conversion".
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/faces/grid_faces_pass.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/overset/block_owners.h"
#include "stream/base/progress.h"
#include "stream/base/ranks.h"

namespace curvisplat {

struct ConvertOptions {
  std::filesystem::path output;            // NAME.splats, without a slash behind it
  bool check_disk_space = true;            // before the work
  bool overwrite = false;                  // what stands there goes, once the new cache is whole
  bool resume = false;                     // go on from an interrupted conversion, if there is one
  std::vector<uint32_t> scalars;           // positions in the source's description; the cache's variables
  std::optional<double> blank_value;       // nodes with this value of a scalar are not there
  uint64_t memory_bytes = 0;               // 0: defaultMemory()
  unsigned threads = 0;                    // 0: as many as the machine has
  std::filesystem::path temporary_folder;  // empty: the folder of the output
  std::string title;                       // empty: the output's name
  std::optional<double> time;              // of the step; otherwise the source's, or 0
  bool surfaces = true;                    // the grid's outer faces go into the cache
  std::vector<IndexPlane> planes;          // and these index planes
  Overlap overlap = Overlap::kOwner;       // of blocks

  /// Those that convert together: each has the same source and options, and calls convert(). Null: this process alone.
  Ranks* ranks = nullptr;

  /// Smaller buckets than memory would allow: tests make many of them from small grids.
  std::optional<uint64_t> bucket_splats;
  /// Less memory for an unstructured grid than there is: small ones then take the way of large ones.
  std::optional<uint64_t> mesh_bytes;
  /// Less memory for the cells of overlapping blocks: small ones are then read in several parts.
  std::optional<uint64_t> owner_bytes;
};

/// A file of the cache, and what it takes.
struct FileReport {
  std::string name;
  uint64_t bytes = 0;
};

/// What a conversion did, and what was odd about the grid.
struct ConvertReport {
  Centring centring = Centring::kNode;  // of the scalars: what nodes and blanked count, nodes or cells
  uint64_t nodes = 0;
  BlankCounts blanked;
  uint64_t degenerate = 0;    // splats with an axis of no length, which got one
  uint64_t inverted = 0;      // cells of the other handedness than most of their block
  uint64_t merged_nodes = 0;  // face nodes that became part of another one's splat
  uint64_t splats = 0, bricks = 0;
  uint32_t levels = 0;
  double volume = 0;
  uint64_t temporary_bytes = 0;  // of the scattered splats
  bool resumed = false;          // from an interrupted conversion, which had made
  uint64_t resumed_bricks = 0;   // so many of the bricks
  unsigned threads = 0;          // that worked: memory may allow fewer than asked for
  uint64_t memory_bytes = 0;     // the cap that held
  std::vector<FileReport> files;
  std::vector<std::string> warnings, notes;
};

/// Converts a structured grid (GridSource) or an unstructured one (MeshSource). `source` is read three times, and once more for surfaces.
/// The result's bytes depend on source, scalars and blank value
/// alone. Throws Error (and UsageError) if something outside fails; then no temporary file and no partial
/// cache is left, and what stood at the output is as it was. Peak memory, everything counted:
/// options.memory_bytes.
///
/// Killed at any moment it leaves something that is no cache, and that `resume` goes on from. So does
/// progress.stop(), soon after which this throws Interrupted; and an Error, if `resume` was set: who asks for
/// it wants to keep what is done. An unfinished conversion to the same output is an Error unless `resume` or
/// `overwrite` (which then begins anew) is set. What has not come so far that something would be lost is
/// removed in all of these cases.
///
/// Several ranks share the work of all passes; scratch folder and output must be on a file system that they share.
/// Rank 0's report is of the whole. Each keeps to options.memory_bytes. When a rank throws, the others do not end by
/// themselves: whoever started them ends them, and what rank 0 leaves then is as above. Unstructured grids take one.
ConvertReport convert(const DataSource& source, const ConvertOptions& options, Progress& progress);

}  // namespace curvisplat
