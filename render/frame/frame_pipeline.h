// The stages of a frame after its plan, and the memory and threads that frames share:
//
//   LayerDrawer --layers of the pixels, into the plan-----------+
//                                                               v
//   BrickSource --bricks--> FrameWorkers --SegmentRing--> painter
//   fetch                   prepare ^ |                   draw
//                                   | v
//                                 SweepBuffer
//
// A frame is one sweep along the depth, or one for each region of the picture if the budget cannot hold a
// layer of the cut (frame_memory.h), or several slabs of one. The source and the workers start again with
// each slab; the painter continues.
//
// All memory is in pools, which are allocated when the first frame needs them and sized from the budget.
// They are replaced only if the budget's shares change. Between frames the workers can fill the cache of
// bricks.
//
// One caller at a time. A stop that is requested in another thread closes the stages' queues; the thread
// that draws then finds no more to do, and throws. Included by frame.cpp and the pipeline's own sources
// only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render/backend/backend.h"
#include "render/frame/enduring_painter.h"
#include "render/frame/frame_memory.h"
#include "render/frame/frame_options.h"
#include "render/frame/frame_plan.h"
#include "render/frame/frame_statistics.h"
#include "render/frame/layer_drawer.h"
#include "render/project/brick_store.h"
#include "render/ranks/splat_exchange.h"
#include "render/sweep/hidden_bricks.h"
#include "stream/base/compute_permits.h"
#include "stream/base/mutex.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

struct SamplingWork;

/// The stages and pools of one variable, or two, of one cache.
class FramePipeline {
 public:
  /// Draws what `planner` plans for those variables of the cache; both must outlive the pipeline. Throws
  /// Error if the backend is not available.
  FramePipeline(const CacheReader& cache, const DrawnScalars& scalars, const FramePlanner& planner,
                Backend backend);
  FramePipeline(const CacheReader& cache, const DrawnScalars& scalars, const FramePlanner& planner,
                std::unique_ptr<PaintingBackend> backend);
  ~FramePipeline();

  /// Ends a prefetch. To be called before a frame, and before what it draws is changed.
  void endPrefetch();
  /// Fetches, prepares and draws. Memory is divided for a picture of options.size, which may be larger than
  /// the plan's. Adds to `statistics`. Throws as FrameRenderer::render() does. `on_card`: the picture is left there if the
  /// painter shares textures with a window (Painter::endOnCard()), and the image is empty; else it becomes null.
  Image draw(const FramePlan& plan, const FrameOptions& options, FrameStatistics& statistics,
             Progress* progress, std::shared_ptr<CardPicture>* on_card = nullptr);
  /// Frames leave `bytes` of the memory to a further painter, for drawBy(), until it is called again. False,
  /// and they leave nothing, if the memory is too little for that. `waiting_splats`: what the painter gets of them
  /// (PaintResources).
  bool setAside(uint64_t bytes, size_t waiting_splats, const FrameOptions& options);
  /// draw() by that painter, on the processor: of the bricks that are kept, in the same memory.
  Image drawBy(PaintingBackend& painter, const FramePlan& plan, const FrameOptions& options,
               FrameStatistics& statistics, Progress* progress);
  /// Draws the surfaces, slices and isosurfaces of options.scene, if there is one, and puts them into the
  /// plan as its layers. Before draw(), and as draw().
  void drawLayers(FramePlan& plan, const FrameOptions& options, FrameStatistics& statistics,
                  Progress* progress);

  /// Begins to fetch the plan's bricks in the background. Throws UsageError if there is too little memory.
  void prefetch(const FramePlan& plan, const FrameOptions& options);

  /// Gives its memory up until the next frame. Nothing may be drawn meanwhile.
  void release();

  /// Draws the frames to come by the next backend (replaceFailed()), after a PainterFailure. Nothing may be drawn meanwhile.
  void fallBack(const std::string& why);
  /// Draws the frames to come with less of the card's memory, which is freed, after a CardMemoryFailure. False if it
  /// kept nothing there that could go. Nothing may be drawn meanwhile.
  bool giveCardMemoryUp();

