#include "render/frame/frame_pipeline.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "render/frame/frame_memory.h"
#include "render/frame/frame_workers.h"
#include "render/image/too_little_memory.h"
#include "render/project/brick_store.h"
#include "render/sweep/segment_ring.h"
#include "render/sweep/sweep_buffer.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"
#include "stream/base/memory.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"
#include "stream/base/trace.h"
#include "stream/paging/brick_source.h"
#include "stream/paging/pager.h"

namespace curvisplat {
namespace {

// Splats that are exchanged lie in blocks of other sizes at each step. What malloc kept of them was 27 MiB of 256.
constexpr size_t kLargeBlock = size_t{1} << 20;

unsigned threadsOf(const FrameOptions& options) {
  return threadsOrCores(options.threads);
}

PagerOptions reading(const FrameBudget& budget) {
  PagerOptions options;
  options.buffer_bytes = budget.pager_bytes;
  return options;
}

/// A number that no cache, step or variable had before.
uint64_t nextContent() {
  static std::atomic<uint64_t> last = 0;
  return ++last;
}

}  // namespace

/// The memory and threads that frames share, sized from the budget.
struct FramePipeline::Pools {
  Pools(const CacheReader& cache, const BrickSource::Variables& variables_, const FrameBudget& budget_,
        ComputePermits& permits)
      : variables(variables_),
        budget(budget_),
        splats(std::make_unique_for_overwrite<ScreenSplat[]>(budget.ring_splats)),
        ring({splats.get(), budget.ring_splats}),
        sweep(budget.sweep_splats, budget.ring_splats / 2),
        source(cache, variables, reading(budget), budget.cache_bytes, budget.kept_bytes),
        workers(source, sweep, ring, permits, budget.workers) {}

