#include "render/frame/frame_pipeline.h"

#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "render/frame/frame_budget.h"
#include "render/frame/frame_workers.h"
#include "render/frame/segment_drawer.h"
#include "render/frame/segment_ring.h"
#include "render/frame/sweep_buffer.h"
#include "render/surface/scene_layers.h"
#include "stream/base/error.h"
#include "stream/base/freed_memory.h"
#include "stream/base/interrupted.h"
#include "stream/base/stage_timer.h"
#include "stream/base/thread_count.h"
#include "stream/base/trace.h"
#include "stream/paging/brick_source.h"
#include "stream/paging/pager.h"

namespace curvisplat {
namespace {

constexpr uint64_t kSampleTileBytes = 256 << 10;  // of a thread
// Splats that are exchanged lie in blocks of other sizes at each step. What malloc kept of them was 27 MiB of 256.
constexpr size_t kLargeBlock = size_t{1} << 20;

unsigned threadsOf(const FrameOptions& options) {
  return threadsOrCores(options.threads);
}

/// What the splats of isosurfaces may take; where it is too little they are found in several parts of the picture.
uint64_t isoSplatBytes(const FrameOptions& options) {
  constexpr uint64_t kMinBytes = 4 << 20;
  return std::max(kMinBytes, options.memory_bytes / 8);
}

/// What finding where rays meet them may take; where it is too little fewer threads do.
uint64_t isoTracerBytes(const FrameOptions& options) {
  constexpr uint64_t kTracerBytes = 2 << 20;
  return std::max(kTracerBytes * threadsOf(options), options.memory_bytes / 16);
}

tbb::task_arena arenaOf(const FrameOptions& options) {
  return tbb::task_arena(std::min(static_cast<int>(threadsOf(options)), tbb::info::default_concurrency()));
}

/// About what a scene takes: its meshes, their vertices on the screen and their triangles in tiles, samples of slices
/// and of surfaces, and a layer and a half a pixel with a window behind it. The same for all pictures of one size.
uint64_t sceneBytes(const FrameOptions& options) {
  if (!options.scene || options.scene->empty()) return 0;
  const uint64_t slice_bytes = options.scene->slices_by_function ? 144 : 72;  // of two scalars
  const auto is_translucent = [](const auto& surface) { return !surface.opacity.opaque(); };
  const bool peels =
      std::any_of(options.scene->surfaces.begin(), options.scene->surfaces.end(), is_translucent) ||
      std::any_of(options.scene->grid_surfaces.begin(), options.scene->grid_surfaces.end(), is_translucent);
  constexpr uint64_t kLayerBytes = 64, kIsoBytesAPixel = 48, kVertexBytes = 16, kTriangleBytes = 8;
  uint64_t bytes = kSampleTileBytes * (peels ? PixelLayers::kMaxLayers : 1) * threadsOf(options) +
                   options.size.pixels() * (kLayerBytes + slice_bytes * options.scene->slices.size());
  for (const Surface& surface : options.scene->surfaces)
    bytes += surface.mesh->bytes() + kVertexBytes * surface.mesh->positions.size() +
             kTriangleBytes * surface.mesh->triangles.size();
  if (!options.scene->isovalues.empty())
    bytes += isoSplatBytes(options) + isoTracerBytes(options) + kIsoBytesAPixel * options.size.pixels();
  if (!options.scene->grid_surfaces.empty())
    bytes += FaceMeshes::bytes(*options.scene, options.size.pixels());
  return bytes;
}

/// The bricks of a slice that this rank samples.
SlicePlan shareOf(const SlicePlan& slice, const FrameOptions& options) {
  if (!options.ranks) return slice;
  SlicePlan share{slice.plane, {}, slice.complete};
  for (size_t n = options.ranks->rank(); n < slice.parts.size(); n += options.ranks->count())
    share.parts.push_back(slice.parts[n]);
  return share;
}

/// Waits for the painter's draws when a frame ends, however it ends: the next frame uses the same ring
/// memory.
class DrawsFinished {
 public:
  explicit DrawsFinished(Painter& painter) : painter_(painter) {}
  ~DrawsFinished() {
    try {
      painter_.finishDraws();
    } catch (const Error&) {
      // A painter that has failed reports it again at the next begin().
    }
  }
  DrawsFinished(const DrawsFinished&) = delete;
  DrawsFinished& operator=(const DrawsFinished&) = delete;

