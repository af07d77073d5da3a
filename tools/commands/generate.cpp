// `curvisplat generate`: writes an analytic scene as PLOT3D files of any size.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tools/commands/commands.h"
#include "tools/output/command_run.h"
#include "tools/output/results.h"
#include "tools/output/start_checks.h"

namespace curvisplat {
namespace {

struct GenerateOptions {
  std::string scene;
  std::string size;
  std::string prefix;
  std::optional<double> clustering;
  std::optional<uint64_t> steps;
  uint64_t first_step = 0;
  bool moving = false;
};

constexpr double kStepsPerUnitOfTime = 50;  // in which the wake's vortices move by a wave length

SceneGridSize parseSize(const std::string& text) {
  SceneGridSize size;
  const char* at = text.data();
  const char* const end = at + text.size();
  for (uint64_t* nodes : {&size.ni, &size.nj, &size.nk}) {
    const auto [after, error] = std::from_chars(at, end, *nodes);
    const bool last = nodes == &size.nk;
    if (error != std::errc() || *nodes < 2 || (last ? after != end : after == end || *after != 'x'))
      throw UsageError("--size {}: expected NIxNJxNK with at least 2 nodes each, such as 128x64x64", text);
    at = last ? after : after + 1;
  }
  return size;
}

std::string stepPrefix(const std::string& prefix, uint64_t step) {
  return fmt::format("{}_{:04}", prefix, step);
}

/// The longest ending of the names of the files, after the prefix.
std::string longestEnding(const GenerateOptions& options) {
  const std::string ending = ".xyz";
  return options.steps ? stepPrefix("", options.first_step + *options.steps - 1) + ending : ending;
}

/// The files of each time step: PREFIX_0000.fun, ... and, unless the grid moves, one PREFIX.xyz.
void generateSteps(const GenerateOptions& options) {
  const SceneGridSize size = parseSize(options.size);
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  uint64_t nodes = 0;
  double seconds = 0;
  for (uint64_t step = options.first_step; step < options.first_step + *options.steps; ++step) {
    const SceneTime time{static_cast<double>(step) / kStepsPerUnitOfTime, options.moving};
    const SceneGridSource source(makeScenesAt(options.scene, options.clustering, time), size);
    Plot3dOutputs outputs = plot3dOutputs(stepPrefix(options.prefix, step));
    if (!options.moving) outputs.grid = step == options.first_step ? options.prefix + ".xyz" : std::string();
    writePlot3d(source, outputs, progress);
    nodes += progress.phases().back().steps;
    seconds += progress.phases().back().seconds;
  }
  printLine("{}{}", options.prefix, options.moving ? "_%04d.xyz" : ".xyz");
  printLine("{}_%04d.fun", options.prefix);
  fmt::print("{} nodes of {} in {} steps, in {:.1f} s\n", nodes, options.scene, *options.steps, seconds);
}

void generate(const GenerateOptions& options) {
  makeScenes(options.scene, options.clustering);  // the scene's name first
  if (options.size.empty()) throw UsageError("--size NIxNJxNK is required, such as --size 128x64x64");
  checkOutputFolder("-o", options.prefix, longestEnding(options));
  removeAbandonedFiles(folderOf(options.prefix));
  if (options.steps) return generateSteps(options);
  if (options.moving) throw UsageError("--moving needs --steps");
  if (options.first_step > 0) throw UsageError("--first-step needs --steps");
  const SceneGridSource source(makeScenes(options.scene, options.clustering), parseSize(options.size));
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const Plot3dOutputs outputs = writePlot3d(source, options.prefix, progress);
  const Progress::Phase& phase = progress.phases().back();
  for (const auto& path : {outputs.grid, outputs.function, outputs.names}) printLine("{}", path.string());
  fmt::print("{} nodes of {} in {:.1f} s\n", phase.steps, options.scene, phase.seconds);
}

}  // namespace

void addGenerate(CLI::App& app) {
  auto options = std::make_shared<GenerateOptions>();
  CLI::App* command = app.add_subcommand("generate", "Write an analytic scene as PLOT3D files of any size");
  command->add_option("SCENE", options->scene, fmt::format("Scene: one of {}", fmt::join(sceneNames(), ", ")))
      ->required();
  command->add_option("--size", options->size,
                      "Number of nodes along i, j and k: NIxNJxNK, such as 128x64x64; required");
  command
      ->add_option(
          "-o,--output", options->prefix,
          "Prefix of the files to write, in place of any that exist: PREFIX.xyz, PREFIX.fun and PREFIX.nam")
      ->required();
  command->add_option(
      "--clustering", options->clustering,
      "Clustering B: the outermost cells along j are about e^B times as long as the innermost");
  command
      ->add_option(
          "--steps", options->steps,
          "Time steps of the wake, whose vortices move: PREFIX.xyz, PREFIX_0000.fun, PREFIX_0001.fun, ...")
      ->check(CLI::Range(uint64_t{1}, uint64_t{9999}));
  command->add_option("--first-step", options->first_step, "Number of the first of --steps (default 0)")
      ->check(CLI::Range(uint64_t{0}, uint64_t{9999}));
  command->add_flag("--moving", options->moving, "The grid moves with time: PREFIX_0000.xyz, ...");
  command->callback([options] { generate(*options); });
}

}  // namespace curvisplat
