// Supplies the decoded bricks of a frame to the workers that project them: from the cache of decoded bricks
// if they are in it, otherwise from the disk through the pager.
//
//   start(parts)         cache: pin the bricks it has    pager: read the others ahead
//   fetch(n) workers     the pin, or: wait for the bytes, verify, decode (into the cache if it has space)
//
// A second variable, if there is one, is read and kept like the first.
//
// No brick has two parts in a frame. Where a brick comes from affects times only: decoding always gives the
// same numbers.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "stream/cache/series_values.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"
#include "stream/paging/brick_cache.h"
#include "stream/paging/layer_merger.h"
#include "stream/paging/pager.h"

namespace curvisplat {

/// The costs of the bricks of one frame. Seconds of several workers are summed.
struct FetchStatistics {
  double read_s = 0;  // with a read under way
  double verify_s = 0, decode_s = 0;
  double read_waited_s = 0;     // that workers waited for reads
  double mean_queue_depth = 0;  // while a read was under way
  uint64_t bytes_read = 0, read_requests = 0;
  uint64_t bricks_cached = 0, bricks_read = 0;
  uint64_t bricks_left_out = 0, bytes_left_out = 0;     // not read, since no longer needed
  uint64_t bricks_resident = 0, cache_bytes = 0;        // decoded and kept, of this frame and others
  uint64_t kept_bytes = 0;                              // decoded values of several steps
  uint64_t cache_peak_bytes = 0, pager_peak_bytes = 0;  // so far
  std::string read_by;                                  // for example "io_uring, direct"
};

/// Serves the decoded bricks of one frame after another.
class BrickSource {
 public:
  using Variables = ReadVariables;
  /// `cache` outlives it. `cache_bytes` may be 0; `kept_bytes`, for values of several steps, too. Throws Error.
  BrickSource(const CacheReader& cache, const Variables& variables, const PagerOptions& pager,
              uint64_t cache_bytes, uint64_t kept_bytes = 0);

  /// One worker's memory and the time it has spent.
  struct Scratch {
    SplatGeometry geometry;
    SplatVariable values, second;
    LayerMerger merger;
    ReadTimes times;
    double waited_s = 0;
  };

  /// The splats of a part. The spans are valid until the next call with the same scratch, and as long as
  /// `pin`.
  struct Splats {
    GeometryArrays<const float> geometry;  // world units; positions from the lowest corner of `cell`
    VariableArrays<const float> values;
    SplatRanges ranges;  // of the part
    Cell cell;
    std::optional<BrickCache::Pin> pin;
    std::optional<VariableArrays<const float>> second = std::nullopt;  // where there is a second variable
  };

  /// How layers are merged in a frame: BrickPart::merging counts from 1.
  using Mergings = std::vector<std::shared_ptr<const LayerMerging>>;

  /// Begins a frame of at most one part of each brick. No thread may be in fetch(). `unneeded`: see
  /// BrickPager.
  void start(std::span<const BrickPart> parts, BrickPager::Unneeded unneeded = {},
             const Mergings& mergings = {});
  /// The splats of the `sequence`-th part; once for each part, on any thread. nullopt after stop(). No splats if
  /// `unneeded` returned true for the brick. Throws as CacheReader does, DamagedBrick or Error, and Error if
  /// the pager failed.
  std::optional<Splats> fetch(uint64_t sequence, Scratch& scratch);
  /// Instead of fetch(), for a part whose brick `unneeded` returns true for: gives up its pin or bytes.
  void pass(uint64_t sequence);
  /// Replaces a damaged part by the splats that its nearest undamaged ancestor has in the same space. No splats if
  /// all ancestors are damaged. Throws Error if the disk fails.
  Splats standIn(const BrickPart& part, Scratch& scratch) const;

  /// Says that the cache is at another step of the same geometry. The geometry of decoded bricks is kept; their
  /// values are decoded anew when they are fetched. No thread may be in fetch() or prefetchNext(). Throws Error.
  void stepChanged();

  /// Begins to fill the cache with the bricks of `parts`, in their order, as far as they fit.
  void startPrefetch(std::span<const BrickPart> parts, const Mergings& mergings = {});
  /// Takes the next brick of the prefetch. False if none is left, if the cache is full, or after stop().
  /// Throws as fetch() does.
  bool prefetchNext(Scratch& scratch);

  /// Wakes the threads that wait in fetch() or prefetchNext(). Call it from any thread.
  void stop();
  /// Ends the frame: gives up what was not taken, and adds what the frame cost to `statistics`, except the
  /// workers' sums.
  void finish(FetchStatistics& statistics);

  const BrickCache& cached() const { return cached_; }

 private:
  std::optional<Splats> read(const BrickPart& part, uint64_t miss, Scratch& scratch);
  void refresh(const BrickCache::Pin& pin, uint32_t brick, Scratch& scratch);
  Splats readAlone(const BrickPart& part, Scratch& scratch) const;
  const LayerMerging* mergingOf(const BrickPart& part) const;
  BrickKey keyOf(const BrickPart& part) const;
  std::vector<BrickKey> keysOf(std::span<const BrickPart> parts) const;
  void merge(const BrickPart& part, Scratch& scratch) const;
  std::optional<BrickCache::Pin> decodeInto(const BrickPart& part, const PagedBrick& bytes, Scratch& scratch);
  SplatRanges rangesOf(const BrickPart& part, size_t decoded) const;
  Splats splatsOf(BrickCache::Pin pin, const BrickPart& part) const;
  Splats splatsOf(const Scratch& scratch, const BrickPart& part) const;
  void decode(uint32_t brick, const PagedBrick& bytes, const BrickCache::Slot& slot, Scratch& scratch);
  void decode(uint32_t brick, const PagedBrick& bytes, Scratch& scratch);
  std::optional<PagedBrick> await(uint64_t miss, Scratch& scratch);
  void keepPart(const BrickPart& part, uint32_t ancestor, Scratch& scratch) const;
  void readAncestor(uint32_t brick, Scratch& scratch) const;

  const CacheReader& cache_;
  const size_t variable_;
  const std::optional<size_t> second_;
  BrickCache cached_;
  KeptValues kept_;  // of this step and others: those that it is predicted from, or lies between
  BrickPager pager_;

  std::vector<BrickPart> parts_;  // [sequence]
  Mergings mergings_;
  std::vector<std::optional<BrickCache::Pin>> pins_;  // [sequence]
  std::vector<uint32_t> misses_;                      // [sequence]: place among those read
  std::vector<BrickPart> to_prefetch_, to_refresh_;
  uint64_t reads_ = 0, hits_ = 0;  // bricks that the pager was asked for, and that it was not
  std::atomic<uint64_t> next_prefetch_ = 0;
  std::atomic<bool> prefetch_stopped_ = false;
  PagerStatistics before_;
};

}  // namespace curvisplat
