// Supplies the decoded bricks of a frame to the workers that project them: from the cache of decoded bricks
// if they are in it, otherwise from the disk through the pager.
//
//   start(parts)         cache: pin what is there      pager: read the others ahead
//   take(n)  workers     the pin, or: wait for the bytes, verify, decode (into the cache where it has room)
//
// A brick that is drawn in several parts is read once: the first worker decodes it, the others wait. Where a
// brick comes from affects times only: decoding always gives the same numbers.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "stream/model/brick.h"
#include "stream/model/splats.h"
#include "stream/paging/brick_cache.h"
#include "stream/paging/pager.h"

namespace curvisplat {

/// What the bricks of one frame cost. Seconds of several workers are summed.
struct FetchStatistics {
  double read_s = 0;  // with a read under way
  double verify_s = 0, decode_s = 0;
  double read_waited_s = 0;     // workers for reads
  double mean_queue_depth = 0;  // while a read was under way
  uint64_t bytes_read = 0, read_requests = 0;
  uint64_t bricks_cached = 0, bricks_read = 0;          // one in several parts counts once
  uint64_t bricks_left_out = 0, bytes_left_out = 0;     // not read, since nobody needed them any more
  uint64_t bricks_resident = 0, cache_bytes = 0;        // decoded and kept, of this frame and others
  uint64_t cache_peak_bytes = 0, pager_peak_bytes = 0;  // so far
  std::string read_by;                                  // "io_uring, direct"
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

  /// Lent until the next call with the same scratch; the pin lasts as long as this.
  struct Splats {
    GeometryArrays<const float> geometry;  // from the minimum corner of `cell`
    VariableArrays<const float> values;
    SplatRanges ranges;  // those of the part
    Cell cell;
    std::optional<BrickCache::Pin> pin;
  };

  /// Begins a frame. Nobody may be in take() any more. `unneeded` as the pager has it.
  void start(std::span<const BrickPart> parts, BrickPager::Unneeded unneeded = {});
  /// The brick of the `sequence`-th part; each once, any thread. Nothing once stopped. Throws as CacheReader
  /// does, DamagedBrick or Error, and Error where reading ahead broke off.
  /// No splats where `unneeded` has said so.
  std::optional<Splats> take(uint64_t sequence, Scratch& scratch);
  /// Instead of take(), for a part of a brick that `unneeded` is true of: lets go of it.
  void pass(uint64_t sequence);
  /// For a part that is damaged: what stands for its space in the nearest ancestor that is not. No splats if
  /// all are. Throws Error where the disk fails.
  Splats standIn(const BrickPart& part, Scratch& scratch) const;

  /// The cache is at another step of the same geometry. The geometry of decoded bricks is kept; their values are
  /// decoded anew when they are taken. Nobody may be in take() or prefetchNext() any more. Throws Error.
  void stepChanged();

  /// Begins to fill the cache with what it lacks of `bricks`, as far as there is room without them.
  void startPrefetch(std::span<const BrickPart> parts);
  /// Takes the next brick of the prefetch. False: none is left, there is no more room, or it was stopped.
  /// Throws as take() does.
  bool prefetchNext(Scratch& scratch);

  /// Wakes the threads that wait in take() or prefetchNext(). Any thread.
  void stop();
  /// After the last take() since start(): lets go of what was not taken. Adds what was counted since then;
  /// the workers' sums are left as they are.
  void finish(FetchStatistics& statistics);

  const BrickCache& cached() const { return cached_; }

 private:
  /// A brick that several parts want and the cache does not have.
  struct Shared {
    enum class State {
      kUntouched,  // -> coming, by the first who takes it
      kComing,     // -> kept or alone
      kKept,       // in the cache, pinned
      kAlone,      // not kept, or damaged: each reads it for himself
    };
    State state = State::kUntouched;
    uint32_t left = 0;  // parts that have not been taken
    std::optional<BrickCache::Pin> pin;
  };

  std::optional<Splats> takeShared(Shared& shared, const BrickPart& part, uint64_t miss, Scratch& scratch);
  std::optional<Splats> read(const BrickPart& part, uint64_t miss, Scratch& scratch);
  void refresh(const BrickCache::Pin& pin, uint32_t brick, Scratch& scratch) const;
  Splats readAlone(const BrickPart& part, Scratch& scratch) const;
  Splats splatsOf(BrickCache::Pin pin, const BrickPart& part) const;
  Splats splatsOf(const Scratch& scratch, const BrickPart& part) const;
  void decode(uint32_t brick, const PagedBrick& bytes, const GeometryArrays<float>& geometry,
              const VariableArrays<float>& values, Scratch& scratch) const;
  std::optional<PagedBrick> await(uint64_t miss, Scratch& scratch);
  void keepPart(const BrickPart& part, uint32_t ancestor, Scratch& scratch) const;

  const CacheReader& cache_;
  const size_t variable_;
  BrickCache cached_;
  BrickPager pager_;

  std::vector<BrickPart> parts_;                      // [sequence]
  std::vector<std::optional<BrickCache::Pin>> pins_;  // [sequence]
  std::vector<uint32_t> misses_;                      // [sequence]: place among those read
  std::vector<uint32_t> to_prefetch_, to_refresh_;
  uint64_t reads_ = 0, hits_ = 0;  // bricks that the pager was asked for, and that it was not
  std::atomic<uint64_t> next_prefetch_ = 0;
  std::atomic<bool> prefetch_stopped_ = false;
  PagerStatistics before_;

  std::mutex sharing_;                           // guards stopped_, and what shared_ holds
  std::condition_variable shared_changed_;       // a state, or stopped_
  std::unordered_map<uint32_t, Shared> shared_;  // by brick
  bool stopped_ = false;
};

}  // namespace curvisplat
