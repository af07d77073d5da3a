// `curvisplat render`: renders a cache to pictures or a movie.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "render/annotate/globe_box.h"
#include "render/automatic/stored_steps.h"
#include "render/colour/transfer_function.h"
#include "render/frame/frame.h"
#include "render/image/image_file.h"
#include "render/surface/curve_times.h"
#include "stream/base/error.h"
#include "stream/base/memory.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"
#include "stream/cache/cache_reader.h"
#include "tools/commands/commands.h"
#include "tools/commands/render_run.h"
#include "tools/commands/render_statistics.h"
#include "tools/options/frame_arguments.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/globe_arguments.h"
#include "tools/options/kept_caches.h"
#include "tools/options/opacity_arguments.h"
#include "tools/options/option_parsers.h"
#include "tools/options/picture_choice.h"
#include "tools/options/scene_arguments.h"
#include "tools/options/shared_options.h"
#include "tools/output/command_run.h"
#include "tools/output/empty_picture.h"
#include "tools/output/frame_output.h"
#include "tools/output/launched_ranks.h"
#include "tools/output/picture_page.h"
#include "tools/output/results.h"
#include "tools/output/start_checks.h"

namespace curvisplat {
namespace {

/// Several steps share a function; a path may go through all of them.
ChosenFor drawnSteps(const RenderArguments& arguments) {
  const StepArguments& steps = arguments.steps;
  const bool may_follow_path = !arguments.camera.path.empty() && !steps.step && !steps.time;
  return steps.severalSteps() || may_follow_path ? ChosenFor::kSeries : ChosenFor::kStep;
}

/// Whether a picture has scalar bars without being asked: they say what the colours mean that nobody has chosen.
bool hasBarsByDefault(const RenderArguments& arguments, ImageSize picture) {
  constexpr int kMinSide = 300;  // pixels; below, bars would leave too little to the data
  return hasAnnotations() && !arguments.annotations.no_bars &&
         givenFunctionOptions(arguments.scalar).empty() && arguments.surfaces.volume == "on" &&
         arguments.camera.path.empty() && std::min(picture.width, picture.height) >= kMinSide &&
         (isMovieName(arguments.output) || arguments.output.extension() == ".png");
}

/// Memory, in bytes, that annotating and writing a picture take. `data`: the part beside the scalar bars.
uint64_t outputBytes(const RenderArguments& arguments, ImageSize picture, ImageSize data) {
  uint64_t bytes = 0;
  if (isPageName(arguments.output))
    bytes = 2 * writingBytes("frame.png", picture);  // and as text
  else if (isMovieName(arguments.output))
    bytes = 3 * picture.pixels();
  else
    bytes = writingBytes(arguments.output, picture);
  const ValueChannels channels = channelsOf(arguments);
  if (channels.any())
    bytes += picture.pixels() * (sizeof(float) * (5 + channels.count()) + kChannelBytes * channels.count());
  if (!arguments.first_image.empty()) bytes = std::max(bytes, writingBytes(arguments.first_image, picture));
  // Tiles or pictures of other ranks, as they come and as they are put in their places.
  if (!launchedRanks().alone()) bytes = std::max(bytes, 2 * 4 * sizeof(float) * picture.pixels());
  if (!(arguments.annotations.shown == Annotations{})) {
    bytes += annotatedBytes(picture, data);
    if (!arguments.first_image.empty()) bytes += 4 * sizeof(float) * data.pixels();  // a copy of the first
  }
  return bytes;
}

/// The memory that the program and MPI take before anything is drawn. On a cluster the limit of a rank is the
/// job's, which includes it.
uint64_t programBytes() {
  returnFreedMemory();
  return ProcessUsage::now().memory_bytes;
}

/// Describes what a stopped run has done, and left.
std::string howFar(const RenderReport& report, uint64_t frames, bool several) {
  const std::string output = report.output.string();
  if (!several) return fmt::format("interrupted; {} was not written", output);
  return fmt::format("interrupted after {} of {} frames; {}", report.frames.size(), frames,
                     isMovieName(output) ? output + " was not written" : "the pictures of these are kept");
}

/// The splats of a picture: the volume's, and those among which isosurfaces lie.
std::string splatsText(const FrameStatistics& frame, const std::string& scalar) {
  const std::string volume = fmt::format("{} of {} in {}", countText(frame.splats_drawn, "splat"), scalar,
                                         countText(frame.bricks_drawn, "brick"));
  if (frame.iso_bricks == 0) return volume;
  const std::string isosurfaces = fmt::format("isosurfaces in {} of {}", countText(frame.iso_splats, "splat"),
                                              countText(frame.iso_bricks, "brick"));
  return frame.splats_drawn == 0 ? isosurfaces : volume + ", " + isosurfaces;
}

void printResult(const RenderReport& report) {
  if (report.frames.empty()) {
    printLine("{}: no frames in this part", report.output.string());
    return;
  }
  const FrameStatistics& last = report.frames.back().statistics;
  if (report.frames.size() == 1) {
    printLine("{}: {}, {:.2f} s, {}", report.output.string(), splatsText(last, report.variable.name),
              last.total_s, report.backend);
    return;
  }
  double total_s = 0;
  for (const FrameReport& frame : report.frames) total_s += frame.statistics.total_s;
  printLine("{}: {} frames of {}, {:.2f} s per frame, {}", report.output.string(), report.frames.size(),
            report.variable.name, total_s / static_cast<double>(report.frames.size()), report.backend);
}

/// The cache; of a grid the one that is kept for it.
std::filesystem::path cacheToDraw(const RenderArguments& arguments) {
  std::vector<std::filesystem::path> files{arguments.cache};
  files.insert(files.end(), arguments.solutions.begin(), arguments.solutions.end());
  const ValuePrecision precision = parseValuePrecision("--value-precision", arguments.value_precision);
  if (!isGrid(files)) {
    if (precision != ValuePrecision::kAuto)
      throw UsageError("--value-precision {}: is for grids; {} is a cache, which has its own",
                       arguments.value_precision, arguments.cache.string());
    return arguments.cache;
  }
  if (!launchedRanks().alone())
    throw Error("{}: several processes draw from a cache; convert the grid first", files.front().string());
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  KeptCacheEvents events;
  events.say = [](const std::string& text) { printMessage("{}", text); };
  std::vector<std::string> scalars = isoScalars(arguments.surfaces);
  scalars.insert(scalars.end(),
                 {arguments.scalar.scalar, arguments.opacity.by.scalar, arguments.surfaces.surface_by});
  return keptCacheOf(files, progress, events, scalars, precision);
}

void render(const RenderArguments& given) {
  RenderArguments arguments = given;
  Ranks& ranks = launchedRanks();
  FrameOptions options = frameOptions(arguments.frame);
  arguments.annotations.showTitles();
  bool& has_bars = arguments.annotations.shown.scalar_bar;
  const bool bars_by_default = !has_bars && hasBarsByDefault(arguments, options.size);
  has_bars |= bars_by_default;
  arguments.surfaces.film_has_slices =
      !arguments.camera.path.empty();  // unless it turns out that it has none
  checkRenderArguments(arguments, options.size);
  takeFilm(arguments);
  options.threads = threadsOrCores(options.threads);
  const double frames_per_s =
      arguments.frame_rate ? parsePositive("--frame-rate", *arguments.frame_rate) : 25;

  arguments.cache = cacheToDraw(arguments);
  CacheReader cache = openAtStep(arguments.cache, arguments.steps, arguments.scalar.scalar);
  requireSameCache(cache, ranks);
  const std::vector<StepPosition> steps = chosenSteps(arguments.steps, cache);
  const Manifest manifest = cache.manifest();  // of the first step
  const std::optional<Globe> globe = globeOf(arguments.surfaces.globe, manifest);
  options.scale = verticallyScaled(options.scale, arguments.frame.vertical_scale, globe);
  if (arguments.camera.film)
    arguments.camera.film = std::make_shared<const Film>(arguments.camera.film->inScale(options.scale));
  arguments.scalar.with_sheets = !arguments.surfaces.slices.empty() || arguments.surfaces.film_has_slices ||
                                 !arguments.surfaces.surface_by.empty();
  const size_t shown = chooseVariable(cache, arguments.scalar);
  const ChosenFor drawn = drawnSteps(arguments);
  ScalarChoice choice = chooseScalars(arguments.opacity, arguments.scalar, cache, shown, options, drawn);
  const DrawnScalars& scalars = choice.scalars;
  const size_t variable = scalars.opacity.variable;
  const TransferFunction& transfer_function = scalars.opacity.function;
  const TransferFunction& colours = scalars.colour ? scalars.colour->function : transfer_function;
  for (const std::string& note : transfer_function.notes()) printMessage("note: {}", note);
  if (scalars.colour)
    for (const std::string& note : colours.notes()) printMessage("note: {}", note);
  for (const auto& [of, function] : {std::pair(variable, &transfer_function), {shown, &colours}}) {
    const std::string range_warning = rangeMissesScalar(variableFor(cache, of, drawn), *function);
    if (!range_warning.empty()) printMessage("warning: {}", range_warning);
    if (!scalars.colour) break;
  }

  options.scene =
      sceneOf(arguments.surfaces, cache,
              {shown, variable, !arguments.opacity.by.scalar.empty(), mapsOn(options.background)});
  if (const std::string idle = surfaceColourWithoutEffect(arguments.surfaces); !idle.empty())
    printMessage("warning: {}", idle);
  for (const std::string& miss : slicesThatMiss(arguments.surfaces, manifest.lower, manifest.upper))
    printMessage("warning: {}", miss);
  if (options.scene)
    for (const std::string& miss :
         curvesThatMiss(arguments.surfaces, *options.scene, manifest.lower, manifest.upper))
      printMessage("warning: {}", miss);
  std::vector<ShownAxis> axes{{variable, transfer_function.axis()}};
  if (scalars.colour) axes.push_back({shown, colours.axis()});
  for (const std::string& finer :
       finerThanStored(cache, {axes, askedIsovalues(options.scene.get(), variable, shown)}))
    printMessage("warning: {}", finer);

  const ImageSize picture = options.size;
  if (4 * arguments.annotations.shown.text_size > std::min(picture.width, picture.height))
    printMessage("warning: --text-size {}: texts may not fit into {}x{} pixels, or cover the data",
                 *arguments.annotations.text_size, picture.width, picture.height);
  const std::vector<ShownFunction> functions = shownFunctions(
      arguments.annotations, scalars, manifest, options.scene.get(), arguments.surfaces.surface_by);
  options.size = dataSize(arguments.annotations.shown, picture, functions);
  options.output_bytes = outputBytes(arguments, picture, options.size);
  const bool has_grid = arguments.annotations.shown.axes_grid;
  const bool has_box = arguments.annotations.shown.lieBehind();
  const Series series = cache.series();
  const auto box_on_globe = has_grid ? boxOnGlobe(cache, globe) : std::nullopt;
  const ShownBox box =
      withGrid(shownBox(manifest, options.scale, options.clip_box, arguments.annotations.shown), box_on_globe,
               options.scale);
  const CameraArguments camera = choice.picture.camera(
      placedAbove(framesOf(arguments.camera, steps), globe, options.scale), transfer_function,
      {box, options.size, has_box || options.clip_box.has_value(),
       boxOnEarth(arguments.surfaces.map, cache, globe)});
  choice.picture.release();
  const MotionInTime motion = inTime(chooseCameraMotion(camera, box, options.size), series, arguments.steps,
                                     steps, arguments.camera.frames);
  const std::vector<uint64_t> numbers =
      (arguments.part ? parsePart(*arguments.part) : FramePart{}).of(motion.frames);
  // A rank has a picture to itself where there are enough of them.
  if (!ranks.alone() && numbers.size() < ranks.count()) options.ranks = &ranks;
  if (!ranks.alone()) options.output_bytes += programBytes();
  requireThreads(options.threads);
  Progress progress{ranks.isFirst() ? progressBar() : Progress::Display{}};
  const StopOnSignals stopping(progress);
  const StopRanksWith stopping_ranks(ranks, progress);
  const bool writes_own = options.ranks->alone() && !isMovieName(arguments.output);
  const auto output = ranks.isFirst() || writes_own
                          ? makeFrameOutput(arguments.output, severalFrames(arguments), picture, frames_per_s)
                          : nullptr;
  StepPlayer player(cache, scalars, parseBackend(arguments.backend));
  RenderReport report{arguments.cache,
                      arguments.output,
                      picture,
                      scalars,
                      manifest.variables[variable],
                      options,
                      player.renderer().backendName(),
                      ranks.count(),
                      {},
                      {},
                      {},
                      scalars.colour ? &manifest.variables[shown] : nullptr,
                      functions,
                      options.background};
  // The grid and edges of the box lie behind the data, before the background.
  if (has_box) options.background = glm::vec4(0);
  const auto noteBackend = [&] {
    if (player.renderer().backendName() == report.backend) return;
    report.backend = player.renderer().backendName();
    printMessageOfRank(fmt::format("warning: OpenGL could not go on; drawn by {}", report.backend));
  };
  const auto writeReport = [&] {
    if (!arguments.statistics.empty() && ranks.isFirst())
      writeStatistics(arguments.statistics, statisticsOf(report));
  };
  const auto step_changed = [&, first = options.scene, step = cache.step()]() mutable {
    // Between two steps the faces stay, and their meshes with them.
    const bool same_step = std::exchange(step, cache.step()) == cache.step();
    options.scene =
        same_step ? sceneAtTime(options.scene, cache.time()) : sceneAt(arguments.surfaces, cache, first);
  };
  const auto show = [&](uint64_t frame) {
    if (!motion.look) return;
    const KeyLook look = motion.look(frame);
    const Film::Stated& has = arguments.camera.film->stated();
    if (has.clip_boxes) options.clip_box = look.clip_box;
    if (has.clip_planes) options.clip_planes = *look.clip_planes;
    if (has.slices) {
      auto scene = std::make_shared<SurfaceScene>(*options.scene);
      scene->slices = *look.slices;
      options.scene = std::move(scene);
    }
    if (!arguments.camera.film->functionsChange()) return;
    DrawnScalars& drawn_now = choice.scalars;  // scalar bars show it
    (drawn_now.colour ? *drawn_now.colour : drawn_now.opacity).function =
        TransferFunction(*look.function, nullptr, look.function->opacity_unit);
    player.setFunctions(drawn_now);
  };
  try {
    drawFrames({arguments, manifest, player, output.get(), report, step_changed, show, box_on_globe}, motion,
               numbers, progress);
  } catch (const Interrupted& interrupted) {
    progress.end();
    noteBackend();
    writeReport();
    throw Interrupted(interrupted.signal(), howFar(report, numbers.size(), severalFrames(arguments)));
  }
  noteBackend();
  if (!ranks.isFirst()) return;
  writeReport();
  printResult(report);
  if (const std::string chosen = choice.chosenOptions(); !chosen.empty())
    printLine("chosen from the data: {}{}", chosen, bars_by_default ? " --scalar-bar" : "");
}

}  // namespace

void addRender(CLI::App& app) {
  auto arguments = std::make_shared<RenderArguments>();
  CLI::App* command = app.add_subcommand("render", "Render a cache to pictures or a movie");
  command
      ->add_option(
          "CACHE", arguments->cache,
          "Splat cache, a directory NAME.splats; or a grid, which is converted into the user's cache "
          "folder")
      ->required();
  command->add_option("SOLUTION", arguments->solutions, "Further files of the grid");
  addValuePrecisionOption(*command, arguments->value_precision);
  command
      ->add_option(
          "-o,--output", arguments->output,
          "Picture to write: .png, .exr or .pfm. Of several frames: frame_%04d.png, NAME.mp4 or .gif (by "
          "ffmpeg), or NAME.html, a web page with the pictures in it")
      ->required();
  addSizeOption(*command, arguments->frame.size);
  addScalarOption(*command, arguments->scalar);

  const std::string what = "Data and colours";
  addFunctionOptions(*command, arguments->scalar, what);
  const std::string surfaces = "Surfaces and slices";
  addOpacityOptions(*command, arguments->opacity, what);
  command
      ->add_option("--classify", arguments->frame.classify,
                   "Classification: pixel (colour varies within a splat) or flat (one colour per splat)")
      ->capture_default_str()
      ->group(what);
  addLodPixelsOption(*command, arguments->frame.lod_pixels)->group(what);
  addMaxSplatsOption(*command, arguments->frame.max_splats, " (default: no limit)")->group(what);
  command->add_option("--scale", arguments->frame.scale, "Scale factors sx,sy,sz of the data")
      ->capture_default_str()
      ->group(what);
  command
      ->add_option(
          "--vertical-scale", arguments->frame.vertical_scale,
          "Vertical exaggeration factor: stretches z, of a flat map in place of the factor that it was "
          "converted with. Numbers on axes stay true. Not for data on a sphere")
      ->group(what);
  command
      ->add_option("--clip-box", arguments->frame.clip_box,
                   "Box x0,x1,y0,y1,z0,z1 outside which nothing is drawn, in coordinates before --scale")
      ->group(what);
  command
      ->add_option(
          "--clip-plane", arguments->frame.clip_planes,
          "Plane px,py,pz,nx,ny,nz through the point p: nothing is drawn behind it, where the normal n "
          "does not point. In coordinates before --scale; repeatable, up to 6")
      ->take_all()
      ->allow_extra_args(false)
      ->group(what);
  command
      ->add_flag("--shade", arguments->frame.shade,
                 "Light the scalar's level surfaces, from where the viewer is, so that shapes stand out")
      ->group(what);
  command
      ->add_option("--light", arguments->frame.light,
                   "Strengths ambient,diffuse,specular of the light, each 0 to 1 (default: 0.3,0.7,0.25); "
                   "implies --shade")
      ->group(what);
  command
      ->add_option(
          "--light-direction", arguments->frame.light_direction,
          "Direction x,y,z towards the light, after --scale (default: the viewer; with --shadow 1,-1,2); "
          "implies --shade")
      ->group(what);
  command
      ->add_option(
          "--shadow", arguments->frame.shadow,
          "How dark the shadow of the volume is, from 0 (none, the default) to 1 (black where no light "
          "arrives); implies --shade")
      ->group(what);
  command
      ->add_option(
          "--ambient-occlusion", arguments->frame.ambient_occlusion,
          "How dark places are that the volume surrounds, from 0 (none, the default) to 1; implies --shade")
      ->group(what);
  command
      ->add_option(
          "--gradient-opacity", arguments->frame.gradient_opacity,
          "Factors of the opacity by how steep the scalar is, SHARE:FACTOR,... from 0 to 1, over the "
          "share of the volume that is less steep. 0:0,0.2:1 hides the flattest fifth little by little, "
          "0.8:0,0.9:1 all but the steepest fifth")
      ->group(what);
  command
      ->add_option(
          "--background", arguments->frame.background,
          "Background colour: dark (#15171c), white (for papers), black, transparent or #rrggbb. Colour maps "
          "that are chosen suit it")
      ->capture_default_str()
      ->group(what);

  addAnnotationOptions(*command, arguments->annotations, what);

  command
      ->add_option("--channels", arguments->channels,
                   "Further channels of an .exr picture: depth, normal and scalar, separated by commas, or "
                   "none (default: depth). Each is taken at the point of the ray that half of the pixel's "
                   "opacity lies in front of. Drawing takes about three times as long")
      ->group(what);
  addSurfaceOptions(*command, arguments->surfaces, surfaces);
  const std::string when = "Time steps";
  addStepOptions(*command, arguments->steps, when);
  addStepsOption(*command, arguments->steps.steps, "; a frame of each is drawn")->group(when);
  addInterpolateOption(*command, arguments->steps, when);

  const std::string where = "Camera";
  CameraArguments* camera = &arguments->camera;
  addCameraOptions(*command, *camera, where,
                   "; it fits the data, or what --clip-box leaves of them (default: chosen from the data; "
                   "iso for a camera that moves)");
  addPlaceOptions(*command, *camera, where);
  addLookAtOptions(*command, *camera, where);
  command
      ->add_option("--orbit", camera->orbit,
                   "Orbit the focal point by this angle about the up direction, in degrees")
      ->group(where);
  command
      ->add_option("--path", camera->path,
                   "Camera path or film: a JSON file of key frames, described in tools/REFERENCE.md")
      ->group(where);
  command
      ->add_option("--frames", camera->frames,
                   "Number of frames of --orbit or --path (default 90), or of --steps with --interpolate")
      ->check(CLI::Range(1u, kMaxFrames))
      ->group(where);
  command->add_option("--frame-rate", arguments->frame_rate, "Frames per second of a movie (default 25)")
      ->group(where);
  command
      ->add_option("--part", arguments->part,
                   "Draw only part i of n of the frames, given as i/n: frames i-1, i-1+n, i-1+2n, ..., named "
                   "as in the whole sequence")
      ->group(where);

  const std::string how = "Resources";
  addBackendOption(*command, arguments->backend)->group(how);
  addMemoryOption(*command, arguments->frame.memory)->group(how);
  command
      ->add_option(
          "--card-memory", arguments->frame.card_memory,
          "Memory of a graphics card for bricks that stay there (default: three quarters of what is free)")
      ->group(how);
  addThreadsOption(*command, arguments->frame.threads)->group(how);
  command
      ->add_option(
          "--first-image", arguments->first_image,
          "Also write the first, coarse picture to this file as soon as it is drawn: .png, .exr or .pfm")
      ->group(how);
  command
      ->add_flag("--keep-going", arguments->frame.keep_going,
                 "Draw damaged bricks from a coarser level and print a warning, instead of failing")
      ->group(how);
  addStatsOption(*command, arguments->statistics)->group(how);
  addTraceOption(*command, arguments->trace)->group(how);
  command->callback([arguments, command] {
    requireSameOptions(*command);
    std::vector<std::filesystem::path> others = inputsOf(*arguments);
    others.insert(others.end(), {arguments->output, arguments->statistics});
    runTraced(arguments->trace, others, [&] { render(*arguments); });
  });
}

}  // namespace curvisplat
