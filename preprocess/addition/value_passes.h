// The passes that bring the values of scalars to the bricks of a cache whose geometry is that of the grid,
// and to the faces of the grid that the cache has: what adding a scalar and adding a time step have in
// common.
//
//   scatter   the grid's splats go to buckets of bricks; those of block faces to the seam merger
//   seams     the merged splats of block faces follow
//   build     bucket after bucket, the streams
//   faces     a file of faces with the new values
//
// Several ranks scatter together: each a share of the grid, into a file of its own. Rank 0 merges the seams
// and builds, from all ranks' files. One thread calls; passes are parallel loops.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/addition/series_steps.h"
#include "preprocess/addition/value_buckets.h"
#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/splat_origin.h"
#include "preprocess/convert/value_sample.h"
#include "preprocess/faces/grid_faces_pass.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/seams/seams.h"
#include "preprocess/survey/block_overlap.h"
#include "stream/base/progress.h"
#include "stream/base/ranks.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/values_writer.h"

namespace curvisplat {

/// The passes up to "build", to be called in order.
class ValuePasses {
 public:
  /// All references must outlive it. `scratch`: a folder for temporary files.
  ValuePasses(const CacheReader& cache, size_t variables, const MemoryPlan& plan,
              std::filesystem::path scratch, Progress& progress);

  /// Shares the work among ranks: all of them call scatter() and mergeSeams() together, and rank 0 alone
  /// build(). Call it before scatter(). `shared`: a folder for temporary files that all of them see. The plan
  /// has to be the same at all ranks (commonPlan()).
  void shareWith(Ranks& ranks, std::filesystem::path shared);
  /// Sets the overlaps of the grid's blocks, for a cache in which each point is drawn once. Call it before
  /// scatter().
  void setOverlaps(std::vector<BlockOverlap> overlaps) { overlaps_ = std::move(overlaps); }
  /// Scatters the values of a structured grid. `see`: SlabPass::see. Throws Error if the cache has no cell
  /// for a splat.
  void scatter(const NodeReader& reader, std::function<void(const LoadedSlab&)> see = {});
  /// Scatters the values of an unstructured grid, after its survey(). Rank 0 alone makes the splats.
  void scatter(SplatOrigin& origin);
  void mergeSeams();
  /// A warning if values at some thin walls are means of both sides, else empty. They are if both sides had
  /// equal values when the geometry was made, or if an older version of the program made it. Call it after
  /// mergeSeams().
  const std::string& warningOfWalls() const { return warning_of_walls_; }
  /// `references`: what the values are predicted from; may be null. Throws Error if the splats are not those
  /// of the cache.
  void build(ValuesWriter& writer, const StepReferences* references = nullptr);

  /// The bytes of the scattered values of all ranks, at rank 0 after mergeSeams().
  uint64_t temporaryBytes() const { return temporary_bytes_; }

 private:
  std::filesystem::path fileOf(unsigned rank) const;
  void openFile();
  void joinFiles();
  ValueSink newSink() { return {*cache_, order_, buckets_, grouped_, *file_, sample_}; }

  const CacheReader* cache_;
  const size_t variables_;
  const MemoryPlan plan_;
  const std::filesystem::path scratch_;
  Progress* progress_;
  Ranks* ranks_ = &oneRank();
  std::filesystem::path shared_;  // of all ranks
  const ConversionOrder order_;
  const ValueBuckets buckets_;
  const uint32_t grouped_;
  std::vector<BlockOverlap> overlaps_;
  ValueSample sample_;
  std::unique_ptr<BucketFile> file_;
  std::unique_ptr<SeamMerger> seams_;
  const NodeReader* reader_ = nullptr;  // of a structured grid, whose values are scattered
  std::string warning_of_walls_;
  uint64_t temporary_bytes_ = 0;
};

/// Faces of a cache's grid with further values: of scalars that are added, or of a time step.
struct FurtherFaces {
  const CacheReader& cache;  // at a step of the geometry
  const NodeReader& reader;  // of the grid, with the values
  std::filesystem::path scratch;
  std::string name;                 // of the file, in the cache's own folder
  std::vector<uint32_t> variables;  // numbers in the cache
};

/// Writes the faces that faces.bin of the geometry has: outer faces, and the index planes inside of blocks
/// that `convert --surface` has kept. Returns nullopt and writes nothing if there is no faces.bin. Reads the
/// faces' slabs of the grid once more. Throws Error as writeGridFaces().
std::optional<FileInfo> writeFurtherFaces(const FurtherFaces& job, const MemoryPlan& plan,
                                          Progress& progress);

/// The index planes inside of blocks that a cache has.
std::vector<IndexPlane> planesOf(const CacheReader& cache);
/// Whether the cache has the faces of blanked cells.
bool hasFacesOfBlanks(const CacheReader& cache);

}  // namespace curvisplat
