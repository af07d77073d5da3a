#include "render/frame.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <mutex>
#include <utility>

#include "render/classification.h"
#include "render/frame_budget.h"
#include "render/frame_workers.h"
#include "render/gl_painter.h"
#include "render/gl_thread.h"
#include "render/kernel.h"
#include "render/screen_view.h"
#include "render/segment_ring.h"
#include "stream/cut.h"
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

ProjectionSettings settingsFor(const Manifest& manifest, const Camera& camera, const FrameOptions& options) {
  const double diagonal = glm::length(options.scale * (manifest.upper - manifest.lower));
  const double near = kNearInDiagonals * (diagonal > 0 ? diagonal : manifest.root.size);
  return {ScreenView::of(camera, options.size, options.scale, options.low_pass_px2, near),
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

  Cut plan(const ProjectionSettings& settings, double lod_pixels) const {
    return chooseCut(cache.manifest().root, cache.bricks(), cache.brickVariables(variable), subtrees,
                     settings.view.cutView(), transparentIn(table, settings), lod_pixels);
  }

  uint64_t indexBytes() const {
    return cache.bricks().size() *
           (sizeof(Brick) + cache.manifest().variables.size() * sizeof(BrickVariable) + sizeof(ValueBounds) +
            kFrameBytesABrick);
  }

  /// Pools for such a frame: those there are, if they are of the size.
  void makePools(const FrameOptions& options);
  void endPrefetch();
  Image draw(const Cut& cut, const ProjectionSettings& settings, const FrameOptions& options,
             FrameStatistics& statistics, Progress* progress);

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
  const FrameWork work{cache, cut.bricks, settings, table, options.keep_going};
  {
    const std::lock_guard lock(running_mutex);
    if (cancelled) throw Cancelled();
    makePools(options);
    pools->ring.reset();
    pools->source.start(cut.bricks);
  }
  SegmentRing& ring = pools->ring;
  pools->workers.start(work);
  Image image;
  std::exception_ptr failure;
  try {
    gl.run([&](const GlContext&) {
      painter->begin(options.size, options.background, table, settings.per_pixel);
      for (size_t drawn = 0; drawn < cut.bricks.size(); ++drawn) {
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
  pools->source.finish(statistics.fetch);
  if (failure) std::rethrow_exception(failure);
  const std::lock_guard lock(running_mutex);
  if (cancelled) throw Cancelled();

  statistics.read_s = statistics.fetch.reading_s;
  statistics.decode_s = statistics.fetch.decode_s;
  statistics.bytes_read = statistics.fetch.bytes_read;
  statistics.ring_peak_bytes = ring.peakSplats() * sizeof(ScreenSplat);
  statistics.upload_s = painter->uploadSeconds();
  statistics.draw_s = painter->drawSeconds();
  statistics.bricks_drawn = cut.bricks.size();
  statistics.bricks_out_of_image = cut.out_of_image;
  statistics.bricks_transparent = cut.transparent;
  statistics.bricks_culled = cut.out_of_image + cut.transparent;
  statistics.largest_level = static_cast<int>(cut.deepest_level);
  statistics.workers = pools->budget.workers;
  return image;
}

Image FrameRenderer::render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                            Progress* progress) {
  State& state = *state_;
  const State::Running running(state);
  statistics = {};
  const StageTimer total(statistics.total_s);
  const ProjectionSettings settings = settingsFor(state.cache.manifest(), camera, options);
  Cut cut;
  {
    const StageTimer timer(statistics.plan_s);
    cut = state.plan(settings, options.lod_pixels);
  }
  if (progress) progress->begin("drawing", cut.bricks.size(), "bricks");
  Image image = state.draw(cut, settings, options, statistics, progress);
  if (progress) progress->end();
  return image;
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
  const ProjectionSettings settings = settingsFor(state.cache.manifest(), camera, options);
  const Cut cut = state.plan(settings, options.lod_pixels);
  state.makePools(options);
  state.pools->source.startPrefetch(cut.bricks);
  state.pools->workers.startPrefetch();
}

}  // namespace curvisplat
