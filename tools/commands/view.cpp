// `curvisplat view`: opens a window that shows a cache, or a grid, which is converted in the background
// meanwhile.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/formats/open/grid_endings.h"
#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "stream/cache/cache_reader.h"
#include "tools/commands/commands.h"
#include "tools/commands/grid_faces.h"
#include "tools/options/annotation_arguments.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/example_grid.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/further_scalars.h"
#include "tools/options/globe_arguments.h"
#include "tools/options/grid_surfaces.h"
#include "tools/options/kept_caches.h"
#include "tools/options/kept_conversion.h"
#include "tools/options/option_parsers.h"
#include "tools/options/picture_choice.h"
#include "tools/options/point_values.h"
#include "tools/options/scene_arguments.h"
#include "tools/options/shared_options.h"
#include "tools/output/command_run.h"
#include "tools/output/frame_output.h"
#include "tools/output/start_checks.h"
#include "tools/viewer/prepared_view.h"
#include "tools/viewer/viewer.h"

namespace curvisplat {
namespace {

struct ViewArguments {
  std::vector<std::filesystem::path>
      files;  // a cache, or a grid with its solutions; none: chosen in the window
  std::string size = "1200x800", backend = "auto", value_precision = "auto";
  std::optional<std::filesystem::path> state;
  std::optional<std::string> scalar, memory, frame_time;
  SurfaceArguments surfaces;
  StepArguments steps;
  CameraArguments camera;
};

/// The options of lines, points and the Earth, as `render` takes them.
std::vector<std::pair<std::string, std::string>> optionsOfGiven(const SurfaceArguments& arguments) {
  std::vector<std::pair<std::string, std::string>> options;
  const auto addAll = [&](const char* name, const std::vector<std::string>& values) {
    for (const std::string& value : values) options.emplace_back(name, value);
  };
  const auto add = [&](const char* name, const std::optional<std::string>& value) {
    if (value) options.emplace_back(name, *value);
  };
  const CurveArguments& curves = arguments.curves;
  addAll("--lines", curves.lines);
  addAll("--points", curves.points);
  addAll("--lines-colour", curves.colours);
  if (!curves.lines.empty()) add("--line-width", curves.line_width);
  if (!curves.points.empty()) add("--point-size", curves.point_size);
  if (curves.given()) add("--lines-opacity", curves.opacity);
  if (!curves.by.empty()) add("--lines-by", curves.by);
  add("--lines-time", curves.time);
  add("--map", arguments.map.map);
  add("--map-height", arguments.map.height);
  add("--globe", arguments.globe);
  return options;
}

/// The surfaces and slices of the command line.
void takeScene(const ViewArguments& arguments, const CacheReader& cache, ViewerOptions& options) {
  // The scalar changes in the window: faces that are coloured by another one have colours of their own.
  options.scene = sceneOf(arguments.surfaces, cache, {});
  for (const std::string& surface : arguments.surfaces.surfaces)
    if (isSurfaceFile(surface))
      options.surface_files.emplace_back(surface);
    else
      options.face_names.emplace_back(surface);
  options.faces_by = arguments.surfaces.surface_by;
  if (!arguments.surfaces.curves.given() && !arguments.surfaces.map.map) return;
  GivenSheets given{options.scene->curves, std::nullopt, kBlanks, optionsOfGiven(arguments.surfaces)};
  if (arguments.surfaces.map.map) {
    given.earth = options.scene->surfaces.back();
    given.above =
        boxOnEarth(arguments.surfaces.map, cache, globeOf(arguments.surfaces.globe, cache.manifest()));
  }
  options.given = std::make_shared<GivenSheets>(std::move(given));
}

/// The camera that `render` draws the state with by the same options, but for the axes grid of a globe.
Camera cameraOf(const ViewArguments& arguments, const CacheReader& cache, const ViewState& state,
                ImageSize size) {
  const std::optional<Globe> globe = globeOf(arguments.surfaces.globe, cache.manifest());
  const ShownBox box = shownBox(cache.manifest(), state.scale, state.clip_box, state.annotations);
  const bool whole = state.annotations.lieBehind() || state.clip_box;
  const EditedFunction& function = state.opacity_by ? state.opacity_by->function : state.function;
  // One for all steps, as that of the window.
  PictureChoice choice(cache, cache.variableNamed(state.opacityScalar()), state.scale, ChosenFor::kSeries);
  const CameraArguments camera =
      choice.camera(placedAbove(arguments.camera, globe, state.scale), function.function(),
                    {box, size, whole, state.given ? state.given->above : std::nullopt});
  return chooseCameraMotion(camera, box, size).camera(0);
}

FaceServices faceServices() {
  return {faceNamesOf, facesAtStep};
}

/// Refuses options that need a cache from the beginning.
void checkGridOptions(const ViewArguments& arguments) {
  if (arguments.surfaces.given() || arguments.steps.step || arguments.steps.time)
    throw UsageError(
        "--surface, --slice, --iso, --lines, --points, --map, --step and --time need a cache: convert {} "
        "first",
        arguments.files.front().string());
}

/// Refuses a state or a scalar that cannot be shown, before a window opens. Throws Error, and UsageError for the scalar.
void checkStart(const ViewerOptions& options, const CacheReader* cache) {
  if (options.state) {
    const std::string text = readTextFile(*options.state);
    if (cache)
      viewStateFromJson(text, *options.state, cache->manifest());
    else
      scalarOfViewState(text, *options.state);
  }
  if (options.scalar && cache) cache->variableNamed(*options.scalar);
}

std::string whatOf(const KeptPreview& preview) {
  constexpr std::array<const char*, 4> kEndings{"th", "st", "nd", "rd"};
  const uint64_t last = preview.stride % 10, tens = preview.stride / 10 % 10;
  const std::string part = preview.lattice > 0 ? fmt::format("{0} x {0} x {0} points", preview.lattice)
                           : preview.stride > 1
                               ? fmt::format("every {}{} index plane", preview.stride,
                                             kEndings[tens != 1 && last < kEndings.size() ? last : 0])
                               : "";
  if (!preview.first_step) return part;
  return part.empty() ? "the first time step" : part + " of the first time step";
}

/// `render`'s output of frames, for the window.
class MovieFile final : public MovieOutput {
 public:
  MovieFile(const std::filesystem::path& file, ImageSize size, double frames_per_s) {
    checkOutputName(file, true, size);
    output_ = makeFrameOutput(file, true, size, frames_per_s);
  }
  void write(uint64_t frame, const Image& image) override { output_->write(frame, image); }
  void finish() override { output_->finish(); }

