// The frames of a `render` command, one after the other.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "render/frame/step_player.h"
#include "stream/base/progress.h"
#include "stream/cache/manifest.h"
#include "tools/commands/render_statistics.h"
#include "tools/options/annotation_arguments.h"
#include "tools/options/camera_motion.h"
#include "tools/options/channel_arguments.h"
#include "tools/options/frame_arguments.h"
#include "tools/options/motion_in_time.h"
#include "tools/options/opacity_arguments.h"
#include "tools/options/scalar_arguments.h"
#include "tools/options/step_arguments.h"
#include "tools/options/surface_arguments.h"
#include "tools/output/frame_output.h"

namespace curvisplat {

/// Command-line arguments as given; checked and parsed later.
struct RenderArguments {
  std::filesystem::path cache, output, first_image, statistics, trace;
  std::vector<std::filesystem::path> solutions;  // of a grid in place of the cache
  CameraArguments camera;
  ScalarArguments scalar;
  OpacityArguments opacity;
  SurfaceArguments surfaces;
  StepArguments steps;
  FrameArguments frame;
  std::string backend = "auto", value_precision = "normal";
  std::optional<std::string> frame_rate, part, channels;
  AnnotationArguments annotations;
};

bool severalFrames(const RenderArguments& arguments);
/// What the pictures have beside their colours. Throws UsageError.
ValueChannels channelsOf(const RenderArguments& arguments);

/// What the frames are drawn from, and where they and what is known of them go.
struct FrameJob {
  const RenderArguments& arguments;
  const Manifest& manifest;
  StepPlayer& player;
  FrameOutput* output;  // null at ranks that write nothing
  RenderReport& report;
  std::function<void()> step_changed;  // called when the player is at another step than before
};

/// Draws the frames `numbers`. Pictures that were written are kept if a later frame fails. Throws Interrupted after
/// progress.stop().
///
/// Several ranks draw a frame each, if there are as many frames: a round. Otherwise they draw each frame together
/// (FrameOptions::ranks), and rank 0 writes it.
void drawFrames(const FrameJob& job, const MotionInTime& motion, const std::vector<uint64_t>& numbers,
                Progress& progress);

}  // namespace curvisplat
