// The workers of a frame. They take the decoded bricks of the cut, or parts of them, in the sweep's order;
// project and sort each, and enter it into the sweep. Splats whose order is final there they sort into
// segments of the ring. Between frames they can fill the cache of decoded bricks.
//
// If several ranks draw the picture, the workers prepare the bricks that this rank has to prepare for all of them, and
// enter the splats that it receives. A thread of its own exchanges them.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <memory>
#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/frame/frame_statistics.h"
#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "render/ranks/splat_exchange.h"
#include "render/surface/slice_sampler.h"
#include "render/sweep/hidden_bricks.h"
#include "render/sweep/segment_ring.h"
#include "render/sweep/sweep_buffer.h"
#include "stream/base/compute_permits.h"
#include "stream/base/mutex.h"
#include "stream/base/threads.h"
#include "stream/paging/brick_source.h"

namespace curvisplat {

/// The constant inputs that all workers of a frame share. Must outlive the frame.
struct FrameWork {
  const CacheReader& cache;
  std::span<const SweptPart> parts;  // of the cut, in the sweep's order
  const ProjectionSettings& settings;
  const ClassificationTable& table;
  const DepthKeys& keys;
  const HiddenBricks& hidden;
  std::span<const uint8_t> stored = {};  // [part] 1 if a BrickStore draws it; empty: none
  bool keep_going = false;
  SplatExchange* exchange = nullptr;  // among the ranks that draw the picture together; null: there is one
};

/// The inputs of a pass over splats before the picture is drawn, which finds slices and isosurfaces.
struct SamplingWork {
  const CacheReader& cache;
  std::span<const BrickPart> parts;
  /// Takes the splats of parts[part], whose positions count from `cell_min`. Any thread.
  std::function<void(size_t part, const glm::dvec3& cell_min, const BrickSource::Splats& splats)> take;
  bool keep_going = false;
  std::optional<BrickSource::Variables> variables = std::nullopt;  // none: the picture's
};

/// Adds the counts of splats that were projected.
void add(PrepareStatistics& statistics, const ProjectionCounts& counts);

class FrameWorkers {
 public:
  /// Starts `count` threads, named "prepare", which hold a permit while they compute. The other arguments must outlive them.
  FrameWorkers(BrickSource& source, SweepBuffer& sweep, SegmentRing& ring, ComputePermits& permits,
               unsigned count);
  ~FrameWorkers();
  FrameWorkers(const FrameWorkers&) = delete;
  FrameWorkers& operator=(const FrameWorkers&) = delete;

  /// Begins a frame.
  void beginFrame(const FrameWork& work);
  /// Starts the workers on the sweep's current slab. The source must have the slab's parts, and the ring must be open. `tiles`:
  /// what is drawn of the picture, borrowed until finish(); null: all. Where ranks draw the picture together, the source must
  /// have the parts that this one prepares for all, and the exchange, which knows the tiles of all, must have begun the slab.
  void start(const TileSet* tiles);
  /// Waits until the workers have ended. Either the whole slab is in the ring, which pauses after it; or the
  /// sweep, ring or source was stopped; or a worker failed, which stops all of them. Rethrows the first
  /// failure. Adds the workers' times and counts to `statistics`.
  void finish(FrameStatistics& statistics);
  /// The number of parts of this frame that were prepared or passed over so far, each counted once. Any
  /// thread.
  uint64_t partsSeen() const { return parts_seen_; }
  /// The number of those that were passed over because they are hidden. After finish().
  uint64_t partsHidden() const;
  /// Stops sweep, ring and source. Any thread.
  void stop();

  /// Starts the workers on the parts of `work`, which the source must have. finish() waits for them.
  void startSampling(const SamplingWork& work);

  /// Begins a prefetch, for which the source must be ready. Errors of bricks are left to the frame to report.
  void startPrefetch();
  /// Waits until the prefetch has ended, if one was begun.
  void finishPrefetch();

 private:
  struct Worker;
  enum class Seen : uint8_t { kNo, kHidden, kProjected };

  void loop(Worker& worker);
  void sample(Worker& worker, const SamplingWork& work);
  void endSlab(Worker& worker);
  void exchangeLoop();
  void sharedLoop(Worker& worker);
  bool prepareShared(Worker& worker, size_t index);
  bool enterReceived(Worker& worker, uint64_t sequence);
  bool isUnneeded(uint64_t sequence);
  void begin();
  template <typename Job>
  void run(Urgency urgency, const Job& job);
  void fail();
  // Return false if the sweep, the ring or the source was stopped.
  bool prepare(Worker& worker, uint64_t sequence);
  bool passOver(uint64_t sequence);
  struct Projected {
    std::span<const ScreenSplat> splats;
    std::span<const uint32_t> keys;
  };
  bool enter(Worker& worker, uint64_t sequence, uint32_t brick, const Projected& projected);
  void project(Worker& worker, const BrickSource::Splats& fetched, const KeyRange& keys);
  bool submit(Worker& worker, const SweepBuffer::Batch& batch);
  std::optional<BrickSource::Splats> fetch(Worker& worker, uint64_t sequence, const BrickPart& part,
                                           bool keep_going);
  void count(Worker& worker, bool again);
  void markSeen(uint32_t number, Seen seen);

  BrickSource& source_;
  SweepBuffer& sweep_;
  SegmentRing& ring_;
  ComputePermits& permits_;
  const FrameWork* work_ = nullptr;
  const TileSet* tiles_ = nullptr;
  std::vector<Seen> seen_;         // [part of the frame]; each is one worker's at a time
  std::vector<uint8_t> prepared_;  // [part of all ranks' frame] 1: this rank has prepared it, for any rank
  std::atomic<uint64_t> parts_seen_ = 0;
  std::atomic<uint64_t> next_ = 0;  // sequence number of the slab's first part that no worker has taken
  Mutex failing_;
  std::exception_ptr first_failure_ GUARDED_BY(failing_);
  std::vector<std::unique_ptr<Worker>> workers_;  // [thread]
  WorkerTeam team_;
  std::unique_ptr<WorkerTeam> exchanging_;  // one thread
};

}  // namespace curvisplat