 private:
  Painter& painter_;
};

}  // namespace

/// The memory and threads that frames share, sized from the budget.
struct FramePipeline::Pools {
  Pools(const CacheReader& cache, const BrickSource::Variables& variables, const FrameBudget& budget_,
        const PagerOptions& pager_, std::span<ScreenSplat> splats, ComputePermits& permits)
      : budget(budget_),
        pager(pager_),
        ring(splats),
        sweep(budget.sweep_splats, budget.ring_splats / 2),
        source(cache, variables, pager, budget.cache_bytes, budget.kept_bytes),
        workers(source, sweep, ring, permits, budget.workers) {}

  const FrameBudget budget;
  const PagerOptions pager;
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
      painting_(backend_.get()) {}

FramePipeline::~FramePipeline() {
  endPrefetch();
}

FrameBudget FramePipeline::budgetOf(const FrameOptions& options) const {
  const uint64_t exchange_bytes = options.ranks ? 3 * exchangeBytes(options) : 0;
  const FrameBudget::Fixed fixed{planner_.bytes(),
                                 least_pager_bytes_,
                                 backend_->bytes(options.size, {.threads = options.threads}) +
                                     sceneBytes(options) + exchange_bytes + aside_bytes_,
                                 options.output_bytes,
                                 planner_.mostSplats(),
                                 options.size,
                                 cache_.series().steps.size() > 1,
                                 coloured_by_.has_value(),
                                 options.ranks != nullptr};
  return FrameBudget::of(options.memory_bytes, fixed, options.threads);
}

void FramePipeline::makePools(const FrameOptions& options) {
  // Steps differ in this; the pools stay.
  least_pager_bytes_ =
      std::max(least_pager_bytes_, BrickPager::leastBufferBytes(cache_, {variable_, coloured_by_}));
  const FrameBudget budget = budgetOf(options);
  PagerOptions pager;
  pager.buffer_bytes = budget.pager_bytes;
  pager.way = options.read_by;
  pager.direct = options.direct_reads;
  if (pools_ && pools_->budget == budget && pools_->pager.way == pager.way &&
      pools_->pager.direct == pager.direct && permits_->count() == threadsOf(options))
    return;
  dropPools();  // before the new ones take their memory
  permits_ = std::make_unique<ComputePermits>(threadsOf(options));
  auto fresh = std::make_unique<Pools>(cache_, BrickSource::Variables(variable_, coloured_by_), budget, pager,
                                       backend_->splatMemory(budget.ring_splats), *permits_);
  const MutexLock lock(mutex_);
  pools_ = std::move(fresh);
}

bool FramePipeline::setAside(uint64_t bytes, const FrameOptions& options) {
  aside_bytes_ = bytes;
  if (bytes == 0) return true;
  try {
    least_pager_bytes_ =
        std::max(least_pager_bytes_, BrickPager::leastBufferBytes(cache_, {variable_, coloured_by_}));
    budgetOf(options);
    return true;
  } catch (const UsageError&) {
    aside_bytes_ = 0;
    return false;
  }
}

Image FramePipeline::drawBy(PaintingBackend& painter, const FramePlan& plan, const FrameOptions& options,
                            FrameStatistics& statistics, Progress* progress) {
  struct Returned {
    FramePipeline& pipeline;
    ~Returned() { pipeline.painting_ = pipeline.backend_.get(); }
  } const returned{*this};
  painting_ = &painter;
  return draw(plan, options, statistics, progress);
}

void FramePipeline::release() {
  endPrefetch();
  surface_memory_ = {};
  dropPools();
}

void FramePipeline::stepChanged() {
  if (pools_) pools_->source.stepChanged();
}

// Memory is allocated and freed without holding the lock, so that a stop need not wait for it.
void FramePipeline::dropPools() {
  std::unique_ptr<Pools> old;  // freed after the lock is released
  const MutexLock lock(mutex_);
  old.swap(pools_);
}

/// Begins the next slab of the sweep's region. False if none is left.
bool FramePipeline::sweepNext(const FramePlan& plan, const FrameOptions& options) {
  const MutexLock lock(mutex_);
  throwIfStopped(options.stop);
  return pools_->sweep.beginSlab(plan.parts);
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
    pools_->source.start(parts, [this](uint32_t brick) { return exchange_->isUnneeded(brick); });
    pools_->workers.startExchange();
    return true;
  }
  for (const uint32_t number : pools_->sweep.parts()) parts.push_back(plan.parts[number].part);
  // Nothing is hidden when drawing back to front. With keep_going, see FrameWorkers::prepare().
  const bool may_hide = order() == DrawingOrder::kFrontToBack && !options.keep_going;
  pools_->source.start(parts, [this, may_hide, &plan](uint32_t brick) {
    return (may_hide && hidden_.hides(brick)) ||
           pools_->sweep.isBehind(sweptPart({brick}, cache_.bricks()[brick], plan.keys));
  });
  pools_->workers.start(region->tiles.get());
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
  exchange_ = std::make_unique<SplatExchange>(*options.ranks, *plan.shared, exchangeBytes(options));
  shared_numbers_.clear();
  uint32_t number = 0;
  for (const SweptPart& part : plan.parts) {
    while (plan.shared->parts[number].part.brick != part.part.brick) ++number;
    shared_numbers_.push_back(number++);
  }
}

/// Of each of the exchange's three buffers.
uint64_t FramePipeline::exchangeBytes(const FrameOptions& options) const {
  const uint64_t least =
      SplatExchange::leastBytes(BrickProjector::kMaxSplats + (coloured_by_ ? kMaxBrickSplats : 0));
  // Where several bricks a worker are under way, none waits for the others.
  const uint64_t most = 4 * least * (threadsOf(options) + 1);
  return std::clamp(options.memory_bytes / 16, least, most);
}

void FramePipeline::drawLayers(FramePlan& plan, const FrameOptions& options, FrameStatistics& statistics) {
  if (!options.scene || (options.scene->empty() && options.scene->volume)) {
    surface_memory_ = {};
    return;
  }
  const ScreenView& view = plan.settings.view;
  const auto samplerOf = [&](const SlicePlan& slice, size_t variable) {
    const VariableInfo& info = cache_.manifest().variables[variable];
    return std::make_unique<SliceSampler>(view, slice.plane, info.min, info.max, plan.settings.borders);
  };
  std::vector<std::unique_ptr<SliceSampler>> samplers, of_opacity;
  for (const SlicePlan& slice : plan.slices) {
    samplers.push_back(samplerOf(slice, coloured_by_.value_or(variable_)));
    if (coloured_by_ && options.scene->slices_by_function) of_opacity.push_back(samplerOf(slice, variable_));
    if (!samplers.back()->isSeen()) continue;
    SliceSampler* const opacities = of_opacity.empty() ? nullptr : of_opacity.back().get();
    const SlicePlan share = shareOf(slice, options);
    const auto take = [&](size_t, const glm::dvec3& cell_min, const BrickSource::Splats& splats) {
      samplers.back()->add(cell_min, splats.geometry, splats.second.value_or(splats.values), splats.ranges);
      if (opacities) opacities->add(cell_min, splats.geometry, splats.values, splats.ranges);
    };
    sample({cache_, share.parts, take, options.keep_going}, options, statistics);
    if (!options.ranks) continue;
    samplers.back()->addOthers(*options.ranks);
    if (opacities) opacities->addOthers(*options.ranks);
  }
  const glm::dvec3 middle = 0.5 * (cache_.manifest().lower + cache_.manifest().upper);
  const double depth_origin = view.projection == Projection::kPerspective ? 0 : view.viewFromData(middle).z;
  std::optional<ColourTable> opacities;
  if (options.scene->usesOpacities()) opacities.emplace(planner_.transferFunction());
  const auto isosurfaces =
      this->isosurfaces(plan, options, {depth_origin, opacities ? &*opacities : nullptr}, statistics);
  const StageTimer timer(statistics.surfaces_s, "draw surfaces");
  const SceneLook look{planner_.colours(),
                       options.light,
                       plan.settings.clip_planes,
                       depth_origin,
                       opacities ? &*opacities : nullptr,
                       of_opacity,
                       isosurfaces ? &*isosurfaces : nullptr};
  std::shared_ptr<const PixelLayers> layers;
  arenaOf(options).execute([&] {
    const SurfaceScene scene = face_meshes_.withMeshes(options.scene, view, options.lod_pixels);
    layers = std::make_shared<PixelLayers>(layersOf(scene, view, samplers, look, &surface_memory_));
  });
  planner_.addLayers(plan, std::move(layers), options);
}

/// A part of the picture after the other, each as large as its splats fit into the memory. A tile of 32x32 pixels is
/// the smallest.
std::optional<IsoLayers> FramePipeline::isosurfaces(const FramePlan& plan, const FrameOptions& options,
                                                    const IsoInput& input, FrameStatistics& statistics) {
  if (options.scene->isovalues.empty()) return std::nullopt;
  const ProjectionSettings& settings = plan.settings;
  const bool of_colours = coloured_by_ && options.scene->iso_of_colours;
  const SheetOpacity& opacity = options.scene->iso_opacity;
  const IsoLayers::Look look{planner_.colours(),
                             options.light,
                             {opacity.factor, opacity.by_function ? input.opacities : nullptr, of_colours},
                             coloured_by_ && !of_colours};
  IsoLayers layers(settings.view.size);
  std::vector<TileRange> left{{0, layers.tiles()}};
  while (!left.empty()) {
    const TileRange tiles = left.back();
    left.pop_back();
    IsoSplats splats({settings.view, options.scene->isovalues, settings.borders, settings.clip_planes,
                      input.depth_origin, tiles, isoSplatBytes(options)},
                     plan.iso_parts.size());
    const auto take = [&](size_t part, const glm::dvec3& cell_min, const BrickSource::Splats& of_part) {
      const auto& values = of_colours ? *of_part.second : of_part.values;
      const auto* const second = of_part.second ? &*of_part.second : nullptr;
      splats.add(part, cell_min, of_part.geometry, values, of_colours ? &of_part.values : second,
                 of_part.ranges);
    };
    sample({cache_, plan.iso_parts, take, options.keep_going}, options, statistics);
    if (splats.overflowed()) {
      if (tiles.count() == 1)
        throw UsageError(
            "isosurfaces: too many splats in {0}x{0} pixels (they need more than their {1} KiB of --memory); "
            "increase --memory or --lod-pixels",
            kTileSide, isoSplatBytes(options) >> 10);
      const size_t middle = (tiles.begin + tiles.end) / 2;
      left.push_back({middle, tiles.end});
      left.push_back({tiles.begin, middle});
      continue;
    }
    const StageTimer timer(statistics.surfaces_s, "draw isosurfaces");
    arenaOf(options).execute([&] {
      splats.sort();
      layers.draw(splats, look, isoTracerBytes(options));
    });
  }
  return layers;
}

void FramePipeline::sample(const SamplingWork& work, const FrameOptions& options,
                           FrameStatistics& statistics) {
  makePools(options);
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
                          Progress* progress) {
  std::optional<TraceScope> starting(std::in_place, "start frame");
  makePools(options);
  exchange_.reset();
  if (plan.shared) beginExchange(plan, options);
  const FrameWork work{cache_,    plan.parts, plan.settings,      planner_.table(),
                       plan.keys, hidden_,    options.keep_going, exchange_.get()};
  // With keep_going, what replaces a damaged brick may reach into any region.
  const std::vector<FrameRegion> regions =
      options.keep_going ? std::vector<FrameRegion>{{plan.tiles, {}}}
                         : frameRegions(plan, cache_, variable_, pools_->budget.sweep_splats);
  const std::stop_callback on_stop(options.stop, [this] { stopStages(); });
  {
    const MutexLock lock(mutex_);
    throwIfStopped(options.stop);
    pools_->ring.reset();
    pools_->sweep.beginFrame();
    pools_->workers.beginFrame(work);
    hidden_.begin(cache_.bricks(), plan.settings.view);
  }
  if (progress) progress->begin("drawing", plan.parts.size(), "bricks");
  Image image;
  try {
    region_ = 0;
    pools_->sweep.beginRegion(regions.front().left_out);
    const bool is_any = sweepNext(plan, options);
    starting.reset();
    startSlab(plan, is_any ? &regions.front() : nullptr, options);
    image = paint(plan, regions, options, statistics, progress);
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

/// The stage "draw"; the first slab is begun. No picture where the ring was closed: a worker has failed, or a stop was
/// requested.
Image FramePipeline::paint(const FramePlan& plan, std::span<const FrameRegion> regions,
                           const FrameOptions& options, FrameStatistics& statistics, Progress* progress) {
  Image image;
  painting_->run([&](Painter& painter) {
    const DrawsFinished finished(painter);
    painter.begin(
        plan.settings.view.size, options.background, planner_.table(),
        {plan.settings.per_pixel, plan.settings.lit(), plan.settings.layers, planner_.colourClasses()},
        {.threads = options.threads, .stop = options.stop, .permits = permits_.get()});
    if (regions.front().tiles) painter.drawOnly(*regions.front().tiles);
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
    image = painter.end();
    statistics.splats_hidden = painter.hiddenSplats();
    statistics.upload_s = painter.uploadSeconds();
    statistics.draw_s = painter.drawSeconds();
    statistics.gl_draw_s = painter.glSeconds();
  });
  return image;
}

/// Called by whoever requests a stop, in its thread.
void FramePipeline::stopStages() {
  const MutexLock lock(mutex_);
  if (pools_) pools_->workers.stop();
}

void FramePipeline::prefetch(const FramePlan& plan, const FrameOptions& options) {
  endPrefetch();
  makePools(options);
  std::vector<BrickPart> parts;
  for (const SweptPart& part : plan.parts) parts.push_back(part.part);
  pools_->source.startPrefetch(parts);
  pools_->workers.startPrefetch();
}

void FramePipeline::endPrefetch() {
  if (!pools_) return;
  pools_->source.stop();
  pools_->workers.finishPrefetch();
}

}  // namespace curvisplat
