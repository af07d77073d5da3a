// `curvisplat bench`: measures how fast this machine reads, prepares and draws a cache, or converts a grid.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <glm/geometric.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>

#include "preprocess/formats/common/temporary_folder.h"
#include "render/annotate/plot.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"
#include "stream/cache/cache_reader.h"
#include "tools/commands/commands.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/option_parsers.h"
#include "tools/options/picture_choice.h"
#include "tools/options/shared_options.h"
#include "tools/output/command_run.h"
#include "tools/output/results.h"
#include "tools/output/start_checks.h"
#include "tools/throughput/conversion_throughput.h"
#include "tools/throughput/disk_throughput.h"
#include "tools/throughput/frame_throughput.h"
#include "tools/throughput/machine.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/rank_simulation.h"
#include "tools/throughput/stage_throughput.h"
#include "tools/throughput/throughput_report.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using ResultsJson = nlohmann::ordered_json;

constexpr int kSchema = 1;  // of the JSON; bench/compare.py reads it
constexpr uint64_t kMinNodes = 1000;

/// Command-line arguments as given; checked and parsed later.
struct BenchArguments {
  fs::path cache, json, plots, temporary_folder;
  ScalarArguments scalar;
  CameraArguments camera;
  std::string size = "600x600", lod_pixels = "1,2,4", backend = "auto";
  std::optional<std::string> nodes, memory, ranks;
  unsigned threads = 0;
  bool quick = false, converts = false;
};

/// How long to measure: the defaults, or kQuick.
struct BenchEffort {
  DiskEffort disk;
  StageEffort stages;
  FrameEffort frames;
};
constexpr BenchEffort kQuick{
    {.sample_s = 0.02, .samples = 2, .max_bytes = 32 << 20},
    {.sample_s = 0.02, .samples = 2, .max_splats = 150'000, .max_read_bytes = 16 << 20},
    {.configuration_s = 0.3, .total_s = 6, .max_frames = 4}};

void checkBenchArguments(const BenchArguments& arguments) {
  if (arguments.converts && !arguments.cache.empty())
    throw UsageError("{}: --convert measures a generated grid; give either a cache or --convert",
                     arguments.cache.string());
  if (!arguments.converts && arguments.cache.empty())
    throw UsageError("a CACHE is required, or --convert to measure a conversion");
  if (!arguments.converts && (arguments.nodes || !arguments.temporary_folder.empty()))
    throw UsageError("{} needs --convert", arguments.nodes ? "--nodes" : "--tmp");
  if (!arguments.json.empty()) checkJsonOutput("--json", arguments.json, {arguments.cache});
  if (arguments.plots.empty()) return;
  requirePlots();
  std::error_code ignored;
  if (fs::exists(arguments.plots, ignored) && !fs::is_directory(arguments.plots, ignored))
    throw Error("--plot {}: exists and is not a directory", arguments.plots.string());
  checkOutputFolder("--plot", arguments.plots);
}

unsigned threadsOf(const BenchArguments& arguments) {
  return threadsOrCores(arguments.threads);
}

void printMachine(const Machine& machine) {
  fmt::print("{} cores ({}), {:.1f} GiB of memory, {}, {}\n", machine.cores,
             machine.processor.empty() ? "processor unknown" : machine.processor,
             static_cast<double>(machine.memory_bytes) / (1 << 30), machine.system, machine.file_system);
  if (const std::string note = machine.busyNote(); !note.empty()) printLine("{}", note);
}

void printSection(const std::string& head, const std::string& text) {
  if (!text.empty()) fmt::print("\n{}\n\n{}", head, text);
}

/// The common beginning of the JSON report, and the measurements.
ResultsJson reportOf(const BenchArguments& arguments, const Machine& machine,
                     const Measurements& measurements) {
  const nlohmann::json run = runStatistics();
  ResultsJson json{{"schema", kSchema}};
  for (const char* key : {"program", "version", "command", "peak_memory_bytes"}) json[key] = run[key];
  json["quick"] = arguments.quick;
  json["machine"] = machine.toJson();
  json["measurements"] = measurements.toJson();
  json["left_out"] = measurements.leftOutAsJson();
  return json;
}

void writeResults(const BenchArguments& arguments, const ResultsJson& json, const Plots& plots) {
  // The recorded arguments may not be valid UTF-8, which JSON requires.
  constexpr auto kReplace = ResultsJson::error_handler_t::replace;
  if (!arguments.json.empty()) writeFileDurably(arguments.json, json.dump(2, ' ', false, kReplace) + "\n");
  if (arguments.plots.empty()) return;
  std::error_code error;
  fs::create_directory(arguments.plots, error);
  if (error)
    throw Error("--plot {}: cannot create the directory: {}", arguments.plots.string(), error.message());
  for (const auto& [name, bytes] : plots) writeFileDurably(arguments.plots / name, bytes);
}

// -------------------------------------------------------------------------------------------- drawing a
// cache

std::vector<double> parseErrors(const std::string& text) {
  std::vector<double> errors;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    const double error = parseNumber("--lod-pixels", word);
    if (error < 0) throw UsageError("--lod-pixels {}: expected 0 (the finest level) or more", word);
    errors.push_back(error);
    begin = end + 1;
  }
  std::sort(errors.begin(), errors.end());
  errors.erase(std::unique(errors.begin(), errors.end()), errors.end());
  return errors;
}

