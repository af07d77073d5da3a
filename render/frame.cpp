#include "render/frame.h"

#include "render/frame_pipeline.h"
#include "render/frame_plan.h"
#include "stream/error.h"
#include "stream/stage_timer.h"

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
    const FramePlan plan = timed(statistics.plan_s, [&] { return planner.plan(camera, options); });
    return pipeline.draw(plan, options, statistics, progress);
  }

  const FramePlanner planner;
  FramePipeline pipeline;
};

FrameRenderer::FrameRenderer(const CacheReader& cache, size_t variable,
                             const TransferFunction& transfer_function, Backend backend)
    : state_(std::make_unique<State>(cache, variable, transfer_function, backend)) {}

FrameRenderer::~FrameRenderer() = default;

const std::string& FrameRenderer::backendName() const {
  return state_->pipeline.backendName();
}

Image FrameRenderer::render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                            Progress* progress) {
  const FramePipeline::Running running(state_->pipeline);
  return state_->render(camera, options, statistics, progress);
}

void FrameRenderer::renderProgressively(const Camera& camera, const FrameOptions& options,
                                        FrameStatistics& statistics, const ShowPicture& show,
                                        Progress* progress) {
  const FramePipeline::Running running(state_->pipeline);
  statistics = {};
  Image picture;
  bool is_final = false;
  {
    const StageTimer total(statistics.total_s);
    const FirstPicturePlan first =
        timed(statistics.plan_s, [&] { return state_->planner.planFirst(camera, options); });
    picture = state_->pipeline.draw(first.plan, options, statistics, progress);
    if (!first.size.isWhole()) picture = first.size.enlarge(picture);
    is_final = first.isFinal();
  }
  show(picture, is_final);
  if (is_final) return;
  picture = Image();
  show(state_->render(camera, options, statistics, progress), true);
}

void FrameRenderer::cancel() {
  state_->pipeline.cancel();
}

void FrameRenderer::prefetch(const Camera& camera, const FrameOptions& options) {
  try {
    state_->pipeline.prefetch(state_->planner.plan(camera, options), options);
  } catch (const Error&) {
    // render() will say it.
  }
}

}  // namespace curvisplat
