#include "render/frame/frame.h"

#include <utility>

#include "render/backend/pixel_values.h"
#include "render/frame/first_picture.h"
#include "render/frame/frame_pipeline.h"
#include "render/frame/frame_plan.h"
#include "render/project/painter_failure.h"
#include "render/project/screen_splat.h"
#include "render/ranks/picture_shares.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

template <typename Work>
auto timed(double& seconds, const char* name, const Work& work) {
  const StageTimer timer(seconds, name);
  return work();
}

}  // namespace

struct FrameRenderer::State {
  State(const CacheReader& cache_, const DrawnScalars& scalars_, Backend backend)
      : cache(cache_),
        scalars(scalars_),
        planner(cache_, scalars_),
        pipeline(cache_, scalars_, planner, backend) {}
  State(const CacheReader& cache_, const DrawnScalars& scalars_, std::unique_ptr<PaintingBackend> backend)
      : cache(cache_),
        scalars(scalars_),
        planner(cache_, scalars_),
        pipeline(cache_, scalars_, planner, std::move(backend)) {}

  /// Draws by the next backend where one cannot go on; where the card refuses memory, by the same with less, once. All ranks
  /// draw again if one has to, each until it has no further backend.
  template <typename Draw>
  Image withBackends(const Draw& draw) {
    for (bool may_give_up = true;;) {
      std::string why;
      bool of_memory = false;
      try {
        return draw();
      } catch (const OtherPainterFailure&) {
        continue;
      } catch (const PainterFailure& failure) {
        why = failure.what();
        of_memory = dynamic_cast<const CardMemoryFailure*>(&failure) != nullptr;
      }
      if (!of_memory || !std::exchange(may_give_up, false) || !pipeline.giveCardMemoryUp())
        pipeline.fallBack(why);
    }
  }