/// Name of the drawing measurement that applies to this back end, and whether a graphics card draws.
std::pair<std::string, bool> drawingOf(Backend backend, bool card_draws, unsigned threads) {
  if (backend == Backend::kOsmesa) return {"stages/draw/osmesa", false};
  if (backend == Backend::kEglQuads) return {"stages/draw/egl-quads", card_draws};
  if (backend == Backend::kEgl || (backend == Backend::kAutomatic && card_draws))
    return {"stages/draw/egl", card_draws};
  return {stageName("draw/cpu", threads), false};
}

std::vector<uint32_t> parseRanks(const std::string& text) {
  std::vector<uint32_t> counts;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const uint64_t count = parseCount("--ranks", text.substr(begin, end - begin));
    if (count < 1 || count > kMaxSimulatedRanks)
      throw UsageError("--ranks {}: expected numbers from 1 to {}", text, kMaxSimulatedRanks);
    counts.push_back(static_cast<uint32_t>(count));
    begin = end + 1;
  }
  return counts;
}

/// Reports the cost of a picture for several processes, found from the index and the view. Nothing is drawn.
void benchRanks(const BenchArguments& arguments) {
  FrameOptions options;
  options.size = parseImageSize("--size", arguments.size);
  options.lod_pixels = parseErrors(arguments.lod_pixels).front();
  checkCameraArguments(arguments.camera);
  const std::vector<uint32_t> counts = parseRanks(*arguments.ranks);
  const CacheReader cache(arguments.cache);
  const Manifest& manifest = cache.manifest();
  const size_t variable = chooseVariable(cache, arguments.scalar);
  const TransferFunction function = PictureChoice(cache, variable, glm::dvec3(1)).function(arguments.scalar);
  const Camera camera =
      chooseCameraMotion(arguments.camera, {manifest.lower, manifest.upper}, options.size).camera(0);
  const RankSimulation simulated = simulateRanks({cache, variable, function, options}, camera, counts);
  printLine("{}: {} samples in {}; scalar {}", arguments.cache.string(), manifest.nodes,
            countText(manifest.bricks, "brick"), manifest.variables[variable].name);
  printSection(
      fmt::format("Simulated: one picture of {}x{} pixels at {:g} px, {} splats in {} of bricks",
                  options.size.width, options.size.height, options.lod_pixels,
                  shortCount(static_cast<double>(simulated.splats)), countText(simulated.parts, "part")),
      rankTable(simulated));
  ResultsJson json = reportOf(arguments, Machine::here(cache.path()), {});
  json["ranks"] = toJson(simulated);
  writeResults(arguments, json, rankPlots(simulated));
}

