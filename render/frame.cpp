#include "render/frame.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <mutex>
#include <utility>

#include "render/classification.h"
#include "render/first_picture.h"
#include "render/frame_budget.h"
#include "render/frame_workers.h"
#include "render/gl_painter.h"
#include "render/gl_thread.h"
#include "render/kernel.h"
#include "render/screen_view.h"
#include "render/segment_ring.h"
#include "stream/cut.h"
#include "stream/error.h"
#include "stream/stage_timer.h"

namespace curvisplat {
namespace {

// The perspective near plane's distance, in diagonals of the data. What is nearer would fill the image many
// times over, cut into very many pieces.
constexpr double kNearInDiagonals = 1e-4;
// What the source and the cut note of a brick.
constexpr uint64_t kFrameBytesABrick = 160;

ClassificationTable tableFor(const CacheReader& cache, size_t variable,
                             const TransferFunction& transfer_function) {
  const VariableInfo& info = cache.manifest().variables.at(variable);
  return ClassificationTable::of(transfer_function, info.min, info.max);
}

ProjectionSettings settingsFor(const Manifest& manifest, const Camera& camera, const FrameOptions& options,
                               ImageSize size) {
  const double diagonal = glm::length(options.scale * (manifest.upper - manifest.lower));
  const double near = kNearInDiagonals * (diagonal > 0 ? diagonal : manifest.root.size);
  return {ScreenView::of(camera, size, options.scale, options.low_pass_px2, near),
          options.classification == Classification::pixel, options.clip_box};
}

/// Whether no scalar that a pixel of such a brick can have has extinction.
TransparentBounds transparentIn(const ClassificationTable& table, const ProjectionSettings& settings) {
  const double reach = settings.per_pixel ? largestReach(settings.view.low_pass_px2) : 1;
  return [&table, reach](const ValueBounds& values) {
    const double deviation = std::hypot(kKernelSigma * values.largest_slope, values.largest_deviation);
    const double spread = 1.001 * (reach * values.largest_slope + std::sqrt(3.0) * deviation);
    return table.fullyTransparent(static_cast<float>(values.min - spread),
                                  static_cast<float>(values.max + spread));
  };
}

/// What frames share, sized from the budget.
struct Pools {
  Pools(const CacheReader& cache, size_t variable, const FrameBudget& budget_, const PagerOptions& pager_)
      : budget(budget_),
        pager(pager_),
        ring(budget.ring_splats),
        source(cache, variable, pager, budget.cache_bytes),
        workers(source, ring, budget.workers) {}

  const FrameBudget budget;
  const PagerOptions pager;
  SegmentRing ring;
  BrickSource source;
  FrameWorkers workers;
};

CutOptions limitsOf(const FrameOptions& options) {
  CutOptions limits;
  limits.lod_pixels = options.lod_pixels;
  limits.max_splats = options.max_splats.value_or(CutOptions::kNoLimit);
  return limits;
}

}  // namespace

struct FrameRenderer::State {
  State(const CacheReader& cache_, size_t variable_, const TransferFunction& transfer_function)
      : cache(cache_),
        variable(variable_),
        table(tableFor(cache, variable, transfer_function)),
        subtrees(subtreeBounds(cache.bricks(), cache.brickVariables(variable))) {
    gl.run([this](const GlContext& context) { painter = std::make_unique<GlPainter>(context); });
  }
  ~State() {
    endPrefetch();
    gl.run([this](const GlContext&) { painter.reset(); });
  }

  /// Throws UsageError if options.max_splats are too few.
  Cut plan(const ProjectionSettings& settings, const FrameOptions& options, const CutOptions& limits) const;
  /// The picture has the size of settings.view; memory is shared out for one of options.size.
  Image draw(const Cut& cut, const ProjectionSettings& settings, const FrameOptions& options,
             FrameStatistics& statistics, Progress* progress);

