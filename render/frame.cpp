#include "render/frame.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "render/classification.h"
#include "render/first_picture.h"
#include "render/frame_budget.h"
#include "render/frame_workers.h"
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

CutOptions limitsOf(const FrameOptions& options, DrawingOrder order) {
  CutOptions limits;
  limits.order = order;
  limits.lod_pixels = options.lod_pixels;
  limits.max_splats = options.max_splats.value_or(CutOptions::kNoLimit);
  return limits;
}

}  // namespace

struct FrameRenderer::State {
  State(const CacheReader& cache_, size_t variable_, const TransferFunction& transfer_function,
        Backend backend_)
      : cache(cache_),
        variable(variable_),
        table(tableFor(cache, variable, transfer_function)),
        subtrees(subtreeBounds(cache.bricks(), cache.brickVariables(variable))),
        backend(makeBackend(backend_)) {}

  /// Throws UsageError if options.max_splats are too few.
  Cut plan(const ProjectionSettings& settings, const FrameOptions& options, const CutOptions& limits) const;
  /// The picture has the size of settings.view; memory is shared out for one of options.size.
  Image draw(const Cut& cut, const ProjectionSettings& settings, const FrameOptions& options,
             FrameStatistics& statistics, Progress* progress);

  uint64_t indexBytes() const {
    return cache.bricks().size() *
           (sizeof(Brick) + cache.manifest().variables.size() * sizeof(BrickVariable) + sizeof(ValueBounds));
  }

  const CacheReader& cache;
  const size_t variable;
  const ClassificationTable table;
  const std::vector<ValueBounds> subtrees;
  const std::unique_ptr<PaintingBackend> backend;
};

FrameRenderer::FrameRenderer(const CacheReader& cache, size_t variable,
                             const TransferFunction& transfer_function, Backend backend)
    : state_(std::make_unique<State>(cache, variable, transfer_function, backend)) {}

FrameRenderer::~FrameRenderer() = default;

const std::string& FrameRenderer::backendName() const {
  return state_->backend->name();
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

Image FrameRenderer::State::draw(const Cut& cut, const ProjectionSettings& settings,
                                 const FrameOptions& options, FrameStatistics& statistics,
                                 Progress* progress) {
  Image image;
  const PaintResources resources{.threads = options.threads};
  const FrameBudget budget =
      FrameBudget::of(options.memory_bytes, indexBytes() + backend->bytes(options.size, resources),
                      options.size, options.threads);
  if (progress) progress->begin("drawing", cut.parts.size(), "bricks");

  SegmentRing ring(budget.ring_splats);
  FrameWorkers workers({cache, variable, cut.parts, settings, table, backend->order()}, ring, budget.workers);
  backend->run([&](Painter& painter) {
    painter.begin(settings.view.size, options.background, table, settings.per_pixel, resources);
    for (size_t drawn = 0; drawn < cut.parts.size(); ++drawn) {
      std::optional<std::span<const ScreenSplat>> segment;
      {
        const StageTimer timer(statistics.painter_waited_s);
        segment = ring.next();
      }
      if (!segment) return;  // a worker has failed
      painter.draw(*segment);
      ring.release();
      if (progress) progress->advance(1);
    }
    image = painter.end();
    statistics.upload_s = painter.uploadSeconds();
    statistics.draw_s = painter.drawSeconds();
  });
  workers.finish(statistics);
  if (progress) progress->end();

  statistics.bricks_drawn = cut.parts.size();
  statistics.bricks_out_of_image = cut.out_of_image;
  statistics.bricks_transparent = cut.transparent;
  statistics.bricks_culled = cut.out_of_image + cut.transparent;
  statistics.largest_level = static_cast<int>(cut.deepest_level);
  statistics.largest_error_px = cut.largest_error_px;
  statistics.workers = budget.workers;
  return image;
}

Image FrameRenderer::render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                            Progress* progress) {
  statistics = {};
  const StageTimer total(statistics.total_s);
  const ProjectionSettings settings = settingsFor(state_->cache.manifest(), camera, options, options.size);
  Cut cut;
  {
    const StageTimer timer(statistics.plan_s);
    cut = state_->plan(settings, options, limitsOf(options, state_->backend->order()));
  }
  return state_->draw(cut, settings, options, statistics, progress);
}

void FrameRenderer::renderProgressively(const Camera& camera, const FrameOptions& options,
                                        FrameStatistics& statistics, const ShowPicture& show,
                                        Progress* progress) {
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
      cut = state_->plan(settings, options, firstPictureLimits(limitsOf(options, state_->backend->order())));
    }
    is_final = cut.complete;
    const ReducedSize reduced(options.size, is_final ? 0 : cut.largest_error_px);
    if (!reduced.isWhole()) settings = settingsFor(manifest, camera, options, reduced.size());
    first = state_->draw(cut, settings, options, statistics, progress);
    if (!reduced.isWhole()) first = reduced.enlarge(first);
  }
  show(first, is_final);
  first = Image();
  if (!is_final) show(render(camera, options, statistics, progress), true);
}

}  // namespace curvisplat
