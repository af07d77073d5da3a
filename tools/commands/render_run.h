// A `render` command after its options are parsed: checks of the options together and of the caches of
// several ranks, before anything is drawn, and then the frames, one after the other. For the main thread;
// drawing starts its own threads.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "render/frame/frame.h"
#include "render/image/image.h"
#include "stream/base/progress.h"
#include "stream/base/ranks.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/manifest.h"
#include "tools/commands/render_statistics.h"
#include "tools/options/annotation_arguments.h"
#include "tools/options/frame_arguments.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/opacity_arguments.h"
#include "tools/options/picture_choice.h"
#include "tools/options/scene_arguments.h"
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
  std::string backend = "auto", value_precision = "auto";
  std::optional<std::string> frame_rate, part, channels;
  AnnotationArguments annotations;
};

/// Whether the command draws a sequence of frames: a moving camera, or several time steps.
bool severalFrames(const RenderArguments& arguments);
/// The values that the pictures have beside their colours (--channels). Throws UsageError.
ValueChannels channelsOf(const RenderArguments& arguments);

/// The cache, or the files of the grid, and the files that other options name: what outputs must not overwrite.
std::vector<std::filesystem::path> inputsOf(const RenderArguments& arguments);

/// Needs no cache. `size`: of the picture. Throws UsageError if options contradict each other, and Error if
/// an output cannot be written.
void checkRenderArguments(const RenderArguments& arguments, ImageSize size);

/// Reads the film of --path, if it is given: its scalar, and its first function. Call it after checkRenderArguments(). Throws
/// UsageError for options that the film states itself, and Error if the file is invalid.
void takeFilm(RenderArguments& arguments);

/// Throws Error at ranks that have opened another cache than rank 0, or another version of it: each rank
/// draws a share, which must be of the same data.
void requireSameCache(const CacheReader& cache, Ranks& ranks);

/// The inputs of the frames, and the destination of pictures and statistics.
struct FrameJob {
  const RenderArguments& arguments;
  const Manifest& manifest;
  StepPlayer& player;
  FrameOutput* output;  // null at ranks that write nothing
  RenderReport& report;
  std::function<void()> step_changed;        // called when the player is at another time than before
  std::function<void(uint64_t frame)> show;  // called before a frame is drawn, for a film's function and cuts
  std::optional<AnnotatedScene::OnGlobe> box;  // of the axes grid
};

/// Draws the frames `numbers`. Pictures that were written are kept if a later frame fails. Throws
/// Interrupted after progress.stop().
///
/// Where there are at least as many frames as ranks, the ranks draw in rounds, in which each draws a frame.
/// Otherwise they draw each frame together (FrameOptions::ranks), and rank 0 writes it.
void drawFrames(const FrameJob& job, const MotionInTime& motion, const std::vector<uint64_t>& numbers,
                Progress& progress);

}  // namespace curvisplat
