// The stages of a frame after its plan, and the memory and threads that frames share:
//
//   BrickSource --bricks--> FrameWorkers --SegmentRing--> painter
//   fetch                   prepare ^ |                   draw
//                                   | v
//                                 SweepBuffer
//
// A frame is one sweep along the depth, or several slabs of it where the budget cannot hold a layer of the
// cut: source and workers begin anew with each, the painter draws on.
//
// All memory is in pools that are sized from the budget when the first frame needs them, and made anew only
// for a budget that shares out otherwise. Between frames the workers can fill the cache of bricks.
//
//   idle --Running made--> running --cancel()--> cancelled: the stages are stopped, draw() throws
//    ^                        |                      |
//    +--Running destroyed-----+----------------------+
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>

#include "render/frame/backend.h"
#include "render/frame/cancelled.h"
#include "render/frame/frame_options.h"
#include "render/frame/frame_plan.h"
#include "render/frame/frame_statistics.h"
#include "render/frame/hidden_bricks.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// One caller at a time, but for cancel().
class FramePipeline {
 public:
  /// Draws what `planner` plans for that variable of the cache; both outlive it. Throws Error if there is no
  /// such backend to be had.
  FramePipeline(const CacheReader& cache, size_t variable, const FramePlanner& planner, Backend backend);
  ~FramePipeline();

  /// While there is one, cancel() is heard. Ends a prefetch.
  class Running {
   public:
    explicit Running(FramePipeline& pipeline);
    ~Running();
    Running(const Running&) = delete;
    Running& operator=(const Running&) = delete;

   private:
    FramePipeline& pipeline_;
  };

  /// Fetches, prepares and draws. Memory is shared out for a picture of options.size, which may be larger
  /// than the plan's. Adds to `statistics`. Throws as FrameRenderer::render() does. Within a Running.
  Image draw(const FramePlan& plan, const FrameOptions& options, FrameStatistics& statistics,
             Progress* progress);
  /// From now on draw() throws Cancelled, until there is another Running; nothing where there is none.
  /// Any thread.
  void cancel();

  /// Begins to fetch for such a frame, in the background. Throws UsageError for too little memory.
  void prefetch(const FramePlan& plan, const FrameOptions& options);

  /// In which it wants the cut.
  DrawingOrder order() const { return backend_->order(); }
  const PaintingBackend& backend() const { return *backend_; }

 private:
  struct Pools;

  bool beginSlab(const FramePlan& plan, const FrameOptions& options);
  void endPrefetch();
  void makePools(const FrameOptions& options);
  void dropPools();
  Image paint(const FramePlan& plan, const FrameOptions& options, FrameStatistics& statistics,
              Progress* progress);

  const CacheReader& cache_;
  const size_t variable_;
  const FramePlanner& planner_;
  const std::unique_ptr<PaintingBackend> backend_;
  HiddenBricks hidden_;

  enum class Phase { kIdle, kRunning, kCancelled };
  std::mutex mutex_;  // guards the two below; cancel() comes from another thread
  Phase phase_ = Phase::kIdle;
  std::unique_ptr<Pools> pools_;
};

}  // namespace curvisplat
