#include "render/frame.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "render/classification.h"
#include "render/frame_budget.h"
#include "render/frame_workers.h"
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

}  // namespace

struct FrameRenderer::State {
  State(const CacheReader& cache_, size_t variable_, const TransferFunction& transfer_function,
        Backend backend_)
      : cache(cache_),
        variable(variable_),
        table(tableFor(cache, variable, transfer_function)),
        subtrees(subtreeBounds(cache.bricks(), cache.brickVariables(variable))),
        backend(makeBackend(backend_)) {}

  Cut plan(const ProjectionSettings& settings, double lod_pixels) const {
    return chooseCut(cache.manifest().root, cache.bricks(), cache.brickVariables(variable), subtrees,
                     settings.view.cutView(), transparentIn(table, settings), lod_pixels);
  }

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

Image FrameRenderer::render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                            Progress* progress) {
  State& state = *state_;
  statistics = {};
  Image image;
  {
    const StageTimer total(statistics.total_s);
    const ProjectionSettings settings = settingsFor(state.cache.manifest(), camera, options);
    const PaintResources resources{.threads = options.threads};
    const FrameBudget budget = FrameBudget::of(
        options.memory_bytes, state.indexBytes() + state.backend->bytes(options.size, resources),
        options.size, options.threads);
    Cut cut;
    {
      const StageTimer timer(statistics.plan_s);
      cut = state.plan(settings, options.lod_pixels);
    }
    if (progress) progress->begin("drawing", cut.bricks.size(), "bricks");

    SegmentRing ring(budget.ring_splats);
    FrameWorkers workers({state.cache, state.variable, cut.bricks, settings, state.table}, ring,
                         budget.workers);
    state.backend->run([&](Painter& painter) {
      painter.begin(options.size, options.background, state.table, settings.per_pixel, resources);
      for (size_t drawn = 0; drawn < cut.bricks.size(); ++drawn) {
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

    statistics.bricks_drawn = cut.bricks.size();
    statistics.bricks_out_of_image = cut.out_of_image;
    statistics.bricks_transparent = cut.transparent;
    statistics.bricks_culled = cut.out_of_image + cut.transparent;
    statistics.largest_level = static_cast<int>(cut.deepest_level);
    statistics.workers = budget.workers;
  }
  return image;
}

}  // namespace curvisplat