void benchCache(const BenchArguments& arguments) {
  FrameOptions options;
  options.size = parseImageSize("--size", arguments.size);
  const std::vector<double> errors = parseErrors(arguments.lod_pixels);
  options.lod_pixels = errors.front();
  if (arguments.memory) options.memory_bytes = parseMemory("--memory", *arguments.memory);
  options.threads = threadsOf(arguments);
  const Backend backend = parseBackend(arguments.backend);
  checkCameraArguments(arguments.camera);

  const CacheReader cache(arguments.cache);
  const Manifest& manifest = cache.manifest();
  const size_t variable = chooseVariable(cache, arguments.scalar);
  const VariableInfo& info = manifest.variables[variable];
  const TransferFunction function = PictureChoice(cache, variable, glm::dvec3(1)).function(arguments.scalar);
  const auto orbit = [&](unsigned frames) {
    CameraArguments camera = arguments.camera;
    camera.orbit = "360";
    camera.frames = frames;
    const CameraMotion motion = chooseCameraMotion(camera, {manifest.lower, manifest.upper}, options.size);
    std::vector<Camera> cameras;
    for (uint64_t frame = 0; frame < motion.frames; ++frame) cameras.push_back(motion.camera(frame));
    return cameras;
  };
  const ThroughputScene scene{cache, variable, function, options, backend, orbit};
  const std::string backend_name = FrameRenderer(cache, variable, function, backend).backendName();
  const Machine machine = Machine::here(cache.path());
  const BenchEffort effort = arguments.quick ? kQuick : BenchEffort{};

  printLine("{}: {} samples as {} splats in {}; scalar {}", arguments.cache.string(), manifest.nodes,
            manifest.splats, countText(manifest.bricks, "brick"), info.name);
  printMachine(machine);
  std::fflush(stdout);
  Measurements measurements;
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  measureDisk(cache, variable, effort.disk, measurements, progress);
  const StageReport stages = measureStages(scene, options.threads, effort.stages, measurements, progress);
  const auto configurations =
      frameConfigurations(errors, options.threads, options.memory_bytes, availableMemory());
  const auto frames = measureFrames(scene, configurations, effort.frames, measurements, progress);
  progress.end();

  const auto [draw_stage, draws_apart] = drawingOf(backend, stages.card_draws, options.threads);
  const auto verdict = verdictOf(measurements, frames, options.threads, draws_apart, draw_stage);
  printSection(fmt::format("Disk: {} and {}", cache.geometryPath().filename().string(),
                           cache.valuesPath(variable).filename().string()),
               diskTable(measurements));
  printSection(
      fmt::format("Stages in isolation: {} of the {} splats of a frame at {:g} px, read by {}",
                  shortCount(static_cast<double>(stages.sampled_splats)),
                  shortCount(static_cast<double>(stages.frame_splats)), errors.front(), stages.read_by),
      stageTable(measurements, options.threads));
  printSection(fmt::format("Frames on an orbit: {}x{} pixels, {}", options.size.width, options.size.height,
                           backend_name),
               frameTable(frames, measurements));
  std::string lines;
  if (verdict)
    for (const std::string& line : verdict->lines) lines += "- " + line + "\n";
  printSection("What it means", lines);
  printSection("Not measured", leftOutTable(measurements));

  ResultsJson json = reportOf(arguments, machine, measurements);
  json["cache"] = {{"path", arguments.cache.string()},
                   {"scalar", info.name},
                   {"nodes", manifest.nodes},
                   {"bricks", manifest.bricks},
                   {"splats", manifest.splats}};
  json["image"] = {{"width", options.size.width}, {"height", options.size.height}};
  json["backend"] = backend_name;
  json["threads"] = options.threads;
  json["memory_bytes"] = options.memory_bytes;
  json["stages"] = {{"read_by", stages.read_by},
                    {"sampled_splats", stages.sampled_splats},
                    {"frame_splats", stages.frame_splats}};
  json["frames"] = toJson(frames);
  if (verdict)
    json["verdict"] = {{"stage", verdict->stage}, {"share", verdict->share}, {"lines", verdict->lines}};
  writeResults(arguments, json, throughputPlots(measurements, frames, options.threads));
}

// --------------------------------------------------------------------------------------- converting a grid

