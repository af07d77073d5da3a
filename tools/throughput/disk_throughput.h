// Measures how fast a cache's files can be read, without processing the bytes: direct and buffered, cold and
// warm, over the size of a read and the number of reads in flight (depth). Uses the pager's own reads
// (stream/paging/async_reads.h) at shuffled offsets, so that read-ahead does not distort the result.
//
//   disk/direct/256KiB/depth:8           bypasses the page cache: always cold
//   disk/buffered-cold/256KiB/depth:8    evicted from the page cache before each sample, checked with mincore
//   disk/buffered-warm/256KiB/depth:8    from the page cache, checked with mincore
//   disk/direct-pread/256KiB/depth:8     direct, by threads calling pread instead of io_uring
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
  double sample_s = 0.25;  // a sample ends after this time, or when everything was read once
  unsigned samples = 3;
  uint64_t max_bytes = 256 << 20;  // read at most this much of the files, and at most 1/4 of available memory
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
/// The pager's values: one parameter has its own while the other is varied.
inline constexpr uint64_t kPagerBlock = 256 << 10;
inline constexpr unsigned kPagerDepth = 8;

/// All runs in the order of measurement: for every way, all block sizes at kPagerDepth and all depths at
/// kPagerBlock.
std::vector<DiskRun> diskRuns();

/// Adds for each run one measurement, in B/s, or the reason why it was not measured. Throws Interrupted, and
/// Error if a file cannot be read.
void measureDisk(const CacheReader& cache, size_t variable, const DiskEffort& effort, Measurements& to,
                 Progress& progress);

}  // namespace curvisplat
