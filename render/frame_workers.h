// The workers of a frame: they take the cut's bricks, or parts of them, in sequence and read, decode, project
// and sort each into its segment of the ring.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "render/classification.h"
#include "render/frame.h"
#include "render/projection.h"
#include "render/segment_ring.h"
#include "stream/cache_reader.h"

namespace curvisplat {

/// What all workers of a frame look at and none changes; outlives them.
struct FrameWork {
  const CacheReader& cache;
  size_t variable;
  std::span<const BrickPart> parts;  // in drawing order
  const ProjectionSettings& settings;
  const ClassificationTable& table;
  DrawingOrder order;
};

class FrameWorkers {
 public:
  /// Starts `count` threads, named "prepare". `ring` outlives them.
  FrameWorkers(const FrameWork& work, SegmentRing& ring, unsigned count);
  /// Closes the ring and joins.
  ~FrameWorkers();
  FrameWorkers(const FrameWorkers&) = delete;
  FrameWorkers& operator=(const FrameWorkers&) = delete;

  /// Waits for the workers' end: all parts are in the ring, it was closed, or one of them failed, which
  /// closes it. Rethrows the first failure. Adds what they did to `statistics`. Once.
  void finish(FrameStatistics& statistics);

 private:
  void loop(FrameStatistics& statistics);
  /// False if the ring was closed.
  bool prepare(class WorkerScratch& scratch, uint64_t sequence, FrameStatistics& statistics);
  void join();

  const FrameWork work_;
  SegmentRing& ring_;
  std::atomic<uint64_t> next_ = 0;  // sequence number of a part that nobody has taken
  std::mutex failing_;              // guards first_failure_
  std::exception_ptr first_failure_;
  std::vector<FrameStatistics> statistics_;  // [thread]
  std::vector<std::thread> threads_;
};

}  // namespace curvisplat