void benchConversion(const BenchArguments& arguments) {
  ConversionEffort effort;
  if (arguments.quick) {
    effort.nodes = 200'000;
    effort.max_runs = 1;
  }
  if (arguments.nodes) effort.nodes = parseCount("--nodes", *arguments.nodes);
  if (effort.nodes < kMinNodes)
    throw UsageError("--nodes {}: expected {} or more", *arguments.nodes, kMinNodes);
  if (arguments.memory) effort.memory_bytes = parseMemory("--memory", *arguments.memory);
  effort.threads = arguments.threads;
  effort.temporary_folder =
      arguments.temporary_folder.empty() ? systemTemporaryFolder() : arguments.temporary_folder;
  std::error_code ignored;
  if (!fs::is_directory(effort.temporary_folder, ignored))
    throw Error("--tmp {}: no such directory", effort.temporary_folder.string());

  const Machine machine = Machine::here(effort.temporary_folder);
  Measurements measurements;
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const ConversionReport report = measureConversion(effort, measurements, progress);
  progress.end();

  const SceneGridSize& size = report.size;
  printMachine(machine);
  printSection(
      fmt::format("Conversion of {}x{}x{} nodes ({}), --threads {}, --memory {}M, grid files {}", size.ni,
                  size.nj, size.nk, report.nodes(), report.last.threads, report.last.memory_bytes >> 20,
                  report.cold ? "not in the page cache" : "in the page cache"),
      conversionTable(report));
  printSection("Total", conversionSummary(report, measurements));
  printSection("Not measured", leftOutTable(measurements));
  ResultsJson json = reportOf(arguments, machine, measurements);
  json["conversion"] = toJson(report);
  writeResults(arguments, json, conversionPlots(report));
}

}  // namespace

void addBench(CLI::App& app) {
  auto arguments = std::make_shared<BenchArguments>();
  CLI::App* command =
      app.add_subcommand("bench", "Measure how fast this machine draws a cache or converts a grid");
  command->add_option("CACHE", arguments->cache, "Splat cache, a directory NAME.splats");
  command->add_option("--json", arguments->json, "Write all measurements to this JSON file");
  command->add_option("--plot", arguments->plots, "Write plots (PNG) to this directory");
  command->add_flag("--quick", arguments->quick,
                    "Measure for about ten seconds only: rough figures, and a check that everything works");
  addMemoryOption(*command, arguments->memory, " (default: 512M; with --convert as for convert)");
  addThreadsOption(*command, arguments->threads);

  const std::string what = "Drawing";
  addScalarOption(*command, arguments->scalar);
  addFunctionOptions(*command, arguments->scalar, what);
  addSizeOption(*command, arguments->size)->group(what);
  addLodPixelsOption(*command, arguments->lod_pixels, ". Of several, E,E,..., each is measured")->group(what);
  addCameraOptions(*command, arguments->camera, what, " (default: iso, where an orbit begins)");
  addBackendOption(*command, arguments->backend)->group(what);

  const std::string how = "Conversion";
  CLI::Option* const convert =
      command
          ->add_flag("--convert", arguments->converts, "Convert a generated grid instead of drawing a cache")
          ->group(how);
  for (const char* drawing :
       {"--scalar", "--tf", "--range", "--opacity", "--asinh", "--opacity-unit", "--size", "--lod-pixels",
        "--view", "--view-angle", "--azimuth", "--elevation", "--roll", "--zoom", "--backend"})
    convert->excludes(command->get_option(drawing));
  command
      ->add_option(
          "--nodes", arguments->nodes,
          "Approximate number of nodes of the grid, such as 500K (default 8M); each takes 96 bytes of disk")
      ->group(how);
  CLI::Option* const ranks =
      command
          ->add_option(
              "--ranks", arguments->ranks,
              "Simulate a picture by N,N,... processes, such as 1,2,4,8, from the cache's index: work, "
              "bytes and efficiency; nothing is drawn")
          ->group(what);
  convert->excludes(ranks);
  command->add_option("--tmp", arguments->temporary_folder, "Temporary directory (default: the system's)")
      ->group(how);
  command->callback([arguments] {
    checkBenchArguments(*arguments);
    if (arguments->ranks) return benchRanks(*arguments);
    arguments->converts ? benchConversion(*arguments) : benchCache(*arguments);
  });
}

}  // namespace curvisplat
