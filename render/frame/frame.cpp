#include "render/frame/frame.h"

#include "render/frame/first_picture.h"
#include "render/frame/frame_pipeline.h"
#include "render/frame/frame_plan.h"
#include "render/frame/joined_tiles.h"
#include "stream/base/check.h"
#include "stream/base/error.h"
#include "stream/base/stage_timer.h"

namespace curvisplat {
namespace {

template <typename Work>
auto timed(double& seconds, const Work& work) {
  const StageTimer timer(seconds);
  return work();
}

}  // namespace

struct FrameRenderer::State {
  State(const CacheReader& cache, size_t variable, const TransferFunction& transfer_function, Backend backend)
      : planner(cache, variable, transfer_function), pipeline(cache, variable, planner, backend) {}

  Image render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
               Progress* progress) {
    statistics = {};
    const StageTimer total(statistics.total_s);
    FramePlan plan =
        timed(statistics.plan_s, [&] { return planner.plan(camera, options, pipeline.order()); });
    std::vector<uint32_t> owners;
    if (options.ranks) owners = planner.share(plan, options);
    pipeline.drawLayers(plan, options, statistics);
    Image image = pipeline.draw(plan, options, statistics, progress);
    if (options.ranks) joinTiles(image, owners, *options.ranks);
    return image;
  }

  Image renderQuickly(const Camera& camera, const FrameOptions& options, const QuickLimits& limits,
                      FrameStatistics& statistics, bool& is_final, Progress* progress) {
    CURVISPLAT_CHECK(!options.ranks && "one process draws a quick picture");
    statistics = {};
    const StageTimer total(statistics.total_s);
    QuickPlan quick = timed(statistics.plan_s,
                            [&] { return planner.planQuick(camera, options, limits, pipeline.order()); });
    is_final = quick.isFinal();
    pipeline.drawLayers(quick.plan, options, statistics);
    Image picture = pipeline.draw(quick.plan, options, statistics, progress);
    return quick.size.isWhole() ? picture : quick.size.enlarge(picture);
  }

  FramePlanner planner;
  FramePipeline pipeline;
};

FrameRenderer::FrameRenderer(const CacheReader& cache, size_t variable,
                             const TransferFunction& transfer_function, Backend backend)
    : state_(std::make_unique<State>(cache, variable, transfer_function, backend)) {}

FrameRenderer::~FrameRenderer() = default;

const std::string& FrameRenderer::backendName() const {
  return state_->pipeline.backend().name();
}

bool FrameRenderer::drawsInSoftware() const {
  return state_->pipeline.backend().isSoftware();
}

Image FrameRenderer::render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                            Progress* progress) {
  state_->pipeline.endPrefetch();
  return state_->render(camera, options, statistics, progress);
}

void FrameRenderer::renderProgressively(const Camera& camera, const FrameOptions& options,
                                        FrameStatistics& statistics, const ShowPicture& show,
                                        Progress* progress) {
  state_->pipeline.endPrefetch();
  bool is_final = false;
  Image picture = state_->renderQuickly(camera, options, kFirstPicture, statistics, is_final, progress);
  show(picture, is_final);
  if (is_final) return;
  picture = Image();
  show(state_->render(camera, options, statistics, progress), true);
}

Image FrameRenderer::renderQuickly(const Camera& camera, const FrameOptions& options,
                                   const QuickLimits& limits, FrameStatistics& statistics, bool& is_final) {
  state_->pipeline.endPrefetch();
  return state_->renderQuickly(camera, options, limits, statistics, is_final, nullptr);
}

void FrameRenderer::prefetch(const Camera& camera, const FrameOptions& options) {
  try {
    state_->pipeline.prefetch(state_->planner.plan(camera, options, state_->pipeline.order()), options);
  } catch (const Error&) {
    // render() will report it.
  }
}

void FrameRenderer::prefetch(const Camera& camera, const FrameOptions& options, const QuickLimits& limits) {
  try {
    state_->pipeline.prefetch(
        state_->planner.planQuick(camera, options, limits, state_->pipeline.order()).plan, options);
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

}  // namespace curvisplat
