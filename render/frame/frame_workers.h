// The workers of a frame: they take the cut's bricks, or parts of them, in sequence and decoded, and project
// and sort each into its segment of the ring. Between frames they can fill the cache of decoded bricks.
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
#include "render/project/projection.h"
#include "stream/base/worker_team.h"
#include "stream/paging/brick_source.h"

namespace curvisplat {

/// What all workers of a frame look at and none changes; outlives the frame.
struct FrameWork {
  const CacheReader& cache;
  std::span<const BrickPart> parts;  // in drawing order: those that the source was started with
  const ProjectionSettings& settings;
  const ClassificationTable& table;
  DrawingOrder order;  // of the parts, and to be their splats
  const HiddenBricks& hidden;
  bool keep_going = false;
};

class FrameWorkers {
 public:
  /// Starts `count` threads, named "prepare". `source` and `ring` outlive them.
  FrameWorkers(BrickSource& source, SegmentRing& ring, unsigned count);
  ~FrameWorkers();
  FrameWorkers(const FrameWorkers&) = delete;
  FrameWorkers& operator=(const FrameWorkers&) = delete;

  /// Begins a frame; ring and source are ready for it.
  void start(const FrameWork& work);
  /// Waits for the workers' end: all parts are in the ring, ring or source were stopped, or one of them
  /// failed, which stops both. Rethrows the first failure. Adds what they did to `statistics`.
  void finish(FrameStatistics& statistics);

  /// Begins a prefetch; the source is ready for it. A brick that cannot be read is left to the frame.
  void startPrefetch();
  /// Waits for the prefetch's end, if there is one.
  void finishPrefetch();

 private:
  struct Worker;

  void loop(Worker& worker);
  /// False if ring or source were stopped.
  bool prepare(Worker& worker, uint64_t sequence);
  bool passOver(Worker& worker, uint64_t sequence);
  std::optional<BrickSource::Splats> fetch(Worker& worker, uint64_t sequence);

  BrickSource& source_;
  SegmentRing& ring_;
  const FrameWork* work_ = nullptr;
  std::atomic<uint64_t> next_ = 0;  // sequence number of a part that nobody has taken
  std::mutex failing_;              // guards first_failure_
  std::exception_ptr first_failure_;
  std::vector<std::unique_ptr<Worker>> workers_;  // [thread]
  WorkerTeam team_;
};

}  // namespace curvisplat