  Image render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
               Progress* progress) {
    statistics = {};
    pipeline.setAside(0, 0, options);
    const StageTimer total(statistics.total_s, "frame", TraceKind::kStage);
    FramePlan plan = timed(statistics.plan_s, "plan", [&] { return planner.plan(camera, options); });
    planner.share(plan, options);
    pipeline.drawLayers(plan, options, statistics, progress);
    Image image = pipeline.draw(plan, options, statistics, progress);
    joinTiles(image, plan.shared.owners, *options.ranks);
    return image;
  }

  Image renderWithValues(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                         PixelValues& values, Progress* progress) {
    FrameOptions clear = options;
    clear.background = glm::vec4(0.0f);
    statistics = {};
    // Where the memory has room for both painters, the second draws of the bricks that the first has decoded.
    const size_t waiting = FrameBudget::kMinWaitingSplats + clear.memory_bytes / 32 / sizeof(ScreenSplat);
    const bool beside =
        pipeline.backend().isSoftware() &&
        pipeline.setAside(valueBytes(clear.size, {.threads = clear.threads, .waiting_splats = waiting}),
                          waiting, clear);
    const StageTimer total(statistics.total_s, "frame", TraceKind::kStage);
    FramePlan plan = timed(statistics.plan_s, "plan", [&] { return planner.plan(camera, clear); });
    planner.share(plan, clear);
    pipeline.drawLayers(plan, clear, statistics, progress);
    Image image = pipeline.draw(plan, clear, statistics, progress);
    if (!beside) pipeline.release();
    Image painted = paintValues(camera, clear, {plan, image, beside}, progress);
    joinTiles(image, plan.shared.owners, *options.ranks);
    joinTiles(painted, plan.shared.owners, *options.ranks);
    if (options.ranks->isFirst()) values = pixelValuesOf(painted, plan.settings.view, depthOrigin(plan));
    for (size_t n = 0; n < image.rgba.size(); n += 4) {
      const float through = 1 - image.rgba[n + 3];
      for (size_t c = 0; c < 4; ++c) image.rgba[n + c] += through * options.background[static_cast<int>(c)];
    }
    return image;
  }

  /// The depth at which depths of pixels begin: that of the layers or, if there are none, that of the data's
  /// middle.
  double depthOrigin(const FramePlan& plan) const {
    if (plan.layers) return plan.layers->depthOrigin();
    const ScreenView& view = plan.settings.view;
    const glm::dvec3 middle = 0.5 * (cache.manifest().lower + cache.manifest().upper);
    return view.projection == Projection::kPerspective ? 0 : view.viewFromData(middle).z;
  }

  struct Drawn {
    const FramePlan& plan;
    const Image& picture;
    bool beside;  // the pipeline has room for the values' painter
  };
  Image paintValues(const Camera& camera, const FrameOptions& options, const Drawn& drawn,
                    Progress* progress) {
    FramePlan plan = planner.plan(camera, options);
    planner.share(plan, options);
    if (drawn.plan.layers) planner.addLayers(plan, drawn.plan.layers, options);
    const PixelLayers all = everywhere(drawn.picture.size, depthOrigin(drawn.plan));
    plan.settings.layers = &all;
    const ValueInputs inputs{drawn.picture, drawn.plan.layers.get(), plan.settings.view};
    FrameStatistics ignored;
    if (drawn.beside) return pipeline.drawBy(*makeValueBackend(inputs), plan, options, ignored, progress);
    FramePipeline values(cache, scalars, planner, makeValueBackend(inputs));
    return values.draw(plan, options, ignored, progress);
  }

  /// Who waits for a quick picture: both may be null.
  struct QuickFor {
    Progress* progress = nullptr;
    std::shared_ptr<CardPicture>* on_card = nullptr;
  };
  Image renderQuickly(const Camera& camera, const FrameOptions& options, const QuickLimits& limits,
                      FrameStatistics& statistics, bool& is_final, const QuickFor& whom) {
    CURVISPLAT_CHECK(options.ranks->alone() && "one process draws a quick picture");
    statistics = {};
    const StageTimer total(statistics.total_s, "frame", TraceKind::kStage);
    QuickPlan quick =
        timed(statistics.plan_s, "plan", [&] { return planner.planQuick(camera, options, limits); });
    is_final = quick.isFinal();
    pipeline.drawLayers(quick.plan, options, statistics, whom.progress);
    Image picture = pipeline.draw(quick.plan, options, statistics, whom.progress, whom.on_card);
    const bool is_left = whom.on_card && *whom.on_card;
    return is_left || quick.size.isWhole() ? picture : quick.size.enlarge(picture);
  }

  const CacheReader& cache;
  const DrawnScalars scalars;  // their variables; functions may change
  FramePlanner planner;
  FramePipeline pipeline;
};

FrameRenderer::FrameRenderer(const CacheReader& cache, const DrawnScalars& scalars, Backend backend)
    : state_(std::make_unique<State>(cache, scalars, backend)) {}

FrameRenderer::FrameRenderer(const CacheReader& cache, const DrawnScalars& scalars,
                             std::unique_ptr<PaintingBackend> backend)
    : state_(std::make_unique<State>(cache, scalars, std::move(backend))) {}

FrameRenderer::~FrameRenderer() = default;

ComputePermits* FrameRenderer::permits() const {
  return state_->pipeline.permits();
}

const std::string& FrameRenderer::backendName() const {
  return state_->pipeline.backend().name();
}

std::unique_ptr<PaintingBackend> FrameRenderer::takeBackend() {
  return state_->pipeline.takeBackend();
}

bool FrameRenderer::drawsInSoftware() const {
  return state_->pipeline.backend().isSoftware();
}

Image FrameRenderer::render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                            Progress* progress) {
  state_->pipeline.endPrefetch();
  return state_->withBackends([&] { return state_->render(camera, options, statistics, progress); });
}

Image FrameRenderer::renderWithValues(const Camera& camera, const FrameOptions& options,
                                      FrameStatistics& statistics, PixelValues& values, Progress* progress) {
  state_->pipeline.endPrefetch();
  return state_->withBackends(
      [&] { return state_->renderWithValues(camera, options, statistics, values, progress); });
}

