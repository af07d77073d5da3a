// `curvisplat bench`: how fast this machine reads, prepares and draws a cache, or converts a grid.
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
#include <thread>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "tools/commands/commands.h"
#include "tools/options/camera_motion.h"
#include "tools/options/option_parsers.h"
#include "tools/options/scalar_arguments.h"
#include "tools/output/output_paths.h"
#include "tools/output/progress_bar.h"
#include "tools/output/run_statistics.h"
#include "tools/output/stop_signals.h"
#include "tools/throughput/conversion_throughput.h"
#include "tools/throughput/disk_throughput.h"
#include "tools/throughput/frame_throughput.h"
#include "tools/throughput/machine.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/plot.h"
#include "tools/throughput/stage_throughput.h"
#include "tools/throughput/text_table.h"
#include "tools/throughput/throughput_report.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kSchema = 1;  // of the JSON; bench/compare.py reads it
constexpr uint64_t kMinNodes = 1000;

/// The command line's words, as given.
struct BenchWords {
  fs::path cache, json, plots, temporary_folder;
  ScalarArguments scalar;
  CameraWords camera;
  std::string size = "600x600", lod_pixels = "1,2,4", backend = "auto";
  std::optional<std::string> nodes, memory;
  unsigned threads = 0;
  bool quick = false, converts = false;
};

