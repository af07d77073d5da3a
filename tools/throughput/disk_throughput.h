// How fast the disk gives a cache's own files, without anything being done with the bytes: direct and
// buffered, cold and warm, by the size of a read and by how many are under way at once. Reads are those of
// the pager (direct_file.h, async_reads.h); their places are shuffled, so that no read-ahead flatters.
//
//   disk/direct/256KiB/depth:8            past the page cache: always cold
//   disk/buffered-cold/256KiB/depth:8     the page cache emptied of the files before each sample, and looked
//   at disk/buffered-warm/256KiB/depth:8     from the page cache, and all of it found there
//   disk/direct-pread/256KiB/depth:8      by threads in pread in the place of io_uring
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "tools/throughput/measurements.h"

namespace curvisplat {

struct DiskEffort {
  double sample_s = 0.25;  // a sample ends after this, or when all has been read once
  unsigned samples = 3;
  uint64_t most_bytes = 256 << 20;  // of the files; never more than a quarter of the memory that is free
};

struct DiskRun {
  enum class Way { kDirect, kDirectPread, kBufferedCold, kBufferedWarm };

  Way way = Way::kDirect;
  uint64_t block_bytes = 256 << 10;
  unsigned depth = 8;

  /// "disk/direct/256KiB/depth:8"
  std::string name() const;
};

inline constexpr std::array<uint64_t, 4> kDiskBlocks{4 << 10, 64 << 10, 256 << 10, 1 << 20};
inline constexpr std::array<unsigned, 6> kDiskDepths{1, 2, 4, 8, 16, 32};
/// What the sweeps over one parameter keep of the other: what the pager does.
inline constexpr uint64_t kPagerBlock = 256 << 10;
inline constexpr unsigned kPagerDepth = 8;

/// In the order in which they are measured: every way over the blocks at kPagerDepth and over the depths at
/// kPagerBlock.
std::vector<DiskRun> diskRuns();

/// Adds one measurement a run, in B/s, or the reason why there is none. Throws Interrupted, and Error where a
/// file cannot be read.
void measureDisk(const CacheReader& cache, size_t variable, const DiskEffort& effort, Measurements& to,
                 Progress& progress);

}  // namespace curvisplat