 private:
  std::unique_ptr<FrameOutput> output_;
};

ConversionServices conversionServices(ValuePrecision precision) {
  using Paths = ConversionServices::Paths;
  ConversionServices services;
  services.to_cache = [precision](const Paths& files, Progress& progress, const OpeningEvents& events) {
    if (!isGrid(files)) return files.front();
    if (files == exampleFiles()) writeExample(progress);
    KeptCacheEvents kept;
    kept.say = events.say;
    kept.preview = [&](const KeptPreview& preview) {
      events.preview({preview.cache, preview.whole, whatOf(preview), preview.folder});
    };
    try {
      return keptCacheOf(files, progress, kept, {}, precision);
    } catch (const LoneGrid&) {
      if (files.size() > 1) throw;
      throw Error(
          "{}: has no values, only coordinates: choose the solution, too (Ctrl + click takes several files)",
          files.front().filename().string());
    }
  };
  services.sources_of = sourcesOf;
  services.further_scalars = [](const std::filesystem::path& cache, const Paths& files) {
    std::vector<SourceScalar> scalars;
    for (FurtherScalar& one : furtherScalarsOf(cache, files))
      scalars.push_back({std::move(one.name), std::move(one.unit), one.derived});
    return scalars;
  };
  services.add_scalar = addFurtherScalar;
  services.is_grid_folder = isGridFolder;
  for (const GridEndings& of_format : kGridEndings)
    for (const std::string_view ending : wordsOf(of_format.endings))
      services.grid_endings.emplace_back(ending);
  services.example = exampleFiles;
  return services;
}

void view(const ViewArguments& arguments) {
  ViewerOptions options;
  options.size = parseImageSize("--size", arguments.size);
  options.backend = parseBackend(arguments.backend);
  options.state = arguments.state;
  options.scalar = arguments.scalar;
  if (arguments.memory) options.memory_bytes = parseMemory("--memory", *arguments.memory);
  if (arguments.frame_time) options.target_s = parsePositive("--frame-time", *arguments.frame_time) / 1000;
  checkSurfaceArguments(arguments.surfaces);
  checkCameraArguments(arguments.camera);
  // Wrong numbers are refused before a grid is converted; what --look-at says needs the globe.
  if (!arguments.camera.look_at)
    chooseCameraMotion(arguments.camera, {glm::dvec3(0.0), glm::dvec3(1.0)}, options.size);
  if (arguments.camera.place() || arguments.camera.turn() || arguments.camera.zoom)
    options.camera = [&](const CacheReader& of, const ViewState& state, ImageSize data) {
      return cameraOf(arguments, of, state, data);
    };
  for (const std::string& surface : arguments.surfaces.surfaces)
    if (isVtp(surface))
      throw UsageError("--surface {}: the window shows STL, PLY and OBJ files; render draws .vtp files",
                       surface);
  std::optional<CacheReader> cache;
  const ValuePrecision precision = parseValuePrecision("--value-precision", arguments.value_precision);
  options.conversion = conversionServices(precision);
  options.faces = faceServices();
  options.encodes_movies = hasMovieEncoder();
  options.open_movie = [](const std::filesystem::path& file, ImageSize size, double frames_per_s) {
    return std::make_unique<MovieFile>(file, size, frames_per_s);
  };
  if (!arguments.files.empty() && !isGrid(arguments.files)) {
    cache = openAtStep(arguments.files.front(), arguments.steps, wantedScalar(options));
    takeScene(arguments, *cache, options);
  } else if (!arguments.files.empty()) {
    options.files = arguments.files;
    checkGridOptions(arguments);
  }
  requireThreads();  // without them, Mesa waits for ever
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  try {
    checkStart(options, cache ? &*cache : nullptr);
    runViewer(std::move(cache), options, progress);
  } catch (const UsageError& error) {
    throw Error("{}", error.what());  // the cache decides, not the usage
  }
}

}  // namespace

void addView(CLI::App& app) {
  auto arguments = std::make_shared<ViewArguments>();
  CLI::App* command = app.add_subcommand("view", "Show a cache or a grid in a window");
  command->add_option("FILE", arguments->files,
                      "Splat cache, a directory NAME.splats; or a grid and its solutions, which are "
                      "converted into the user's cache folder. If none is given, the window asks for one");
  addValuePrecisionOption(*command, arguments->value_precision);
  command->add_option("--size", arguments->size, "Size of the window, WIDTHxHEIGHT in pixels")
      ->capture_default_str();
  command->add_option("--scalar", arguments->scalar, "Name of the scalar to draw (default: as last time)");
  command->add_option(
      "--state", arguments->state,
      "Restore camera, transfer function and settings from this JSON file (default: as last time)");
  addBackendOption(*command, arguments->backend);
  addMemoryOption(*command, arguments->memory, " (default: as last time, initially 512M)");
  addFrameTimeOption(*command, arguments->frame_time, " (default: 33)");
  addSurfaceOptions(*command, arguments->surfaces, "Surfaces and slices");
  addStepOptions(*command, arguments->steps, "Time steps");
  const std::string where = "Camera";
  addCameraOptions(*command, arguments->camera, where,
                   "; it fits the data (default of all: as last time, initially chosen from the data)");
  addPlaceOptions(*command, arguments->camera, where);
  addLookAtOptions(*command, arguments->camera, where);
  command->callback([arguments] { view(*arguments); });
}

}  // namespace curvisplat
