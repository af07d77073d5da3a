// How a conversion divides the memory it may use. The passes run one after the other, so each may use nearly
// all of it, less what the program itself needs throughout.
//
//    scan          2 slabs | seams: faces of cells
//    overlaps      2 slabs | points of blocks
//    count         2 slabs | counting grid
//    scatter       2 slabs | a row that is read as a whole | chunk buffers | seams | cells of overlapping blocks
//                  a task's splats a thread
//                  of a mesh: points and sums | chunk buffers | chunks of cells
//    seams         chunk buffers | seams
//    build         2 buckets (one is read while the other is built) | a brick's scratch a thread | a chunk a reader
//                  index records, which grow with the samples
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "preprocess/survey/block_overlap.h"

namespace curvisplat {

/// Limits that tests set below what memory would allow, so that small grids are processed like large ones.
struct TestLimits {
  std::optional<uint64_t> bucket_splats, slab_bytes, owner_bytes, mesh_bytes;  // MemoryPlan's
  std::optional<uint32_t> most_buckets;
  std::chrono::milliseconds note_interval{10'000};  // how often scatter() notes what is on disk
};

struct MemoryPlan {
  uint64_t cap_bytes = 0;       // limit of the process
  uint64_t slab_bytes = 0;      // of each of two slabs; also of a row, where a source reads whole rows
  uint64_t counting_bytes = 0;  // the counting grid
  uint64_t seam_bytes = 0;
  uint64_t overlap_bytes = 0;       // the points by which overlaps of blocks are found
  uint64_t owner_bytes = 0;         // the cells of overlapping blocks, while splats are made
  uint64_t mesh_bytes = 0;          // of an unstructured grid, instead of slabs and seams
  uint64_t chunk_buffer_bytes = 0;  // the write buffers of all buckets
  uint32_t most_buckets = 0;        // in a temporary file; with more, write buffers would be too small
  uint64_t bucket_splats = 0;       // larger buckets are divided before they are built
  uint64_t bucket_bytes = 0;        // the records of such a bucket
  unsigned threads = 0;             // working at once, each with scratch memory

  /// `threads` is what the user grants. Throws Error if `cap_bytes` is less than leastMemory().
  static MemoryPlan of(uint64_t cap_bytes, size_t variables, unsigned threads);

  /// Makes the plan as of() does, but 0 stands for defaultMemory(), or for as many threads as the machine
  /// has.
  static MemoryPlan ofOptions(uint64_t cap_bytes, size_t variables, unsigned threads);

  /// The smallest cap_bytes with which a plan's seam_bytes is at least this.
  static uint64_t capForSeams(uint64_t seam_bytes);
  /// The smallest cap_bytes with which a plan's overlap_bytes is at least this.
  static uint64_t capForOverlaps(uint64_t overlap_bytes);
  /// The smallest cap_bytes with which a plan's mesh_bytes is at least this.
  static uint64_t capForMesh(uint64_t mesh_bytes);

  /// The memory that the search for overlaps may take.
  OverlapMemory forOverlaps() const { return {slab_bytes, overlap_bytes, capForOverlaps}; }

  /// Throws Error that names a sufficient limit if a row of `bytes` does not fit beside the slabs. `block`: the name of
  /// its block; `nodes`: its nodes along i.
  void requireRow(const std::string& block, uint64_t nodes, uint64_t bytes) const;

  /// Throws Error that names a sufficient limit if cutting the grid's faces into patches takes more than the
  /// plan has.
  void requireFaces(uint64_t bytes) const;

  /// Makes slabs and buckets no larger than a grid of `samples` needs. Then one can be read while another is
  /// processed, and memory is reused: new memory costs a page fault for every 4 KiB. Also leaves memory for
  /// the index of very many samples. Throws Error that names a sufficient limit if none is left.
  void suit(uint64_t samples, size_t variables);
  /// Lowers what `limits` sets.
  void limitTo(const TestLimits& limits, size_t variables);
  /// Limits the size of a bucket to `splats`, if it is larger.
  void limitBuckets(uint64_t splats, size_t variables);
  /// The size of a bucket's write buffer in a file of `buckets`.
  size_t chunkBytes(uint32_t buckets) const;
  /// The approximate peak memory, in bytes, of a conversion of `splats`. It is often less than the limit.
  uint64_t expectedPeak(uint64_t splats, size_t variables) const;
  /// The size that buckets are planned for, with a reserve for splats that the count of nodes misses.
  uint64_t plannedBucketSplats() const { return bucket_splats - bucket_splats / 5; }
  /// The number of threads that read a bucket: few, since reading and grouping take a seventh of the
  /// processor time of building.
  unsigned bucketReaders() const;

 private:
  void leaveIndex(uint64_t samples, size_t variables);
};

/// The smallest limit, in bytes, within which this many variables can be converted.
uint64_t leastMemory(size_t variables);

/// The machine's memory in bytes.
uint64_t machineMemory();

/// The limit where the user gives none: 2 GiB, or a quarter of the machine's memory if that is less.
uint64_t defaultMemory();

}  // namespace curvisplat