/// How much is done, in the whole form and in the quick one.
struct Effort {
  DiskEffort disk;
  StageEffort stages;
  FrameEffort frames;
};
constexpr Effort kQuick{{.sample_s = 0.02, .samples = 2, .most_bytes = 32 << 20},
                        {.sample_s = 0.02, .samples = 2, .most_splats = 150'000, .most_read_bytes = 16 << 20},
                        {.configuration_s = 0.3, .total_s = 6, .most_frames = 4}};

void checkWords(const BenchWords& words) {
  if (words.converts && !words.cache.empty())
    throw UsageError("{}: --convert measures on a grid of its own; give a cache or --convert",
                     words.cache.string());
  if (!words.converts && words.cache.empty())
    throw UsageError("a CACHE is required, or --convert to measure conversion");
  if (!words.converts && (words.nodes || !words.temporary_folder.empty()))
    throw UsageError("{} is for --convert", words.nodes ? "--nodes" : "--tmp");
  if (!words.json.empty()) checkOutputFile("--json", words.json, {words.cache});
  if (words.plots.empty()) return;
  requirePlots();
  std::error_code ignored;
  if (fs::exists(words.plots, ignored) && !fs::is_directory(words.plots, ignored))
    throw Error("--plot {}: is not a folder", words.plots.string());
  checkOutputFolder("--plot", words.plots);
}

unsigned threadsOf(const BenchWords& words) {
  return words.threads ? words.threads : std::max(1u, std::thread::hardware_concurrency());
}

void printMachine(const Machine& machine) {
  fmt::print("{} cores ({}), {:.1f} GiB of memory, {}, {}\n", machine.cores,
             machine.processor.empty() ? "processor unknown" : machine.processor,
             static_cast<double>(machine.memory_bytes) / (1 << 30), machine.system, machine.file_system);
}

void printSection(const std::string& head, const std::string& text) {
  if (!text.empty()) fmt::print("\n{}\n\n{}", head, text);
}

/// What every file begins with, and the measurements.
Json reportOf(const BenchWords& words, const Machine& machine, const Measurements& measurements) {
  const nlohmann::json run = runStatistics();
  Json json{{"schema", kSchema}};
  for (const char* key : {"program", "version", "command", "peak_memory_bytes"}) json[key] = run[key];
  json["quick"] = words.quick;
  json["machine"] = machine.toJson();
  json["measurements"] = measurements.toJson();
  json["left_out"] = measurements.leftOutAsJson();
  return json;
}

void writeResults(const BenchWords& words, const Json& json, const Plots& plots) {
  // Arguments are bytes, which need not be the UTF-8 that JSON is.
  constexpr auto kReplace = Json::error_handler_t::replace;
  if (!words.json.empty()) writeFileDurably(words.json, json.dump(2, ' ', false, kReplace) + "\n");
  if (words.plots.empty()) return;
  std::error_code error;
  fs::create_directory(words.plots, error);
  if (error) throw Error("--plot {}: the folder cannot be made: {}", words.plots.string(), error.message());
  for (const auto& [name, bytes] : plots) writeFileDurably(words.plots / name, bytes);
}

// -------------------------------------------------------------------------------------------- a cache

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

/// The measurement of drawing that frames of this back end depend on, and whether a card draws them.
std::pair<std::string, bool> drawingOf(Backend backend, bool card_draws, unsigned threads) {
  if (backend == Backend::kOsmesa) return {"stages/draw/osmesa", false};
  if (backend == Backend::kEgl || (backend == Backend::kAutomatic && card_draws))
    return {"stages/draw/egl", card_draws};
  return {stageName("draw/cpu", threads), false};
}

void benchCache(const BenchWords& words) {
  FrameOptions options;
  options.size = parseImageSize("--size", words.size);
  const std::vector<double> errors = parseErrors(words.lod_pixels);
  options.lod_pixels = errors.front();
  if (words.memory) options.memory_bytes = parseMemory("--memory", *words.memory);
  options.threads = threadsOf(words);
  const Backend backend = parseBackend(words.backend);
  checkCameraWords(words.camera);

  const CacheReader cache(words.cache);
  const Manifest& manifest = cache.manifest();
  const size_t variable = chooseVariable(cache, words.scalar);
  const VariableInfo& info = manifest.variables[variable];
  const TransferFunction function =
      chooseTransferFunction(words.scalar, info, glm::length(manifest.upper - manifest.lower));
  const auto orbit = [&](unsigned frames) {
    CameraWords camera = words.camera;
    camera.orbit = "360";
    camera.frames = frames;
    const CameraMotion motion = chooseCameraMotion(camera, manifest.lower, manifest.upper, options.size);
    std::vector<Camera> cameras;
    for (uint64_t frame = 0; frame < motion.frames; ++frame) cameras.push_back(motion.camera(frame));
    return cameras;
  };
  const ThroughputScene scene{cache, variable, function, options, backend, orbit};
  const std::string backend_name = FrameRenderer(cache, variable, function, backend).backendName();
  const Machine machine = Machine::here(cache.path());
  const Effort effort = words.quick ? kQuick : Effort{};

  fmt::print("{}: {} {} as {} splats in {} bricks; scalar {}\n", words.cache.string(), manifest.nodes,
             manifest.cells ? "cells" : "nodes", manifest.splats, manifest.bricks, info.name);
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
      fmt::format("Stages by themselves: {} of the {} splats of a frame at {:g} px, read by {}",
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
  printSection("Left out", leftOutTable(measurements));

  Json json = reportOf(words, machine, measurements);
  json["cache"] = {{"path", words.cache.string()},
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
  writeResults(words, json, throughputPlots(measurements, frames, options.threads));
}

// --------------------------------------------------------------------------------------- a conversion

void benchConversion(const BenchWords& words) {
  ConversionEffort effort;
  if (words.quick) {
    effort.nodes = 200'000;
    effort.most_runs = 1;
  }
  if (words.nodes) effort.nodes = parseCount("--nodes", *words.nodes);
  if (effort.nodes < kMinNodes) throw UsageError("--nodes {}: expected {} or more", *words.nodes, kMinNodes);
  if (words.memory) effort.memory_bytes = parseMemory("--memory", *words.memory);
  effort.threads = words.threads;
  effort.temporary_folder =
      words.temporary_folder.empty() ? fs::temp_directory_path() : words.temporary_folder;
  std::error_code ignored;
  if (!fs::is_directory(effort.temporary_folder, ignored))
    throw Error("--tmp {}: there is no such folder", effort.temporary_folder.string());

  const Machine machine = Machine::here(effort.temporary_folder);
  Measurements measurements;
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const ConversionReport report = measureConversion(effort, measurements, progress);
  progress.end();

  const SceneGridSize& size = report.size;
  printMachine(machine);
  printSection(
      fmt::format("Conversion of {}x{}x{} nodes ({}), --threads {}, --memory {}M, the grid's files {}",
                  size.ni, size.nj, size.nk, report.nodes(), report.last.threads,
                  report.last.memory_bytes >> 20, report.cold ? "not in memory" : "in memory"),
      conversionTable(report));
  printSection("In all", conversionSummary(report, measurements));
  printSection("Left out", leftOutTable(measurements));
  Json json = reportOf(words, machine, measurements);
  json["conversion"] = toJson(report);
  writeResults(words, json, conversionPlots(report));
}

}  // namespace

void addBench(CLI::App& app) {
  auto words = std::make_shared<BenchWords>();
  CLI::App* command =
      app.add_subcommand("bench", "Measure what this machine does with a cache, or how fast it converts");
  command->add_option("CACHE", words->cache, "The splat cache, a folder NAME.splats");
  command->add_option("--json", words->json, "Write all samples to FILE.json");
  command->add_option("--plot", words->plots, "Write plots (PNG) into this folder");
  command->add_flag("--quick", words->quick, "Some ten seconds: whether all works, and roughly how fast");
  command->add_option("--memory", words->memory,
                      "For frames: memory for the data in flight (512M otherwise); with --convert: the cap");
  command->add_option("--threads", words->threads, "The most that work; 0: one a core")
      ->capture_default_str();

  const std::string what = "What is drawn";
  addScalarOption(*command, words->scalar);
  addFunctionOptions(*command, words->scalar, what);
  command->add_option("--size", words->size, "WIDTHxHEIGHT in pixels")->capture_default_str()->group(what);
  command->add_option("--lod-pixels", words->lod_pixels, "E,E,...: errors, each drawn; 0: the finest level")
      ->capture_default_str()
      ->group(what);
  command->add_option("--view", words->camera.view, "Where the orbit begins: iso, +x, -x, +y, -y, +z or -z")
      ->group(what);
  command->add_option("--view-angle", words->camera.view_angle, "Perspective, with this angle, in degrees")
      ->group(what);
  command->add_option("--backend", words->backend, "auto, osmesa, egl or cpu: what draws whole frames")
      ->capture_default_str()
      ->group(what);

  const std::string how = "Conversion";
  CLI::Option* const convert =
      command
          ->add_flag("--convert", words->converts, "Convert a generated grid in the place of drawing a cache")
          ->group(how);
  for (const char* drawing : {"--scalar", "--tf", "--range", "--opacity-unit", "--size", "--lod-pixels",
                              "--view", "--view-angle", "--backend"})
    convert->excludes(command->get_option(drawing));
  command->add_option("--nodes", words->nodes, "Of the grid, about: 8M, 500K; 96 bytes each on the disk")
      ->group(how);
  command->add_option("--tmp", words->temporary_folder, "Folder for it all meanwhile; the system's otherwise")
      ->group(how);
  command->callback([words] {
    checkWords(*words);
    words->converts ? benchConversion(*words) : benchCache(*words);
  });
}

}  // namespace curvisplat
