// The workers of a frame: they take the cut's bricks, or parts of them, decoded and in the sweep's order,
// project and sort each and enter it into the sweep; what is final there they sort into segments of the ring.
// Between frames they can fill the cache of decoded bricks.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/frame/frame_statistics.h"
#include "render/frame/hidden_bricks.h"
#include "render/frame/segment_ring.h"
#include "render/frame/sweep_buffer.h"
#include "render/project/depth_keys.h"
#include "render/project/projection.h"
#include "stream/base/worker_team.h"
#include "stream/paging/brick_source.h"

namespace curvisplat {

/// What all workers of a frame look at and none changes; outlives the frame.
struct FrameWork {
  const CacheReader& cache;
  std::span<const SweptPart> parts;  // of the cut, in the sweep's order
  const ProjectionSettings& settings;
  const ClassificationTable& table;
  const DepthKeys& keys;
  const HiddenBricks& hidden;
  bool keep_going = false;
};

class FrameWorkers {
 public:
  /// Starts `count` threads, named "prepare". The others outlive them.
  FrameWorkers(BrickSource& source, SweepBuffer& sweep, SegmentRing& ring, unsigned count);
  ~FrameWorkers();
  FrameWorkers(const FrameWorkers&) = delete;
  FrameWorkers& operator=(const FrameWorkers&) = delete;

  /// Begins a frame.
  void beginFrame(const FrameWork& work);
  /// Begins the sweep's slab; the source has its parts, and the ring is ready.
  void start();
  /// Waits for the workers' end: the slab is in the ring, which pauses after it; or sweep, ring or source were
  /// stopped; or one of them failed, which stops them all. Rethrows the first failure. Adds what they did to
  /// `statistics`.
  void finish(FrameStatistics& statistics);
  /// Parts that were prepared, or passed over, for the first time in this frame. Any thread.
  uint64_t partsSeen() const { return parts_seen_; }
  /// Of those, the ones of which nothing was prepared. After finish().
  uint64_t partsHidden() const;
  /// Stops sweep, ring and source. Any thread.
  void stop();

  /// Begins a prefetch; the source is ready for it. A brick that cannot be read is left to the frame.
  void startPrefetch();
  /// Waits for the prefetch's end, if there is one.
  void finishPrefetch();

 private:
  struct Worker;
  enum class Seen : uint8_t { kNo, kHidden, kProjected };

  void loop(Worker& worker);
  // False if sweep, ring or source were stopped.
  bool prepare(Worker& worker, uint64_t sequence);
  bool passOver(uint64_t sequence);
  bool enter(Worker& worker, uint64_t sequence, uint32_t rank);
  bool hand(Worker& worker, const SweepBuffer::Batch& batch);
  std::optional<BrickSource::Splats> fetch(Worker& worker, uint64_t sequence, const BrickPart& part);
  void count(Worker& worker, uint32_t number);
  void markSeen(uint32_t number, Seen seen);

  BrickSource& source_;
  SweepBuffer& sweep_;
  SegmentRing& ring_;
  const FrameWork* work_ = nullptr;
  std::vector<Seen> seen_;  // [part of the frame]; each is one worker's at a time
  std::atomic<uint64_t> parts_seen_ = 0;
  std::atomic<uint64_t> next_ = 0;  // sequence number of a part of the slab that nobody has taken
  std::mutex failing_;              // guards first_failure_
  std::exception_ptr first_failure_;
  std::vector<std::unique_ptr<Worker>> workers_;  // [thread]
  WorkerTeam team_;
};

}  // namespace curvisplat