  /// The cache is at another step of the same geometry. Nothing may be drawn or fetched meanwhile.
  void stepChanged();

  const PaintingBackend& backend() const { return *backend_; }
  /// Ends a prefetch. The pipeline can only be destroyed then.
  std::unique_ptr<PaintingBackend> takeBackend();
  /// See FrameRenderer::permits().
  ComputePermits* permits() const { return permits_.get(); }

 private:
  void forgetFrame();
  struct Pools;

  void sample(const SamplingWork& work, const FrameOptions& options, FrameStatistics& statistics);
  bool sweepNext(const FramePlan& plan, const FrameOptions& options);
  bool startSlab(const FramePlan& plan, const FrameRegion* region, const FrameOptions& options);
  bool nextSlab(const FramePlan& plan, std::span<const FrameRegion> regions, const FrameOptions& options,
                Painter& painter);
  bool beginExchangedSlab(const FrameRegion* region);
  void beginExchange(const FramePlan& plan, const FrameOptions& options);
  uint64_t exchangeBytes(const FrameOptions& options) const;
  std::optional<Image> drawInRegions(uint32_t least, const FramePlan& plan, const FrameOptions& options,
                                     FrameStatistics& statistics, Progress* progress,
                                     std::shared_ptr<CardPicture>* on_card);
  void stopStages();
  FrameBudget budgetOf(const FrameOptions& options, bool two_scalars) const;
  BrickSource::Variables variables() const { return {variable_, coloured_by_}; }
  void fillStore(const FramePlan& plan, const FrameOptions& options, bool on_card,
                 FrameStatistics& statistics);
  void putIntoStore(std::span<const StoredPart> parts, const BorderStyle& borders,
                    const FrameOptions& options, FrameStatistics& statistics);
  BrickPart fetchedPart(const SweptPart& swept) const;
  bool isLeftOut(uint32_t brick, const FramePlan& plan, const FrameOptions& options) const;
  void makePools(const FrameOptions& options, const BrickSource::Variables& variables);
  void dropPools();
  bool isOfAll(const FrameOptions& options) const;
  Image paint(const FramePlan& plan, std::span<const FrameRegion> regions, const FrameOptions& options,
              FrameStatistics& statistics, Progress* progress, std::shared_ptr<CardPicture>* on_card);

  const CacheReader& cache_;
  const size_t variable_;
  const std::optional<size_t> coloured_by_;  // another variable
  const FramePlanner& planner_;
  std::unique_ptr<PaintingBackend> backend_;
  PaintingBackend* painting_;    // backend_, except in drawBy()
  bool samples_others_ = false;  // the layers of the last picture are of scalars that its splats do not have
  uint64_t aside_bytes_ = 0;
  size_t aside_waiting_splats_ = 0;
  HiddenBricks hidden_;
  LayerDrawer layers_;
  const uint64_t content_;                   // BrickStore::open()
  std::vector<StoredPart> stored_;           // the parts of the plan that are drawn from the store
  std::vector<uint8_t> is_stored_;           // [part of the plan]; empty: none is
  std::vector<uint32_t> unread_;             // stored bricks, sorted
  bool is_storing_ = false;                  // whether the last picture's painter has a store for its bricks
  std::unique_ptr<SplatExchange> exchange_;  // of the frame; null: this process alone
  std::vector<uint32_t> shared_numbers_;     // [part of the plan] its number in plan.shared
  size_t region_ = 0;                        // that is being drawn
  bool overfull_ = false;                    // the last picture: Painter::isOverfull()
  std::exception_ptr failure_;               // of its painter, where several ranks draw; null: none
  std::optional<EnduringPainter> enduring_;  // asked by workers until the frame has ended
  std::unique_ptr<ComputePermits> permits_;  // as many as the options said that threads were to be used
  uint64_t least_pager_bytes_ = 0;           // that the largest brick of any step so far needs

  Mutex mutex_;  // a stop comes from another thread
  // Replaced with the mutex held; the thread that draws, which replaces them, reads them without it.
  std::unique_ptr<Pools> pools_;
};

}  // namespace curvisplat
