#include "tools/commands/render_checks.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/paths.h"
#include "tools/options/camera_motion.h"
#include "tools/options/channel_arguments.h"
#include "tools/options/frame_arguments.h"
#include "tools/options/frame_part.h"
#include "tools/options/opacity_arguments.h"
#include "tools/options/option_parsers.h"
#include "tools/options/scalar_arguments.h"
#include "tools/options/surface_arguments.h"
#include "tools/output/frame_output.h"
#include "tools/output/launched_ranks.h"
#include "tools/output/movie_writer.h"
#include "tools/output/output_paths.h"

namespace curvisplat {
namespace {

void checkPartArguments(const RenderArguments& arguments) {
  if (!arguments.part) return;
  parsePart(*arguments.part);
  if (!severalFrames(arguments))
    throw UsageError(
        "--part {}: shares out several frames, but there is only one; give --orbit, --path or --steps",
        *arguments.part);
  if (isMovieName(arguments.output))
    throw UsageError(
        "--part {}: a part of a movie cannot be joined with others; write numbered pictures, -o "
        "frame_%04d.png, and join them with ffmpeg",
        *arguments.part);
  if (!arguments.first_image.empty())
    throw UsageError("--part {}: cannot be combined with --first-image, which is of frame 0 alone",
                     *arguments.part);
}

}  // namespace

void checkRenderArguments(const RenderArguments& arguments, ImageSize size) {
  checkMotionArguments(arguments.camera, arguments.steps);
  checkFunctionArguments(arguments.scalar);
  checkOpacityArguments(arguments.opacity, arguments.scalar, arguments.surfaces);
  checkSurfaceArguments(arguments.surfaces, !arguments.opacity.by.scalar.empty());
  checkAnnotationArguments(arguments.annotations);
  checkOutputName(arguments.output, severalFrames(arguments), size);
  checkPartArguments(arguments);
  if (!arguments.first_image.empty() && !launchedRanks().alone())
    throw UsageError("--first-image {}: one process draws it; start curvisplat without mpirun",
                     arguments.first_image.string());
  if (arguments.frame_rate && !isMovieName(arguments.output))
    throw UsageError("--frame-rate needs a movie: -o NAME.mp4 or NAME.gif");
  if (arguments.frame.background == "transparent" && arguments.output.extension() != ".png" &&
      arguments.output.extension() != ".exr")
    throw UsageError("--background transparent: {} files have no transparency; use .png or .exr",
                     arguments.output.extension().string());
  parseBackend(arguments.backend);
  if (channelsOf(arguments).any() && !arguments.first_image.empty())
    throw UsageError("--first-image {}: a first picture has no channels of values; leave out --channels",
                     arguments.first_image.string());
  std::vector<std::filesystem::path> others{arguments.cache, arguments.camera.path,
                                            arguments.scalar.transfer_function.value_or("")};
  checkOutputFile("-o", arguments.output, others);
  if (severalFrames(arguments) && !isMovieName(arguments.output)) {
    const FrameNames names(arguments.output);
    checkOutputFolder("-o", names.of(std::max<uint64_t>(arguments.camera.frames.value_or(1), 1) - 1));
    const uint64_t most = arguments.steps.severalSteps() ? kMaxFrames : arguments.camera.frameCount();
    const auto check_other = [&](const char* option, const std::filesystem::path& other) {
      if (names.include(linkTarget(other), most))
        throw Error("{} {}: a frame of -o would overwrite it; choose another name", option, other.string());
    };
    check_other("--first-image", arguments.first_image);
    check_other("--stats", arguments.statistics);
  }
  if (!arguments.first_image.empty()) {
    checkImageName(arguments.first_image);
    checkOutputFile("--first-image", arguments.first_image, others);
  }
  others.insert(others.end(), {arguments.output, arguments.first_image});
  if (!arguments.statistics.empty()) checkOutputFile("--stats", arguments.statistics, others);
}

void requireSameCache(const CacheReader& cache, Ranks& ranks) {
  if (ranks.alone()) return;
  const std::string own = cache.seriesManifest().toJson();
  const auto sent = fromBytes<char>(ranks.broadcast(toBytes(std::vector<char>(own.begin(), own.end()))));
  if (!std::equal(own.begin(), own.end(), sent.begin(), sent.end()))
    throw Error("{}: is another cache here than at rank 0, or another version of it; give all ranks the same",
                cache.path().string());
}

}  // namespace curvisplat