  const BrickSource::Variables variables;
  const FrameBudget budget;
  const std::unique_ptr<ScreenSplat[]> splats;
  SegmentRing ring;
  SweepBuffer sweep;
  BrickSource source;
  FrameWorkers workers;
};

FramePipeline::FramePipeline(const CacheReader& cache, const DrawnScalars& scalars,
                             const FramePlanner& planner, Backend backend)
    : FramePipeline(cache, scalars, planner, makeBackend(backend)) {}

FramePipeline::FramePipeline(const CacheReader& cache, const DrawnScalars& scalars,
                             const FramePlanner& planner, std::unique_ptr<PaintingBackend> backend)
    : cache_(cache),
      variable_(scalars.opacity.variable),
      coloured_by_(scalars.colour ? std::optional(scalars.colour->variable) : std::nullopt),
      planner_(planner),
      backend_(std::move(backend)),
      painting_(backend_.get()),
      layers_(cache, scalars, planner),
      content_(nextContent()) {}

FramePipeline::~FramePipeline() {
  endPrefetch();
}

FrameBudget FramePipeline::budgetOf(const FrameOptions& options, bool two_scalars) const {
  const bool alone = options.ranks->alone();
  const uint64_t exchange_bytes = alone ? 0 : 3 * exchangeBytes(options);
  const FrameBudget::Fixed fixed{
      planner_.bytes(options),
      least_pager_bytes_,
      backend_->bytes(options.size,
                      {.threads = options.threads, .waiting_splats = FrameBudget::kMinWaitingSplats}) +
          layers_.bytes(options) + exchange_bytes + aside_bytes_ +
          (options.light && options.light->hasShadows() ? ShadowGrid::kBytes : 0),
      options.output_bytes,
      planner_.mostSplats(),
      options.size,
      cache_.series().steps.size() > 1,
      two_scalars,
      !alone};
  return FrameBudget::of(options.memory_bytes, fixed, options.threads);
}

void FramePipeline::makePools(const FrameOptions& options, const BrickSource::Variables& variables) {
  // Steps differ in this; the pools stay.
  least_pager_bytes_ = std::max(least_pager_bytes_, BrickPager::leastBufferBytes(cache_, variables));
  const FrameBudget budget = budgetOf(options, variables.second.has_value());
  if (pools_ && pools_->variables == variables && pools_->budget == budget &&
      permits_->count() == threadsOf(options))
    return;
  dropPools();  // before the new ones take their memory
  permits_ = std::make_unique<ComputePermits>(threadsOf(options));
  auto fresh = std::make_unique<Pools>(cache_, variables, budget, *permits_);
  requireSpareMemory();
  const MutexLock lock(mutex_);
  pools_ = std::move(fresh);
}

bool FramePipeline::setAside(uint64_t bytes, size_t waiting_splats, const FrameOptions& options) {
  aside_bytes_ = bytes;
  aside_waiting_splats_ = waiting_splats;
  if (bytes == 0) return true;
  try {
    least_pager_bytes_ = std::max(least_pager_bytes_, BrickPager::leastBufferBytes(cache_, variables()));
    budgetOf(options, coloured_by_.has_value());
    return true;
  } catch (const UsageError&) {
    aside_bytes_ = 0;
    return false;
  }
}

Image FramePipeline::drawBy(PaintingBackend& painter, const FramePlan& plan, const FrameOptions& options,
                            FrameStatistics& statistics, Progress* progress) {
  struct PainterReset {
    FramePipeline& pipeline;
    ~PainterReset() { pipeline.painting_ = pipeline.backend_.get(); }
  } const reset{*this};
  painting_ = &painter;
  return draw(plan, options, statistics, progress);
}

void FramePipeline::release() {
  endPrefetch();
  layers_.release();
  dropPools();
}

/// Forgets what a frame that failed has left, and what it has of the painter.
void FramePipeline::forgetFrame() {
  endPrefetch();
  dropPools();
  hidden_.ask(nullptr);
  stored_.clear();
  is_stored_.clear();
  unread_.clear();
  is_storing_ = false;
}

void FramePipeline::fallBack(const std::string& why) {
  forgetFrame();
  replaceFailed(backend_, why);
  painting_ = backend_.get();
}

bool FramePipeline::giveCardMemoryUp() {
  forgetFrame();
  bool has_given = false;
  backend_->run([&](Painter& painter) {
    BrickStore* const store = painter.store();
    has_given = store && store->giveMemoryUp();
  });
  return has_given;
}

std::unique_ptr<PaintingBackend> FramePipeline::takeBackend() {
  forgetFrame();
  return std::move(backend_);
}

void FramePipeline::stepChanged() {
  layers_.stepChanged();
  if (pools_) pools_->source.stepChanged();
}

// Memory is allocated and freed without holding the lock, so that a stop need not wait for it.
void FramePipeline::dropPools() {
  std::unique_ptr<Pools> old;  // freed after the lock is released
  const MutexLock lock(mutex_);
  old.swap(pools_);
}

/// Whether nothing of the brick is needed from the source any more. Any thread.
bool FramePipeline::isLeftOut(uint32_t brick, const FramePlan& plan, const FrameOptions& options) const {
  if (std::binary_search(unread_.begin(), unread_.end(), brick)) return true;
  const bool may_hide = !options.keep_going;  // FrameWorkers::prepare() says why
  return (may_hide && hidden_.hides(brick)) ||
         pools_->sweep.isBehind(sweptPart({brick}, cache_.bricks()[brick], plan.keys));
}

/// Begins the next slab of the sweep's region. False if none is left.
bool FramePipeline::sweepNext(const FramePlan& plan, const FrameOptions& options) {
  const MutexLock lock(mutex_);
  throwIfStopped(options.stop);
  return pools_->sweep.beginSlab(plan.parts);
}

/// The part as it is fetched. No layers are merged where the painter keeps bricks, or the picture would depend on which.
BrickPart FramePipeline::fetchedPart(const SweptPart& swept) const {
  BrickPart part = swept.part;
  if (is_storing_) part.merging = 0;
  return part;
}

/// Starts the stages on the sweep's slab, of `region`; null: there is none. False if no rank has one.
bool FramePipeline::startSlab(const FramePlan& plan, const FrameRegion* region, const FrameOptions& options) {
  if (exchange_ ? !beginExchangedSlab(region) : region == nullptr) return false;
  const TraceScope trace(
      "start slab", TraceKind::kStage,
      {static_cast<int64_t>(pools_->sweep.slabs()), static_cast<int64_t>(pools_->budget.ring_splats)});
  const MutexLock lock(mutex_);
  throwIfStopped(options.stop);
  pools_->ring.resume();
  std::vector<BrickPart> parts;
  if (exchange_) {
    for (const uint32_t number : exchange_->toPrepare()) parts.push_back(exchange_->parts()[number].part);
    pools_->source.start(
        parts, [this](uint32_t brick) { return exchange_->isUnneeded(brick); }, plan.mergings);
  } else {
    for (const uint32_t number : pools_->sweep.parts()) parts.push_back(fetchedPart(plan.parts[number]));
    pools_->source.start(
        parts, [&](uint32_t brick) { return isLeftOut(brick, plan, options); }, plan.mergings);
  }
  pools_->workers.start(region ? region->tiles.get() : nullptr);
  return true;
}

/// Starts the stages on the next slab, of the current region or of the next that has one. False if none is left, of other
/// ranks either.
bool FramePipeline::nextSlab(const FramePlan& plan, std::span<const FrameRegion> regions,
                             const FrameOptions& options, Painter& painter) {
  while (!sweepNext(plan, options)) {
    if (region_ + 1 == regions.size()) return startSlab(plan, nullptr, options);
    ++region_;
    painter.drawOnly(*regions[region_].tiles);
    pools_->sweep.beginRegion(regions[region_].left_out);
  }
  return startSlab(plan, &regions[region_], options);
}

/// Tells the other ranks what this one needs for its slab. False if no rank has a slab.
bool FramePipeline::beginExchangedSlab(const FrameRegion* region) {
  if (!region) return exchange_->beginSlab({});
  SplatExchange::Request request{region->tiles->box(), {}};
  for (const uint32_t number : pools_->sweep.parts()) request.parts.push_back(shared_numbers_[number]);
  return exchange_->beginSlab(std::move(request));
}

/// The numbers in plan.shared of the plan's parts, which are some of those in the same order.
void FramePipeline::beginExchange(const FramePlan& plan, const FrameOptions& options) {
  returnFreedMemory(kLargeBlock);
  exchange_ = std::make_unique<SplatExchange>(*options.ranks, plan.shared, exchangeBytes(options));
  shared_numbers_.clear();
  uint32_t number = 0;
  for (const SweptPart& part : plan.parts) {
    while (plan.shared.parts[number].part.brick != part.part.brick) ++number;
    shared_numbers_.push_back(number++);
  }
}

/// The bytes of each of the exchange's three buffers.
uint64_t FramePipeline::exchangeBytes(const FrameOptions& options) const {
  const uint64_t least =
      SplatExchange::leastBytes(BrickProjector::kMaxSplats + (coloured_by_ ? kMaxBrickSplats : 0));
  // Where several bricks a worker are under way, none waits for the others.
  const uint64_t most = 4 * least * (threadsOf(options) + 1);
  return std::clamp(options.memory_bytes / 16, least, most);
}

void FramePipeline::drawLayers(FramePlan& plan, const FrameOptions& options, FrameStatistics& statistics,
                               Progress* progress) {
  samples_others_ = false;
  const auto throwIfStopped = [&] {
    curvisplat::throwIfStopped(options.stop);
    if (progress) progress->throwIfStopped();
  };
  const auto sample = [&](const SamplingWork& work) {
    SamplingWork stoppable = work;
    stoppable.take = [&](size_t part, const glm::dvec3& cell_min, const BrickSource::Splats& splats) {
      throwIfStopped();
      work.take(part, cell_min, splats);
    };
    this->sample(stoppable, options, statistics);
  };
  layers_.draw(plan, options, sample, throwIfStopped, statistics);
}

void FramePipeline::sample(const SamplingWork& work, const FrameOptions& options,
                           FrameStatistics& statistics) {
  samples_others_ = samples_others_ || (work.variables && *work.variables != variables());
  makePools(options, work.variables.value_or(variables()));
  const std::stop_callback on_stop(options.stop, [this] { stopStages(); });
  try {
    {
      const MutexLock lock(mutex_);
      throwIfStopped(options.stop);
      pools_->source.start(work.parts);
      pools_->workers.startSampling(work);
    }
    pools_->workers.finish(statistics);
    pools_->source.finish(statistics);
  } catch (...) {
    dropPools();
    throw;
  }
  throwIfStopped(options.stop);
}

Image FramePipeline::draw(const FramePlan& plan, const FrameOptions& options, FrameStatistics& statistics,
                          Progress* progress, std::shared_ptr<CardPicture>* on_card) {
  for (uint32_t least = 1; least <= kMaxRegions; least *= 4) {
    FrameStatistics drawn = statistics;
    auto image = drawInRegions(least, plan, options, drawn, progress, on_card);
    if (!image) continue;
    statistics = std::move(drawn);
    return *std::move(image);
  }
  throw TooLittleMemory(
      fmt::format(
          "--memory {}: too little for what lies in one place of the picture; give more, or a coarser "
          "--lod-pixels",
          byteText(options.memory_bytes)),
      options.size);
}

/// Nothing where more splats wait in the painter's tiles than it has memory for: fewer do in smaller regions.
std::optional<Image> FramePipeline::drawInRegions(uint32_t least, const FramePlan& plan,
                                                  const FrameOptions& options, FrameStatistics& statistics,
                                                  Progress* progress, std::shared_ptr<CardPicture>* on_card) {
  std::optional<TraceScope> starting(std::in_place, "start frame");
  makePools(options, variables());
  exchange_.reset();
  if (!options.ranks->alone()) beginExchange(plan, options);
  fillStore(plan, options, on_card != nullptr, statistics);
  const FrameWork work{cache_,  plan.parts, plan.settings,      planner_.table(), plan.keys,
                       hidden_, is_stored_, options.keep_going, exchange_.get()};
  // With keep_going, what replaces a damaged brick may reach into any region.
  std::vector<FrameRegion> regions =
      options.keep_going && least == 1
          ? std::vector<FrameRegion>{{plan.tiles, {}}}
          : frameRegions(plan, cache_, variable_, pools_->budget.sweep_splats, least);
  if (options.keep_going)
    for (FrameRegion& region : regions) region.left_out.clear();
  const std::stop_callback on_stop(options.stop, [this] { stopStages(); });
  {
    const MutexLock lock(mutex_);
    throwIfStopped(options.stop);
    pools_->ring.reset();
    pools_->sweep.beginFrame();
    pools_->workers.beginFrame(work);
    hidden_.begin(cache_.bricks(), plan.settings.view);
  }
  overfull_ = false;
  if (progress) progress->begin("drawing", plan.parts.size(), "bricks");
  Image image;
  try {
    region_ = 0;
    pools_->sweep.beginRegion(regions.front().left_out);
    const bool is_any = sweepNext(plan, options);
    starting.reset();
    startSlab(plan, is_any ? &regions.front() : nullptr, options);
    image = paint(plan, regions, options, statistics, progress, on_card);
  } catch (...) {
    pools_->workers.stop();
    try {
      pools_->workers.finish(statistics);
    } catch (...) {
      // The first failure is the one to report.
    }
    dropPools();  // a reading thread that has failed cannot serve the next frame
    throw;
  }
  throwIfStopped(options.stop);
  if (!isOfAll(options)) return {};
  if (progress) progress->end();

  const Cut& cut = plan.cut;
  statistics.ring_peak_bytes = pools_->ring.peakSplats() * sizeof(ScreenSplat);
  statistics.sweep_peak_bytes = SweepBuffer::bytes(pools_->sweep.peakSplats());
  statistics.regions = regions.size();
  statistics.slabs = pools_->sweep.slabs();
  if (exchange_) statistics.exchanged_bytes = exchange_->sentBytes();
  statistics.bricks_hidden = pools_->workers.partsHidden() + plan.parts_hidden;
  statistics.bricks_drawn = cut.parts.size() - statistics.bricks_hidden - plan.parts_elsewhere;
  statistics.bricks_out_of_image = cut.out_of_image;
  statistics.bricks_transparent = cut.transparent;
  statistics.bricks_culled = cut.out_of_image + cut.transparent;
  statistics.largest_level = cut.deepest_level;
  statistics.largest_error_px = cut.largest_error_px;
  statistics.workers = pools_->budget.workers;
  statistics.memory_used_bytes = options.memory_bytes - pools_->budget.cache_bytes -
                                 pools_->budget.kept_bytes + statistics.cache_bytes + statistics.kept_bytes;
  return image;
}

/// Whether the painters of all ranks have completed the picture; false if more splats waited in one than it had memory for.
/// Throws what this rank's painter threw, or OtherPainterFailure if another rank's did.
bool FramePipeline::isOfAll(const FrameOptions& options) const {
  std::array<uint64_t, 2> numbers{overfull_ ? 1u : 0u, failure_ ? 1u : 0u};
  options.ranks->sum(numbers);
  if (failure_) std::rethrow_exception(failure_);
  if (numbers[1] > 0) throw OtherPainterFailure("the painter of another rank has failed");
  return numbers[0] == 0;
}

/// The stage "draw"; the first slab is begun. No picture where the ring was closed: a worker has failed, or a stop was
/// requested.
Image FramePipeline::paint(const FramePlan& plan, std::span<const FrameRegion> regions,
                           const FrameOptions& options, FrameStatistics& statistics, Progress* progress,
                           std::shared_ptr<CardPicture>* on_card) {
  Image image;
  const size_t waiting = painting_ == backend_.get() ? pools_->budget.waiting_splats : aside_waiting_splats_;
  failure_ = nullptr;
  painting_->run([&](Painter& own) {
    Painter& painter = options.ranks->alone() ? own : enduring_.emplace(own);
    painter.begin(plan.settings.view.size, options.background, planner_.table(),
                  {plan.settings.per_pixel, plan.settings.lit(), plan.settings.layers,
                   planner_.colourClasses(), static_cast<float>(plan.settings.view.low_pass_px2)},
                  {.threads = options.threads,
                   .waiting_splats = waiting,
                   .stop = options.stop,
                   .permits = permits_.get()});
    if (regions.front().tiles) painter.drawOnly(*regions.front().tiles);
    if (!stored_.empty()) painter.store()->drawStored(plan.settings, plan.keys, stored_);
    hidden_.ask(&painter);
    SegmentDrawer drawer(painter, pools_->ring, statistics.painter_waited_s);
    uint64_t seen = 0;
    const auto advance = [&] {
      const uint64_t now = pools_->workers.partsSeen();
      if (progress) progress->advance(now - seen);
      seen = now;
    };
    do {
      while (drawer.drawNext()) advance();
      pools_->workers.finish(statistics);
      pools_->source.finish(statistics);
      advance();
      if (pools_->ring.isClosed()) return;
    } while (nextSlab(plan, regions, options, painter));
    if (on_card) *on_card = painter.endOnCard();
    if (!on_card || !*on_card) image = painter.end();
    overfull_ = painter.isOverfull();
    if (!options.ranks->alone()) failure_ = enduring_->failure();
    statistics.splats_hidden = painter.hiddenSplats();
    statistics.upload_s = painter.uploadSeconds();
    statistics.draw_s = painter.drawSeconds();
    const CardWork card = painter.cardWork();
    statistics.gl_draw_s = card.draw_s;
    statistics.gl_project_s = card.project_s;
    statistics.gl_list_s = card.list_s;
    statistics.gl_sort_s = card.sort_s;
    statistics.gl_paint_s = card.paint_s;
    statistics.card_entries = card.entries;
    statistics.card_peak_bytes = card.bytes;
    statistics.card_sent_bytes = card.sent_bytes;
    statistics.card_slabs = card.slabs;
    statistics.card_read_bytes = card.read_bytes;
    statistics.card_pixels_listed = card.pixels_listed;
    statistics.card_pixels_blended = card.pixels_blended;
    if (!stored_.empty()) {
      const ProjectionCounts counts = painter.store()->counts();
      statistics.card_splats = counts.read;
      add(statistics, counts);
    }
  });
  if (const ShadowGrid* const shadows = plan.settings.shadows.get()) {
    PrepareStatistics unreadable;
    for (const auto& [brick, reason] : shadows->damaged())
      unreadable.bricks_unreadable.push_back({brick, reason});
    combine(statistics, unreadable);
  }
  return image;
}

/// Called by whoever requests a stop, in its thread.
void FramePipeline::stopStages() {
  const MutexLock lock(mutex_);
  if (pools_) pools_->workers.stop();
}

void FramePipeline::prefetch(const FramePlan& plan, const FrameOptions& options) {
  endPrefetch();
  if (samples_others_) return;  // which would drop what is fetched now
  makePools(options, variables());
  std::vector<BrickPart> parts;
  for (const SweptPart& part : plan.parts) parts.push_back(fetchedPart(part));
  pools_->source.startPrefetch(parts, plan.mergings);
  pools_->workers.startPrefetch();
}

void FramePipeline::endPrefetch() {
  if (!pools_) return;
  pools_->source.stop();
  pools_->workers.finishPrefetch();
}

}  // namespace curvisplat
