// A grid (CacheGrid) or a mesh (DrawnMesh) restricted to the samples that a cache draws, whichever scalars
// are read from it now: so every splat comes out as it did when the cache was made. DrawnNodes has the
// drawn samples, a bit each, in a temporary file; nothing that grows with the grid is in memory. Any thread
// may read, unless a function says otherwise.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/convert/memory_plan.h"
#include "preprocess/gather/mesh_reader.h"
#include "preprocess/gather/point_numbers.h"
#include "preprocess/grid/box_source.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/forwarding_mesh.h"
#include "preprocess/mesh/mesh_source.h"
#include "preprocess/seams/joint_nodes.h"
#include "preprocess/seams/thin_walls.h"
#include "preprocess/splats/node_splats.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The nodes that a cache has splats of, from the node runs of its leaves: a bit a node, in a temporary file.
/// Nodes that were merged into another one at a seam have no splat of their own, and no bit.
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
  /// Adds a node. No other thread may read meanwhile.
  void add(uint64_t node);

 private:
  OutputFile written_;
  InputFile bits_;  // bit n % 8 of byte n / 8
};

/// How the conversion that made a cache treated coincident halves of unlike thickness.
UnlikeHalves unlikeHalvesOf(const Manifest& manifest);
/// The corrections that the cache's splats were made with.
SplatRules rulesOf(const Manifest& manifest);

/// The thin walls that the cache's splats end at. Throws Error if walls.bin is damaged.
ThinWalls thinWallsOf(const CacheReader& cache);

/// A structured grid of which nodes without a splat in the cache are blanked. With cell-centred scalars,
/// cells without a splat in the cache have the value NaN.
class CacheGrid : public ForwardingGrid {
 public:
  /// Blanks what the grid itself blanks: iblank, and coordinates that are not finite. Enough for a cache
  /// whose scalars had values everywhere else. `source` must outlive it.
  explicit CacheGrid(const GridSource& source);

  /// Blanks nodes that `cache` has no splat of, too. Throws Error if a disk fails.
  void restrictTo(const CacheReader& cache, const MemoryPlan& plan,
                  const std::filesystem::path& temporary_folder, Progress& progress);
  /// Restores the nodes that were merged into others at seams, by merging the grid's faces again. To be
  /// called after restrictTo(), while no other thread reads.
  void addMergedFaces(const MemoryPlan& plan, UnlikeHalves unlike,
                      const std::filesystem::path& temporary_folder, Progress& progress);

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  void restrict(uint32_t block, const NodeBox& box, std::vector<uint8_t>& blank) const;

  std::vector<uint64_t> first_nodes_;  // [block]
  std::unique_ptr<DrawnNodes> drawn_;
  SplatRules rules_;        // of the cache
  ThinWalls walls_;         // of the cache
  bool all_faces_ = false;  // while merged ones are looked for: nodes of block faces are not restricted
};

/// An unstructured grid of which cells, or points, without a splat in the cache are hidden. Points that are
/// one (PointNumbers) are drawn together.
class DrawnMesh final : public ForwardingMesh {
 public:
  /// `source` must outlive it.
  explicit DrawnMesh(const MeshSource& source);

  /// Hides what `cache` has no splat of, too. Throws Error if a disk fails. Not while others read.
  void restrictTo(const CacheReader& cache, const MemoryPlan& plan,
                  const std::filesystem::path& temporary_folder, Progress& progress);

  bool restricted() const { return drawn_ != nullptr; }

  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  std::vector<uint64_t> first_points_, first_cells_;  // [piece]
  bool of_cells_ = false;
  std::unique_ptr<PointNumbers> numbers_;
  std::unique_ptr<DrawnNodes> drawn_;
};

}  // namespace curvisplat
