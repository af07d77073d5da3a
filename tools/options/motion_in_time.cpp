#include "tools/options/motion_in_time.h"

#include <utility>

#include "stream/base/error.h"

namespace curvisplat {

void checkMotionArguments(const CameraArguments& camera, const StepArguments& steps) {
  if (steps.interpolates && !steps.time && !steps.steps && camera.path.empty())
    throw UsageError("--interpolate needs --time, --steps or a --path whose key frames have times");
  CameraArguments without_time = camera;
  if (steps.interpolates && steps.steps) without_time.frames.reset();
  checkCameraArguments(without_time);
}

CameraArguments framesOf(const CameraArguments& arguments, const std::vector<StepPosition>& steps) {
  CameraArguments with_frames = arguments;
  if (arguments.moves() && !arguments.frames && steps.size() > 1) with_frames.frames = steps.size();
  return with_frames;
}

MotionInTime inTime(const CameraMotion& motion, const Series& series, const StepArguments& arguments,
                    const std::vector<StepPosition>& chosen, std::optional<uint64_t> frames) {
  const auto at = [&series, interpolates = arguments.interpolates](double time) {
    return interpolates ? series.between(time) : StepPosition{series.nearest(time)};
  };
  MotionInTime timed{motion.frames, motion.camera, {}};
  if (motion.series_time) {
    if (arguments.step || arguments.time || arguments.steps)
      throw UsageError(
          "--path: its key frames have times of the series; leave out --step, --time and --steps");
    timed.position = [at, time = motion.series_time](uint64_t frame) { return at(time(frame)); };
    return timed;
  }
  if (timed.frames == 1 && chosen.size() > 1) {
    timed.frames = arguments.interpolates ? frames.value_or(chosen.size()) : chosen.size();
    timed.camera = [camera = motion.camera(0)](uint64_t) { return camera; };
  }
  const uint64_t count = timed.frames;
  if (arguments.interpolates && chosen.size() > 1 && count > 1) {
    const double first = series.timeAt(chosen.front()), last = series.timeAt(chosen.back());
    timed.position = [=, end = chosen.back()](uint64_t frame) {
      const double part = static_cast<double>(frame) / static_cast<double>(count - 1);
      return frame + 1 == count ? end : at(first + part * (last - first));
    };
    return timed;
  }
  timed.position = [chosen, count](uint64_t frame) { return chosen[frame * chosen.size() / count]; };
  return timed;
}

}  // namespace curvisplat
