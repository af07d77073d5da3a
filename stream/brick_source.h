// The bricks of a frame, decoded, in the hands of whoever projects them: from the cache of decoded bricks
// where they are there, else from the disk by the pager.
//
//   start(bricks)        cache: pin what is there      pager: read the others ahead
//   take(n)  workers     the pin, or: wait for the bytes, verify, decode (into the cache where it has room)
//
// Which bricks come from where shows in the times alone: decoding gives the same numbers always.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/brick_cache.h"
#include "stream/cache_reader.h"
#include "stream/pager.h"
#include "stream/splats.h"

namespace curvisplat {

/// What the bricks of one frame cost.
struct FetchStatistics {
  std::string way;              // how the pager reads: "io_uring, direct"
  double reading_s = 0;         // with a read under way
  double mean_queue_depth = 0;  // during that
  uint64_t bytes_read = 0, read_requests = 0;
  uint64_t bricks_cached = 0, bricks_read = 0;          // one in several parts counts for each
  uint64_t cache_peak_bytes = 0, pager_peak_bytes = 0;  // so far
  double verify_s = 0, decode_s = 0;                    // summed over workers
  double waited_s = 0;                                  // workers for reads, summed
};

class BrickSource {
 public:
  /// `cache` outlives it. `cache_bytes` may be 0. Throws Error.
  BrickSource(const CacheReader& cache, size_t variable, const PagerOptions& pager, uint64_t cache_bytes);

  /// A worker's own: memory, and what it has spent.
  struct Scratch {
    SplatGeometry geometry;
    SplatVariable values;
    ReadTimes times;
    double waited_s = 0;
  };

  /// A brick, of which `ranges` are to be drawn. Lent until the next call with the same scratch; the pin
  /// lasts as long as this.
  struct Splats {
    GeometryArrays<const float> geometry;  // from the minimum corner of `cell`
    VariableArrays<const float> values;
    Cell cell;
    SplatRanges ranges;
    std::optional<BrickCache::Pin> pin;
  };

  /// Begins a frame of such parts: their bricks are read and kept whole. Nobody may be in take() any more.
  void start(std::vector<BrickPart> parts);
  /// The `sequence`-th part; each once, any thread. Nothing once stopped. Throws Error naming the brick
  /// where the disk fails, a file has shrunk, or a checksum does not match.
  std::optional<Splats> take(uint64_t sequence, Scratch& scratch);
  /// For a part that take() has failed on: the octant of the nearest ancestor that can be read which stands
  /// for it; of that octant, splats that stand for something else have no weight. Nothing if no ancestor can
  /// be read.
  std::optional<Splats> standIn(const BrickPart& part, Scratch& scratch) const;

  /// Begins to fill the cache with what it lacks of the bricks, as far as there is room without them.
  void startPrefetch(std::span<const BrickPart> parts);
  /// Takes the next brick of the prefetch. False: none is left, there is no more room, or it was stopped.
  /// Throws as take() does.
  bool prefetchNext(Scratch& scratch);

  /// Wakes who waits in take() or prefetchNext(). Any thread.
  void stop();
  /// After the last take() of a frame: lets go of what was not taken. Tells what was counted since start();
  /// the workers' sums are left as they are.
  void finish(FetchStatistics& statistics);

  const BrickCache& cached() const { return cached_; }

 private:
  void decode(uint32_t brick, const PagedBrick& bytes, const GeometryArrays<float>& geometry,
              const VariableArrays<float>& values, Scratch& scratch) const;
  std::optional<PagedBrick> await(uint64_t miss, Scratch& scratch);
  SplatRanges weighFor(const BrickPart& part, uint32_t ancestor, SplatGeometry& geometry) const;
  float shareOfCell(uint32_t brick) const;

  const CacheReader& cache_;
  const size_t variable_;
  BrickCache cached_;
  BrickPager pager_;

  std::vector<BrickPart> parts_;                      // [sequence], of a frame
  std::vector<std::optional<BrickCache::Pin>> pins_;  // [sequence]
  std::vector<uint32_t> misses_;                      // [sequence]: place among those read
  uint64_t reads_ = 0;                                // bricks that the pager was asked for
  std::vector<uint32_t> wanted_;                      // bricks of a prefetch
  std::atomic<uint64_t> next_prefetch_ = 0;
  PagerStatistics before_;
};

}  // namespace curvisplat