  uint64_t indexBytes() const {
    return cache.bricks().size() *
           (sizeof(Brick) + cache.manifest().variables.size() * sizeof(BrickVariable) + sizeof(ValueBounds) +
            kFrameBytesABrick);
  }

  /// Pools for such a frame: those there are, if they are of the size.
  void makePools(const FrameOptions& options);
  void endPrefetch();
  /// FrameRenderer::render(), with Running in the caller's hands.
  Image render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
               Progress* progress);

  const CacheReader& cache;
  const size_t variable;
  const ClassificationTable table;
  const std::vector<ValueBounds> subtrees;
  GlThread gl;
  std::unique_ptr<GlPainter> painter;  // made, used and destroyed on the GL thread

  /// A render() under way.
  class Running {
   public:
    explicit Running(State& state) : state_(state) {
      state.endPrefetch();
      const std::lock_guard lock(state.running_mutex);
      state.running = true;
      state.cancelled = false;
    }
    ~Running() {
      const std::lock_guard lock(state_.running_mutex);
      state_.running = false;
    }
    Running(const Running&) = delete;
    Running& operator=(const Running&) = delete;

   private:
    State& state_;
  };

  std::mutex running_mutex;  // guards the three below: cancel() comes from another thread
  bool running = false, cancelled = false;
  std::unique_ptr<Pools> pools;
};

FrameRenderer::FrameRenderer(const CacheReader& cache, size_t variable,
                             const TransferFunction& transfer_function)
    : state_(std::make_unique<State>(cache, variable, transfer_function)) {}

FrameRenderer::~FrameRenderer() = default;

const std::string& FrameRenderer::backendName() const {
  return state_->gl.contextName();
}

Cut FrameRenderer::State::plan(const ProjectionSettings& settings, const FrameOptions& options,
                               const CutOptions& limits) const {
  const CutTree tree{cache.manifest().root, cache.bricks(), cache.brickVariables(variable), subtrees};
  Cut cut = chooseCut(tree, settings.view.cutView(), transparentIn(table, settings), limits);
  if (options.max_splats && cut.splats > *options.max_splats)
    throw UsageError(
        "{} splats are too few: the coarsest picture of this cache takes {}; give --max-splats that",
        *options.max_splats, cut.splats);
  return cut;
}

void FrameRenderer::State::makePools(const FrameOptions& options) {
  const FrameBudget budget = FrameBudget::of(
      options.memory_bytes, {indexBytes(), BrickPager::leastBufferBytes(cache, variable), options.size},
      options.threads);
  PagerOptions pager;
  pager.buffer_bytes = budget.pager_bytes;
  pager.way = options.read_by;
  pager.direct = options.direct_reads;
  if (pools && pools->budget == budget && pools->pager.way == pager.way &&
      pools->pager.direct == pager.direct)
    return;
  pools.reset();  // before the new ones take their memory
  pools = std::make_unique<Pools>(cache, variable, budget, pager);
}

void FrameRenderer::State::endPrefetch() {
  if (!pools) return;
  pools->source.stop();
  pools->workers.finishPrefetch();
}

