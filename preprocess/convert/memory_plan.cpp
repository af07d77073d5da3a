#include "preprocess/convert/memory_plan.h"

#include <tbb/info.h>
#include <unistd.h>

#include <algorithm>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/splat_record.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/memory.h"
#include "stream/base/text.h"
#include "stream/model/octree.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMiB = uint64_t{1} << 20;

// Memory for the program, thread stacks and kUsualIndexBytes of index records, and the share of the cap that
// the allocator holds back. Pages of libraries take 57 of these 82 MiB (RssFile of a conversion of NetCDF
// tiles); the rest has room for what HDF5 keeps of its files.
constexpr uint64_t kProgramBytes = 82 * kMiB;
constexpr uint64_t kAllocatorShare = 16;
// Gaps between blocks of several threads, for each thread that shares a heap. With 5 threads up to 22 MiB
// more than planned were in use, with 9 up to 16.
constexpr uint64_t kGapBytes = 3 * kMiB;
constexpr uint64_t kSeamShare = 8, kSlabShare = 8, kMeshShare = 2, kOverlapShare = 4;  // of the rest
// The fewest splats of a bucket: some bricks for each thread to work on.
constexpr uint64_t kMinBucketSplats = 4 * kMaxBrickSplats;
constexpr uint64_t kMinChunkBytes = kMiB / 8, kMaxChunkBytes = kMiB;
constexpr uint32_t kMaxBuckets = 4096;
// Samples for each brick of the cache: 17,000 to 25,000 in grids that fill their leaves.
constexpr uint64_t kSamplesABrick = 16384;
constexpr uint64_t kUsualIndexBytes = 16 * kMiB;

/// Making a brick of kMaxBrickSplats: its splats in double, what the codec lays beside them, and the voxels
/// that they merge into.
uint64_t brickScratchBytes(size_t variables) {
  return kMaxBrickSplats * (200 + 100 * variables);
}

/// Bytes for a splat of a bucket: its record, its place in two orders, and its encoded form.
uint64_t bucketBytesPerSplat(size_t variables) {
  return regularRecordBytes(variables) + 2 * sizeof(uint32_t) + 12 + 10 * variables;
}

unsigned bucketReadersFor(unsigned threads) {
  return std::min(threads, static_cast<unsigned>(BucketChains::kCount));
}

/// The memory that the threads of build need beside the buckets. The first reader's chunk is the program's.
uint64_t threadBytes(unsigned threads, size_t variables) {
  const uint64_t gaps = threads > kHeapsOfConversion ? (threads - kHeapsOfConversion) * kGapBytes : 0;
  return threads * brickScratchBytes(variables) + (bucketReadersFor(threads) - 1) * kMaxChunkBytes + gaps;
}

/// The index records that the writer of the cache holds, beyond the usual ones. They grow while bricks are appended: a vector
/// that grows has twice of what it holds.
uint64_t indexBytes(uint64_t samples, size_t variables) {
  const uint64_t brick = sizeof(Brick) + sizeof(double) + variables * sizeof(BrickVariable);
  const uint64_t bytes = samples / kSamplesABrick * 2 * brick;
  return bytes - std::min(bytes, kUsualIndexBytes);
}

/// The cap that leaves `bytes` to be shared out.
uint64_t capFor(uint64_t bytes) {
  const uint64_t exact = bytes + kProgramBytes;
  return exact + exact / (kAllocatorShare - 1) + kAllocatorShare;
}

}  // namespace

uint64_t leastMemory(size_t variables) {
  const uint64_t two_buckets = 2 * kMinBucketSplats * bucketBytesPerSplat(variables);
  const uint64_t exact = kProgramBytes + brickScratchBytes(variables) + two_buckets;
  const uint64_t held_back = exact / (kAllocatorShare - 1) + 1;
  return (exact + held_back + 16 * kMiB - 1) / (16 * kMiB) * (16 * kMiB);
}

uint64_t machineMemory() {
  const auto pages = static_cast<uint64_t>(::sysconf(_SC_PHYS_PAGES));
  const auto page_bytes = static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
  return pages * page_bytes;
}

uint64_t defaultMemory() {
  return std::min<uint64_t>(2048 * kMiB, machineMemory() / 4);
}

MemoryPlan MemoryPlan::of(uint64_t cap_bytes, size_t variables, unsigned threads) {
  if (cap_bytes < leastMemory(variables))
    throw Error("--memory {}: conversion of {} takes at least {}", byteText(cap_bytes),
                countText(variables, "scalar"), byteText(leastMemory(variables)));
  const uint64_t bytes = cap_bytes - cap_bytes / kAllocatorShare - kProgramBytes;

  MemoryPlan plan;
  plan.cap_bytes = cap_bytes;
  plan.slab_bytes = std::min(bytes / kSlabShare, 256 * kMiB);
  plan.counting_bytes = bytes / 8;
  plan.seam_bytes = bytes / kSeamShare;
  plan.overlap_bytes = bytes / kOverlapShare;
  plan.owner_bytes = bytes / 8;
  plan.mesh_bytes = bytes / kMeshShare;

  plan.chunk_buffer_bytes = bytes / 4;
  plan.most_buckets =
      static_cast<uint32_t>(std::min<uint64_t>(plan.chunk_buffer_bytes / kMinChunkBytes, kMaxBuckets));

  const uint64_t scratch = brickScratchBytes(variables);
  const uint64_t least_buckets = 2 * kMinBucketSplats * bucketBytesPerSplat(variables);
  const uint64_t affordable = std::max<uint64_t>(1, (bytes - least_buckets) / (2 * scratch));
  plan.threads = static_cast<unsigned>(std::min<uint64_t>(std::max(1u, threads), affordable));
  plan.bucket_splats = (bytes - threadBytes(plan.threads, variables)) / (2 * bucketBytesPerSplat(variables));
  // More makes nothing faster; and places in a bucket are of 32 bits.
  plan.bucket_splats = std::min<uint64_t>(
      {plan.bucket_splats, uint64_t{1} << 24, UINT32_MAX / irregularRecordBytes(variables)});
  plan.bucket_bytes = plan.bucket_splats * regularRecordBytes(variables);
  return plan;
}

