// How conversion splits the bytes it is given among what it keeps in memory. The passes follow one another,
// so each may have nearly all; what lives through several (the program itself) comes off first.
//
//    scan          2 slabs | seams: faces of cells
//    count         2 slabs | counting grid
//    scatter       2 slabs | chunk buffers | seams | cells of overlapping blocks | a task's splats a thread
//                  of a mesh: points and sums | chunk buffers | chunks of cells
//    seams         chunk buffers | seams
//    build         2 buckets (one is read while the other is built) | a brick's scratch a thread
#pragma once

#include <cstddef>
#include <cstdint>

namespace curvisplat {

struct MemoryPlan {
  uint64_t cap_bytes = 0;       // that all of it keeps
  uint64_t slab_bytes = 0;      // each of two; one of long rows may have kSlabsOfLongRows times as much
  uint64_t counting_bytes = 0;  // the counting grid
  uint64_t seam_bytes = 0;
  uint64_t owner_bytes = 0;         // the cells of overlapping blocks, while splats are made
  uint64_t mesh_bytes = 0;          // of an unstructured grid, in the place of slabs and seams
  uint64_t chunk_buffer_bytes = 0;  // the write buffers of all buckets
  uint32_t most_buckets = 0;        // of one temporary file, so that buffers stay large enough to write well
  uint64_t bucket_splats = 0;       // a bucket of more is divided again before it is built
  uint64_t bucket_bytes = 0;        // the records of such a bucket
  unsigned threads = 0;             // that may work at once: each has its scratch

  /// `threads` is what the user grants. Throws Error if `cap_bytes` is less than leastMemory().
  static MemoryPlan of(uint64_t cap_bytes, size_t variables, unsigned threads);

  /// The same, of options as they are given: 0 is defaultMemory(), or as many threads as the machine has.
  static MemoryPlan ofOptions(uint64_t cap_bytes, size_t variables, unsigned threads);

  /// The cap of which seams get so much.
  static uint64_t capForSeams(uint64_t seam_bytes);
  /// The cap of which a mesh gets so much.
  static uint64_t capForMesh(uint64_t mesh_bytes);

  /// Makes room for slabs of long rows that are so large. Throws Error that names a sufficient cap if the cap is too small for that.
  void requireSlabs(uint64_t bytes);

  /// Makes buckets smaller than they could be.
  void limitBuckets(uint64_t splats, size_t variables);
  /// A bucket's write buffer, where a file has so many buckets.
  size_t chunkBytes(uint32_t buckets) const;
  /// About the peak of a conversion of so many splats: most take less than the cap.
  uint64_t expectedPeak(uint64_t splats, size_t variables) const;
  /// What is planned for, with room for the splats that counts of nodes do not foresee.
  uint64_t plannedBucketSplats() const { return bucket_splats - bucket_splats / 5; }
};

/// The smallest cap that conversion of so many variables keeps.
uint64_t leastMemory(size_t variables);

/// What the machine has.
uint64_t machineMemory();

/// 2 GiB or a quarter of the machine's memory, the smaller.
uint64_t defaultMemory();

}  // namespace curvisplat