Image FrameRenderer::State::draw(const Cut& cut, const ProjectionSettings& settings,
                                 const FrameOptions& options, FrameStatistics& statistics,
                                 Progress* progress) {
  const FrameWork work{cache, cut.parts, settings, table, options.keep_going};
  {
    const std::lock_guard lock(running_mutex);
    if (cancelled) throw Cancelled();
    makePools(options);
    pools->ring.reset();
    pools->source.start(cut.parts);
  }
  if (progress) progress->begin("drawing", cut.parts.size(), "bricks");
  SegmentRing& ring = pools->ring;
  pools->workers.start(work);
  Image image;
  std::exception_ptr failure;
  try {
    gl.run([&](const GlContext&) {
      painter->begin(settings.view.size, options.background, table, settings.per_pixel);
      for (size_t drawn = 0; drawn < cut.parts.size(); ++drawn) {
        std::optional<std::span<const ScreenSplat>> segment;
        {
          const StageTimer timer(statistics.painter_waited_s);
          segment = ring.next();
        }
        if (!segment) return;  // a worker has failed, or the frame was cancelled
        painter->draw(*segment);
        ring.release();
        if (progress) progress->advance(1);
      }
      image = painter->end();
    });
  } catch (...) {
    failure = std::current_exception();
    ring.close();
    pools->source.stop();
  }
  try {
    pools->workers.finish(statistics);
  } catch (...) {
    if (!failure) failure = std::current_exception();
  }
  pools->source.finish(statistics);
  if (failure) std::rethrow_exception(failure);
  {
    const std::lock_guard lock(running_mutex);
    if (cancelled) throw Cancelled();
  }
  if (progress) progress->end();

  statistics.ring_peak_bytes = ring.peakSplats() * sizeof(ScreenSplat);
  statistics.upload_s = painter->uploadSeconds();
  statistics.draw_s = painter->drawSeconds();
  statistics.bricks_drawn = cut.parts.size();
  statistics.bricks_out_of_image = cut.out_of_image;
  statistics.bricks_transparent = cut.transparent;
  statistics.bricks_culled = cut.out_of_image + cut.transparent;
  statistics.largest_level = static_cast<int>(cut.deepest_level);
  statistics.largest_error_px = cut.largest_error_px;
  statistics.workers = pools->budget.workers;
  return image;
}

Image FrameRenderer::render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                            Progress* progress) {
  const State::Running running(*state_);
  return state_->render(camera, options, statistics, progress);
}

Image FrameRenderer::State::render(const Camera& camera, const FrameOptions& options,
                                   FrameStatistics& statistics, Progress* progress) {
  statistics = {};
  const StageTimer total(statistics.total_s);
  const ProjectionSettings settings = settingsFor(cache.manifest(), camera, options, options.size);
  Cut cut;
  {
    const StageTimer timer(statistics.plan_s);
    cut = plan(settings, options, limitsOf(options));
  }
  return draw(cut, settings, options, statistics, progress);
}

void FrameRenderer::renderProgressively(const Camera& camera, const FrameOptions& options,
                                        FrameStatistics& statistics, const ShowPicture& show,
                                        Progress* progress) {
  const State::Running running(*state_);
  statistics = {};
  Image first;
  bool is_final = false;
  {
    const StageTimer total(statistics.total_s);
    const Manifest& manifest = state_->cache.manifest();
    ProjectionSettings settings = settingsFor(manifest, camera, options, options.size);
    Cut cut;
    {
      const StageTimer timer(statistics.plan_s);
      cut = state_->plan(settings, options, firstPictureLimits(limitsOf(options)));
    }
    is_final = cut.complete;
    const ReducedSize reduced(options.size, is_final ? 0 : cut.largest_error_px);
    if (!reduced.isWhole()) settings = settingsFor(manifest, camera, options, reduced.size());
    first = state_->draw(cut, settings, options, statistics, progress);
    if (!reduced.isWhole()) first = reduced.enlarge(first);
  }
  show(first, is_final);
  first = Image();
  if (!is_final) show(state_->render(camera, options, statistics, progress), true);
}

void FrameRenderer::cancel() {
  const std::lock_guard lock(state_->running_mutex);
  if (!state_->running) return;
  state_->cancelled = true;
  if (!state_->pools) return;
  state_->pools->ring.close();
  state_->pools->source.stop();
}

void FrameRenderer::prefetch(const Camera& camera, const FrameOptions& options) {
  State& state = *state_;
  state.endPrefetch();
  const ProjectionSettings settings = settingsFor(state.cache.manifest(), camera, options, options.size);
  const Cut cut = state.plan(settings, options, limitsOf(options));
  state.makePools(options);
  state.pools->source.startPrefetch(cut.parts);
  state.pools->workers.startPrefetch();
}

}  // namespace curvisplat
