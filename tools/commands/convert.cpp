// `curvisplat convert`: a grid in, a cache out.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/time_steps.h"
#include "stream/base/error.h"
#include "stream/base/message.h"
#include "stream/base/progress.h"
#include "tools/commands/add_scalar.h"
#include "tools/commands/commands.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/grid_options.h"
#include "tools/options/option_parsers.h"
#include "tools/output/output_paths.h"
#include "tools/output/progress_bar.h"
#include "tools/output/run_statistics.h"
#include "tools/output/stop_signals.h"

namespace curvisplat {
namespace {

void printSummary(const ConvertArguments& words, const ConvertReport& report, double seconds,
                  uint64_t peak_memory_bytes) {
  const auto nodes = static_cast<double>(report.nodes);
  const uint64_t bytes = totalBytes(report.files);
  const bool cells = report.centring == Centring::kCell;
  fmt::print("{}: {} {}, {} splats in {} bricks, {} levels\n", words.output.string(), report.nodes,
             cells ? "cells" : "nodes", report.splats, report.bricks, report.levels);
  // Of a resumed conversion, another has done a part.
  const std::string rate =
      report.resumed ? " since it was resumed"
                     : fmt::format(", {:.2f} M {}/s", 1e-6 * nodes / seconds, cells ? "cells" : "nodes");
  fmt::print("{:.1f} s{}, {:.1f} MiB, {:.2f} bytes a {}, peak memory {:.0f} MiB\n", seconds, rate,
             mebibytes(bytes), static_cast<double>(bytes) / nodes, cells ? "cell" : "node",
             mebibytes(peak_memory_bytes));
}

/// What a person should know of the grid, on stderr: it is odd, not wrong.
void printWarnings(const GridDescription& description, std::optional<uint32_t> time_step,
                   const ConvertReport& report) {
  for (const std::string& warning : description.warnings) printMessage("warning: {}", warning);
  for (const std::string& warning : report.warnings) printMessage("warning: {}", warning);
  if (const auto note = timeStepNote(description, time_step)) printMessage("note: {}", *note);
  const auto note = [](uint64_t count, const char* what) {
    if (count > 0) printMessage("note: {} {}", count, what);
  };
  if (report.resumed)
    printMessage("note: resumed with {} of {} bricks done", report.resumed_bricks, report.bricks);
  if (report.centring == Centring::kCell) {
    note(report.blanked.by_grid, "cells have a blanked corner or no value");
    note(report.blanked.by_value, "cells have the blank value");
    note(report.blanked.not_finite, "cells have an infinite value, and are blanked");
    note(report.degenerate, "cells are degenerate: drawn with a thickness of their own");
    note(report.inverted, "cells are inverted: of the other handedness than most of their block");
  } else {
    note(report.blanked.by_grid, "nodes are blanked by the grid");
    note(report.blanked.by_value, "nodes have the blank value");
    note(report.blanked.not_finite, "nodes are not finite numbers, and are blanked");
    // Not the cells that `info` counts, which lie between nodes.
    note(report.degenerate, "nodes have no volume around them: drawn with a thickness of their own");
    note(report.inverted,
         "nodes have inverted surroundings: of the other handedness than most of their block");
  }
  note(report.merged_nodes, "face nodes coincide with others, and were merged into them");
}

nlohmann::json statistics(const ConvertReport& report, const Progress& progress) {
  nlohmann::json json = commonStatistics(report, progress);
  json["resumed"] = report.resumed;
  json["resumed_bricks"] = report.resumed_bricks;
  json[report.centring == Centring::kCell ? "cells" : "nodes"] = report.nodes;
  json["blanked"] = {{"by_grid", report.blanked.by_grid},
                     {"by_value", report.blanked.by_value},
                     {"not_finite", report.blanked.not_finite}};
  json["degenerate"] = report.degenerate;
  json["inverted"] = report.inverted;
  json["merged_nodes"] = report.merged_nodes;
  json["bricks"] = report.bricks;
  json["levels"] = report.levels;
  json["volume"] = report.volume;
  json["cache_bytes"] = totalBytes(report.files);
  return json;
}

void runConvert(ConvertArguments words) {
  if (words.output.empty()) throw UsageError("--output is required, or --add-scalar and --to");
  if (!words.output.has_filename()) words.output = words.output.parent_path();  // "NAME.splats/"
  checkOutputFolder("-o", words.output);
  ConvertOptions options;
  options.output = words.output;
  options.overwrite = words.overwrite;
  options.resume = words.resume;
  takeCommonWords(words, options);

  const auto source = openSource(words, words.output);
  options.scalars = chooseScalars(words, words.scalars, source->description());
  options.title = words.grid.grid.stem().string();

  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const ConvertReport report = convert(*source, options, progress);
  const nlohmann::json numbers = statistics(report, progress);
  printWarnings(source->description(), words.grid.time_step, report);
  printSummary(words, report, secondsOf(progress), numbers["peak_memory_bytes"]);
  if (!words.statistics.empty()) writeStatistics(words.statistics, numbers);
}

}  // namespace

void addConvert(CLI::App& app) {
  auto words = std::make_shared<ConvertArguments>();
  CLI::App* command = app.add_subcommand("convert", "Make a splat cache of a grid, in bounded memory");
  command->add_option("GRID", words->grid.grid, "Grid file")->required();
  command->add_option("SOLUTION", words->grid.solutions, "Solution (Q) and function files");
  command->add_option("-o,--output", words->output, "The cache to write, NAME.splats: a folder");
  command
      ->add_option("--scalar", words->scalars,
                   "Scalars by name, or by number of a function file's variable or of PLOT3D's "
                   "functions (default: the first)")
      ->take_all()
      ->allow_extra_args(false);
  command
      ->add_option("--add-scalar", words->added_scalars,
                   "Add scalars, by name or number, to the cache --to, whose grid this is")
      ->take_all()
      ->allow_extra_args(false);
  command->add_option("--to", words->to, "The cache that --add-scalar changes");
  command->add_option("--blank", words->blank_value, "Nodes with this value are not there");
  command->add_option("--memory", words->memory,
                      "Cap on this process's memory, as 512M (default: 2G or a quarter of the machine's)");
  command->add_option("--threads", words->threads, "Threads that work (default: all)")
      ->check(CLI::Range(0u, kMaxThreads));
  command->add_option("--tmp", words->temporary_folder, "Folder for temporary files (default: the output's)");
  command->add_flag("--resume", words->resume,
                    "Go on from an interrupted conversion, if there is one; keep what is done on errors");
  command->add_flag("--overwrite", words->overwrite,
                    "Replace the output if it is a cache; drop an interrupted conversion, unless --resume");
  command->add_option("--stats", words->statistics, "Write times, bytes and counts to FILE.json");
  addGridOptions(*command, words->grid);
  addGasOptions(*command, words->gas);
  command->callback([words] {
    const bool adds = !words->added_scalars.empty() || !words->to.empty();
    adds ? runAddScalar(*words) : runConvert(*words);
  });
}

}  // namespace curvisplat
