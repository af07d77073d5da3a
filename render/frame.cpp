#include "render/frame.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "render/classification.h"
#include "render/frame_budget.h"
#include "render/frame_workers.h"
#include "render/gl_painter.h"
#include "render/gl_thread.h"
#include "render/kernel.h"
#include "render/screen_view.h"
#include "render/segment_ring.h"
#include "stream/stage_timer.h"
#include "stream/cut.h"

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
  State(const CacheReader& cache_, size_t variable_, const TransferFunction& transfer_function)
      : cache(cache_),
        variable(variable_),
        table(tableFor(cache, variable, transfer_function)),
        subtrees(subtreeBounds(cache.bricks(), cache.brickVariables(variable))) {
    gl.run([this](const GlContext& context) { painter = std::make_unique<GlPainter>(context); });
  }
  ~State() {
    gl.run([this](const GlContext&) { painter.reset(); });
  }

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
  GlThread gl;
  std::unique_ptr<GlPainter> painter;  // made, used and destroyed on the GL thread
};

FrameRenderer::FrameRenderer(const CacheReader& cache, size_t variable,
                             const TransferFunction& transfer_function)
    : state_(std::make_unique<State>(cache, variable, transfer_function)) {}

FrameRenderer::~FrameRenderer() = default;

const std::string& FrameRenderer::backendName() const {
  return state_->gl.contextName();
}

Image FrameRenderer::render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                            Progress* progress) {
  State& state = *state_;
  statistics = {};
  Image image;
  {
    const StageTimer total(statistics.total_s);
    const ProjectionSettings settings = settingsFor(state.cache.manifest(), camera, options);
    const FrameBudget budget =
        FrameBudget::of(options.memory_bytes, state.indexBytes(), options.size, options.threads);
    Cut cut;
    {
      const StageTimer timer(statistics.plan_s);
      cut = state.plan(settings, options.lod_pixels);
    }
    if (progress) progress->begin("drawing", cut.bricks.size(), "bricks");

    SegmentRing ring(budget.ring_splats);
    FrameWorkers workers({state.cache, state.variable, cut.bricks, settings, state.table}, ring,
                         budget.workers);
    state.gl.run([&](const GlContext&) {
      state.painter->begin(options.size, options.background, state.table, settings.per_pixel);
      for (size_t drawn = 0; drawn < cut.bricks.size(); ++drawn) {
        std::optional<std::span<const ScreenSplat>> segment;
        {
          const StageTimer timer(statistics.painter_waited_s);
          segment = ring.next();
        }
        if (!segment) return;  // a worker has failed
        state.painter->draw(*segment);
        ring.release();
        if (progress) progress->advance(1);
      }
      image = state.painter->end();
    });
    workers.finish(statistics);
    if (progress) progress->end();

    statistics.upload_s = state.painter->uploadSeconds();
    statistics.draw_s = state.painter->drawSeconds();
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
