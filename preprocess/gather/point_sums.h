// PointSums adds up the moments that cells give to their corners, in the order of the cells, and makes a
// splat of each point, for node-centred scalars (fields). The sums of all points (148 bytes a point with one
// field) need not fit in memory (point_pages.h). Where cells refer to points all over the mesh, cells wait on
// disk, with a copy for each range of points that they have corners in.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "preprocess/gather/corner_gather.h"
#include "preprocess/gather/outer_planes.h"
#include "preprocess/gather/point_pages.h"
#include "preprocess/moments/mesh_splats.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// Takes a splat and its values, one for each field. Several threads call it at once.
using TakeSplat = std::function<void(const NodeSplat&, std::span<const SplatScalar>)>;

/// Whether splats are fitted where nodes hang, by fitAtHangingNode() and fitToSizes(). Earlier programs did not.
enum class HangingNodes { kAsOthers, kFitted };

class PointSums {
 public:
  /// `points`: how many points there are; their numbers are less. `cells`: about how many cells will be
  /// added. `fields`: how many scalars the points have.
  PointSums(uint64_t points, uint64_t cells, size_t fields, uint64_t memory_bytes,
            const ScratchFiles& scratch);
  ~PointSums();

  /// How a pass shares its memory.
  struct Shares {
    uint64_t border_bytes, sum_bytes;
    uint64_t pages;                                        // pages of sums that are in memory
    uint64_t range_points;                                 // points that become splats together
    uint64_t cell_bytes() const { return sum_bytes / 4; }  // buffers of the streams in which cells wait
  };
  static Shares sharesOf(uint64_t cells, size_t fields, uint64_t memory_bytes);
  /// The bytes on disk of a cell that waits for a range. `face_words`: its elements in GatheredCells::faces.
  static uint64_t bytesOfWaiting(uint64_t corners, uint64_t face_words, size_t fields);

  /// Adds cells, which come in the mesh's order. One thread calls. Throws Error if the disk fails.
  void add(const GatheredCells& cells);

  struct Counts {
    uint64_t splats = 0;
    uint64_t degenerate = 0;  // points whose cells have no volume: their splats have no weight
    uint64_t halved = 0;      // cells that became two splats
    uint64_t hanging = 0;     // points or cells that were fitted where nodes hang
  };
  /// Makes the splats and passes each to `take`. Call it once, after all cells have been added. Throws Error
  /// if the disk fails, Interrupted once `progress` is stopped.
  Counts finish(const TakeSplat& take, HangingNodes hanging, const Progress& progress);

 private:
  struct PointRange {
    uint64_t first, end;
  };
  void sum(const GatheredCells& cells);
  /// Adds the cells' shares to the points of the range, which are in memory.
  void accumulate(const GatheredCells& cells, const PointRange& range);
  void write(const GatheredCells& cells);
  void sumWaiting(size_t stream, const PointRange& range, const Progress& progress);
  struct RangeOfSplats {
    PointRange points;
    OuterPlanes::OfRange planes;
    HangingNodes hanging;
  };
  void flushRange(const RangeOfSplats& range, const TakeSplat& take, Counts& counts);

  const uint64_t points_;
  const size_t fields_;
  const Shares shares_;
  const ScratchFiles scratch_;
  std::unique_ptr<SumPages> sums_;
  std::unique_ptr<class StreamsFile> waiting_;  // cells by ranges of points; null: there are none
  std::unique_ptr<PointBorders> borders_;
  std::vector<double> moments_;
};

}  // namespace curvisplat
