// SplatOrigin, the interface between what makes splats and the passes that put them into a cache: a structured
// grid is one origin (grid_origin.h). Conversion calls, in this order and in one thread:
//
//    survey()   --> bounds, ranges, number of samples
//    warnings()
//    count()    --> where the splats are dense, about
//    scatter()  --> splats, from any number of threads
//    finish()   --> the splats that had to wait for all others
//
// and writeFaces(). A conversion that is resumed calls none of the others once all splats are on disk. While only
// some are, survey() comes again, and scatter() goes on.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "preprocess/convert/bucket_plan.h"
#include "preprocess/faces/grid_faces_pass.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/splats/node_splats.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/progress.h"
#include "stream/model/octree.h"
#include "stream/model/thin_walls.h"

namespace curvisplat {

/// The destination of a pass's splats.
class SplatSink {
 public:
  virtual ~SplatSink() = default;
  /// One value for each scalar that is converted.
  virtual void add(const NodeSplat& splat, std::span<const SplatScalar> values) = 0;
};

/// Gives a sink of the calling thread's own, always the same one.
using SinkOfThread = std::function<SplatSink&()>;

/// Bytes.
struct TemporaryNeeds {
  uint64_t before_splats = 0,
           beside_splats = 0;  // until the first splat is made, and from there until the last one
  uint64_t lasting = 0;        // until the cache is done
  uint64_t splats = 0;         // at the most, where they may be more than the samples
};

/// Cells of each handedness.
struct Handedness {
  uint64_t right = 0, left = 0;
};

/// How far scatter() has come: all that it makes of the first `slabs` was sent, but what waits for finish().
struct ScatterState {
  uint64_t slab_bytes = 0;  // that the grid was cut into slabs for
  uint64_t slabs = 0;
  uint64_t degenerate = 0;
  std::vector<Handedness> handedness;  // [block]
};

/// Notes about a scatter() that may be interrupted: where it goes on, and how it notes what is done.
struct ScatterNotes {
  const ScatterState* from = nullptr;  // null: at the beginning
  /// Whether it is time for a note; empty: never.
  std::function<bool()> is_due;
  /// Called by the thread of scatter() while no splat is being made.
  std::function<void(const ScatterState&)> note;
};

struct ScatterCounts {
  uint64_t degenerate = 0;  // splats with a floored axis
  uint64_t inverted = 0;    // cells of the handedness that fewer of their block's cells have
  uint64_t halved = 0;      // cells of a mesh that became two splats
  uint64_t hanging = 0;     // points or cells of a mesh that are fitted where nodes hang
};

/// Makes splats of a grid. Results depend on its files, scalars and blank value alone: not on threads or
/// memory. All functions throw Error if a file or the disk fails, and Interrupted if the progress is stopped.
class SplatOrigin {
 public:
  virtual ~SplatOrigin() = default;

  virtual const GridDescription& description() const = 0;
  /// Whether the samples are nodes or cells.
  virtual Centring centring() const = 0;
  /// The samples' numbers count through these, i fastest; NodeSplat::node is one.
  virtual const std::vector<GridBlock>& blocks() const = 0;
  /// The needs of temporary files beside the splats' in survey() and scatter(): at the most, and as a
  /// forecast, for which the grid may be read once.
  virtual TemporaryNeeds mostTemporaryNeeds() const { return {}; }
  virtual TemporaryNeeds temporaryNeeds(const Progress&) const { return mostTemporaryNeeds(); }
  /// Bytes of all temporary files together, and of those that are counted beside them, at the moment when they were the most.
  virtual uint64_t temporaryBytes() const { return 0; }

  /// Whether ranks make the splats together, each with an origin of the same files. Then all of them call the functions below: survey()
  /// returns the whole's result, count() and scatter() count and make the splats of a share, and finish() brings those that had to wait to
  /// rank 0, whose sink gets them. If not, rank 0 alone calls them.
  virtual bool isShared() const { return false; }

  /// Throws Error if there is nothing to draw.
  virtual GridSurvey survey(Progress& progress) = 0;
  /// Warnings about what is odd in the grid, a line each.
  virtual std::vector<std::string> warnings() { return {}; }
  /// Notes about what was chosen for the grid, a line each.
  virtual std::vector<std::string> notes() { return {}; }
  /// Manifest::overlap.
  virtual std::string overlap() const { return ""; }
  /// Whether splats lose what reaches into blanked cells (kCellOctants).
  virtual bool cutsOctants() const { return false; }
  /// One in how many splats count() looks at, the same at all ranks. After survey().
  virtual uint32_t splatsPerCounted() const { return 1; }
  /// Counts the splats by cells of `root`, about: a wrong count makes buckets of uneven sizes, no other cache.
  virtual void count(const RootCube& root, CountingGrid& counts, Progress& progress) = 0;
  /// An origin need not note anything. Where it goes on, survey() has been called, too.
  virtual ScatterCounts scatter(const SinkOfThread& sink_of_thread, const ScatterNotes& notes,
                                Progress& progress) = 0;
  /// Returns how many samples became part of another one's splat.
  virtual uint64_t finish(const SinkOfThread&, Progress&) { return 0; }
  /// The boxes of walls.bin, after finish().
  virtual std::vector<WallSide> thinWalls() const { return {}; }
  /// Empty, or a warning of thin walls that are not kept, after finish().
  virtual std::string warningOfWalls() const { return ""; }
  /// Writes the surfaces of what the splats fill, if it has any. Call it at any time, after a resumed
  /// conversion too.
  virtual FacesFiles writeFaces(const FacesJob&, Progress&) { return {}; }
};

}  // namespace curvisplat
