// Where each frame lies in a series of time steps.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "stream/cache/steps_file.h"
#include "tools/options/camera_motion.h"
#include "tools/options/step_arguments.h"

namespace curvisplat {

/// Throws UsageError if --interpolate has nothing to interpolate, or --frames nothing to spread. Instead of
/// checkCameraArguments() for a command that draws series.
void checkMotionArguments(const CameraArguments& camera, const StepArguments& steps);

/// A camera and a time per frame.
struct MotionInTime {
  uint64_t frames = 1;
  std::function<Camera(uint64_t frame)> camera;
  std::function<StepPosition(uint64_t frame)> position;
};

/// The arguments with a frame for each of several time steps, unless --frames says how many.
CameraArguments framesOf(const CameraArguments& arguments, const std::vector<StepPosition>& steps);

/// The motion through a series, which must outlive it. A path whose key frames have times goes by these. Otherwise the
/// chosen steps are spread evenly over the frames; interpolated, the time from the first to the last of them is.
/// A camera that stands gets a frame for each step, or as many as --frames says. Throws UsageError if a path's times
/// contradict options.
MotionInTime inTime(const CameraMotion& motion, const Series& series, const StepArguments& arguments,
                    const std::vector<StepPosition>& chosen, std::optional<uint64_t> frames);

}  // namespace curvisplat