MemoryPlan MemoryPlan::ofOptions(uint64_t cap_bytes, size_t variables, unsigned threads) {
  return of(cap_bytes > 0 ? cap_bytes : defaultMemory(), variables,
            threads > 0 ? threads : static_cast<unsigned>(tbb::info::default_concurrency()));
}

uint64_t MemoryPlan::capForSeams(uint64_t seam_bytes) {
  return capFor(seam_bytes * kSeamShare);
}

uint64_t MemoryPlan::capForOverlaps(uint64_t overlap_bytes) {
  return capFor(overlap_bytes * kOverlapShare);
}

uint64_t MemoryPlan::capForMesh(uint64_t mesh_bytes) {
  return capFor(mesh_bytes * kMeshShare);
}

void MemoryPlan::requireRow(const std::string& block, uint64_t nodes, uint64_t bytes) const {
  if (const uint64_t cap = capFor(bytes * kSlabShare); cap > cap_bytes)
    throw Error(
        "--memory {}: {}: a row of {} nodes along i does not fit, and this format is read by whole rows; "
        "give at least {} MiB",
        byteText(cap_bytes), block, nodes, (cap >> 20) + 1);
}

void MemoryPlan::requireFaces(uint64_t bytes) const {
  if (const uint64_t cap = capFor(bytes); cap > cap_bytes)
    throw Error(
        "--memory {}: the outer faces of this grid take up to {} MiB; give at least {} MiB, or add "
        "--no-surfaces",
        byteText(cap_bytes), (bytes >> 20) + 1, (cap >> 20) + 1);
}

uint64_t MemoryPlan::expectedPeak(uint64_t splats, size_t variables) const {
  // Cells fill a bucket to three quarters, mostly; two are in memory.
  const uint64_t in_buckets = std::min(splats, plannedBucketSplats() * 3 / 2);
  const uint64_t build = in_buckets * bucketBytesPerSplat(variables) + threadBytes(threads, variables) +
                         indexBytes(splats, variables);
  const uint64_t slabs = 2 * std::min(slab_bytes, splats * slabBytesPerNode(variables));
  const uint64_t buckets = 3 * splats / (2 * plannedBucketSplats()) + 1;
  const uint64_t scatter = slabs + std::min({chunk_buffer_bytes, splats * regularRecordBytes(variables),
                                             buckets * kMaxChunkBytes});
  // The counting grid takes half of what it may, the other half is for its coarser levels.
  return std::min(cap_bytes, kProgramBytes + std::max({build, slabs + counting_bytes / 2, scatter}));
}

void MemoryPlan::suit(uint64_t samples, size_t variables) {
  // A slab's halo is read twice, so they are fewer and larger; a cell above buckets is merged from bricks that are read back.
  constexpr uint64_t kSlabs = 24, kMinSlabBytes = 48 * kMiB;
  constexpr uint64_t kBuckets = 4, kBricksOfThread = 10;
  slab_bytes = std::min(slab_bytes, std::max(kMinSlabBytes, samples * slabBytesPerNode(variables) / kSlabs));
  limitBuckets(std::max(samples / kBuckets, threads * kBricksOfThread * kMaxBrickSplats), variables);
  leaveIndex(samples, variables);
}

void MemoryPlan::leaveIndex(uint64_t samples, size_t variables) {
  const uint64_t index = indexBytes(samples, variables), scratch = brickScratchBytes(variables);
  const uint64_t a_splat = 2 * bucketBytesPerSplat(variables), least_buckets = kMinBucketSplats * a_splat;
  const uint64_t bytes = cap_bytes - cap_bytes / kAllocatorShare - kProgramBytes;
  const uint64_t least = index + scratch + least_buckets;
  if (least > bytes)
    throw Error(
        "--memory {}: the index of {} samples takes {} beside what conversion takes; give at least {} MiB",
        byteText(cap_bytes), samples, byteText(index), (capFor(least) >> 20) + 1);
  const uint64_t affordable = std::max<uint64_t>(1, (bytes - index - least_buckets) / (2 * scratch));
  threads = static_cast<unsigned>(std::min<uint64_t>(threads, affordable));
  limitBuckets((bytes - index - threadBytes(threads, variables)) / a_splat, variables);
}

void MemoryPlan::limitTo(const TestLimits& limits, size_t variables) {
  if (limits.slab_bytes) slab_bytes = *limits.slab_bytes;
  if (limits.owner_bytes) owner_bytes = *limits.owner_bytes;
  if (limits.mesh_bytes) mesh_bytes = *limits.mesh_bytes;
  if (limits.most_buckets) most_buckets = *limits.most_buckets;
  if (limits.bucket_splats) limitBuckets(*limits.bucket_splats, variables);
}

void MemoryPlan::limitBuckets(uint64_t splats, size_t variables) {
  bucket_splats = std::min(bucket_splats, splats);
  bucket_bytes = bucket_splats * regularRecordBytes(variables);
}

unsigned MemoryPlan::bucketReaders() const {
  return bucketReadersFor(threads);
}

size_t MemoryPlan::chunkBytes(uint32_t buckets) const {
  const uint64_t bytes =
      std::clamp(chunk_buffer_bytes / std::max(1u, buckets), kMinChunkBytes, kMaxChunkBytes);
  return bytes / kDirectAlignment * kDirectAlignment;
}

}  // namespace curvisplat