void FrameRenderer::renderProgressively(const Camera& camera, const FrameOptions& options,
                                        FrameStatistics& statistics, const ShowPicture& show,
                                        Progress* progress) {
  state_->pipeline.endPrefetch();
  bool is_final = false;
  Image picture = state_->withBackends([&] {
    return state_->renderQuickly(camera, options, kFirstPicture, statistics, is_final, {progress});
  });
  show(picture, is_final);
  if (is_final) return;
  picture = Image();
  show(state_->withBackends([&] { return state_->render(camera, options, statistics, progress); }), true);
}

Image FrameRenderer::renderQuickly(const Camera& camera, const FrameOptions& options,
                                   const QuickLimits& limits, FrameStatistics& statistics, bool& is_final,
                                   std::shared_ptr<CardPicture>* on_card) {
  state_->pipeline.endPrefetch();
  return state_->withBackends([&] {
    return state_->renderQuickly(camera, options, limits, statistics, is_final, {nullptr, on_card});
  });
}

void FrameRenderer::prefetch(const Camera& camera, const FrameOptions& options) {
  try {
    state_->pipeline.prefetch(state_->planner.plan(camera, options), options);
  } catch (const Error&) {
    // render() will report it.
  }
}

void FrameRenderer::prefetch(const Camera& camera, const FrameOptions& options, const QuickLimits& limits) {
  try {
    state_->pipeline.prefetch(state_->planner.planQuick(camera, options, limits).plan, options);
  } catch (const Error&) {
    // renderQuickly() will report it.
  }
}

void FrameRenderer::changeStep(const std::function<void()>& change) {
  state_->pipeline.endPrefetch();
  change();
  state_->planner.stepChanged();
  state_->pipeline.stepChanged();
}

void FrameRenderer::setTransferFunction(const TransferFunction& transfer_function) {
  state_->pipeline.endPrefetch();
  state_->planner.setTransferFunction(transfer_function);
}

ScreenView FrameRenderer::screenView(const Camera& camera, const FrameOptions& options) const {
  return state_->planner.screenView(camera, options, options.size);
}

StepPlayer::StepPlayer(CacheReader& cache, const DrawnScalars& scalars, Backend backend, GlSharing* window)
    : cache_(cache),
      scalars_(scalars),
      backend_(backend),
      window_(window),
      renderer_(std::make_unique<FrameRenderer>(cache, scalars, makeBackend(backend, window))) {}

StepPlayer::StepPlayer(CacheReader& cache, const DrawnScalars& scalars,
                       std::unique_ptr<PaintingBackend> backend)
    : cache_(cache),
      scalars_(scalars),
      renderer_(std::make_unique<FrameRenderer>(cache, scalars, std::move(backend))) {}

/// Removes the renderer, which frees its memory and reads no more. Returns its backend, which may have replaced another.
std::unique_ptr<PaintingBackend> StepPlayer::endRenderer() {
  if (!renderer_) return makeBackend(backend_, window_);  // the next one could not be made
  std::unique_ptr<PaintingBackend> backend = renderer_->takeBackend();
  renderer_.reset();
  return backend;
}

void StepPlayer::setTransferFunction(const TransferFunction& transfer_function) {
  scalars_.opacity.function = transfer_function;
  renderer_->setTransferFunction(transfer_function);
}

void StepPlayer::setFunctions(const DrawnScalars& scalars) {
  if (!scalars.colour) return setTransferFunction(scalars.opacity.function);
  scalars_ = scalars;
  std::unique_ptr<PaintingBackend> backend = endRenderer();
  renderer_ = std::make_unique<FrameRenderer>(cache_, scalars_, std::move(backend));
}

void StepPlayer::goTo(const StepPosition& position) {
  if (position == cache_.position()) return;
  CacheReader next = cache_.at(position);
  if (next.sharesGeometryWith(cache_)) {
    renderer_->changeStep([&] { cache_ = std::move(next); });
    return;
  }
  std::unique_ptr<PaintingBackend> backend = endRenderer();
  cache_ = std::move(next);
  renderer_ = std::make_unique<FrameRenderer>(cache_, scalars_, std::move(backend));
}

}  // namespace curvisplat
