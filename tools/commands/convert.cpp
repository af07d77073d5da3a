// `curvisplat convert`: converts a grid to a splat cache, or with --add-scalar NAME --to CACHE adds scalars
// to an existing cache. Conversions of several time steps are in convert_series.cpp.
#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/node_reader.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/memory.h"
#include "stream/base/name_list.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/partial_folder.h"
#include "tools/commands/commands.h"
#include "tools/commands/conversion_report.h"
#include "tools/commands/convert_series.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/option_parsers.h"
#include "tools/options/shared_options.h"
#include "tools/output/command_run.h"
#include "tools/output/launched_ranks.h"
#include "tools/output/results.h"
#include "tools/output/start_checks.h"

namespace curvisplat {
namespace {

/// Throws UsageError if options contradict --add-scalar.
void checkAddScalarArguments(const ConvertArguments& arguments) {
  if (arguments.to.empty()) throw UsageError("--add-scalar needs --to CACHE, the cache to add to");
  if (arguments.added_scalars.empty()) throw UsageError("--to needs --add-scalar NAME, the scalar to add");
  const auto refuse = [](bool given, const char* option) {
    if (given)
      throw UsageError("{} cannot be combined with --add-scalar, which changes an existing cache", option);
  };
  refuse(!arguments.output.empty(), "--output");
  refuse(!arguments.scalars.empty(), "--scalar");
  refuse(arguments.overwrite, "--overwrite");
  refuse(arguments.resume, "--resume");
}

void printAddition(const ConvertArguments& arguments, const AddScalarReport& report, double seconds) {
  const auto samples = static_cast<double>(report.nodes);
  std::string names;
  for (const std::string& name : report.scalars) names += (names.empty() ? "" : ", ") + name;
  fmt::print("{}: added {} for {} splats\n", arguments.to.string(), names, report.splats);
  fmt::print("{:.1f} s, {:.2f} M samples/s, {:.1f} MiB, {:.2f} bytes per sample{}\n", seconds,
             1e-6 * samples / seconds, mebibytes(totalBytes(report.files)),
             static_cast<double>(totalBytes(report.files)) / samples, peakMemoryText());
}

nlohmann::json statisticsOfAddition(const AddScalarReport& report, const Progress& progress) {
  nlohmann::json json = commonStatistics(report, progress);
  json["scalars"] = report.scalars;
  json["samples"] = report.nodes;
  return json;
}

/// Adds the scalars and prints a summary. Throws UsageError if options contradict each other, and Error.
void runAddScalar(ConvertArguments arguments) {
  checkAddScalarArguments(arguments);
  Ranks& ranks = launchedRanks();
  if (!arguments.to.has_filename()) arguments.to = arguments.to.parent_path();  // "NAME.splats/"
  AddScalarOptions options;
  options.cache = arguments.to;
  options.ranks = &ranks;
  applyCommonOptions(arguments, options);

  const std::unique_ptr<DataSource> source = openSource(arguments, arguments.to);
  options.scalars = chooseScalars(arguments, arguments.added_scalars, source->description());
  requireThreads(arguments.threads);
  Progress progress{ranks.isFirst() ? progressBar() : Progress::Display{}};
  const StopOnSignals stopping(progress);
  const StopRanksWith stopping_ranks(ranks, progress);
  const AddScalarReport report = addScalars(*source, options, progress);
  if (!ranks.isFirst()) return;
  nlohmann::json numbers = statisticsOfAddition(report, progress);
  numbers["ranks"] = ranks.count();
  for (const std::string& warning : source->description().warnings) printMessage("warning: {}", warning);
  for (const std::string& warning : report.warnings) printMessage("warning: {}", warning);
  if (const auto note = timeStepNote(source->description(), arguments.grid.time_step))
    printMessage("note: {}", *note);
  printAddition(arguments, report, secondsOf(progress));
  if (!arguments.statistics.empty()) writeStatistics(arguments.statistics, numbers);
}

void printSummary(const ConvertArguments& arguments, const ConvertReport& report, double seconds) {
  const auto samples = static_cast<double>(report.nodes);
  const uint64_t bytes = totalBytes(report.files);
  printLine("{}: {}, {} in {}, {}", arguments.output.string(), countText(report.nodes, "sample"),
            countText(report.splats, "splat"), countText(report.bricks, "brick"),
            countText(report.levels, "level"));
  // The interrupted run did part of the work, so this run's time gives no rate.
  const std::string rate = report.resumed ? " since it was resumed"
                                          : fmt::format(", {:.2f} M samples/s", 1e-6 * samples / seconds);
  fmt::print("{:.1f} s{}, {:.1f} MiB, {:.2f} bytes per sample{}\n", seconds, rate, mebibytes(bytes),
             static_cast<double>(bytes) / samples, peakMemoryText());
}

/// Prints warnings and notes on the grid to standard error.
void printWarnings(const GridDescription& description, std::optional<uint32_t> time_step,
                   const ConvertReport& report) {
  for (const std::string& warning : description.warnings) printMessage("warning: {}", warning);
  for (const std::string& warning : report.warnings) printMessage("warning: {}", warning);
  for (const std::string& note : report.notes) printMessage("note: {}", note);
  if (const auto note = timeStepNote(description, time_step))
    printMessage("note: {}, or all of them with --steps all", *note);
  const auto note = [](uint64_t count, std::string_view what) {
    if (count > 0) printMessage("note: {} {}", count, what);
  };
  if (report.resumed)
    printMessage("note: resumed; {} of {} bricks were already written", report.resumed_bricks, report.bricks);
  note(report.blanked.by_grid, description.pieces.empty()
                                   ? "samples are blanked by the grid"
                                   : "samples are of cells that are not solid, or blanked by the file");
  note(report.blanked.by_value, "samples have the blank value");
  note(report.blanked.not_finite, fmt::format("samples are {} and are blanked", notFiniteText(description)));
  // For samples at nodes these two differ from what `info` prints: it counts the cells between nodes.
  note(report.degenerate,
       "samples are flat: they have no volume, or nearly none, and are as faint in volume rendering");
  note(report.inverted, "samples are inverted: their handedness differs from most of their block");
  note(report.merged_nodes, description.pieces.empty()
                                ? "nodes on block faces coincide with others and were merged"
                                : "points coincide with others and were merged");
}

nlohmann::json statistics(const ConvertReport& report, const Progress& progress) {
  nlohmann::json json = commonStatistics(report, progress);
  json["resumed"] = report.resumed;
  json["resumed_bricks"] = report.resumed_bricks;
  json["samples"] = report.nodes;
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

/// Converts the grid to a new cache and prints a summary. Throws UsageError and Error.
void runConvert(ConvertArguments arguments) {
  Ranks& ranks = launchedRanks();
  if (arguments.output.empty())
    throw UsageError("--output is required, or --to CACHE with --add-scalar or --add-steps");
  if (!arguments.output.has_filename()) arguments.output = arguments.output.parent_path();  // "NAME.splats/"
  // A link stays, as it does where pictures are written through one.
  ConvertOptions options;
  options.output = linkTarget(arguments.output);
  if (options.output != arguments.output) checkOutputFolder("-o", arguments.output);
  checkOutputFolder("-o", options.output, kPartialSuffix);
  options.overwrite = arguments.overwrite;
  options.resume = arguments.resume;
  options.ranks = &ranks;
  applyCommonOptions(arguments, options);
  applyGridUse(arguments, options);

  std::unique_ptr<DataSource> source = openSource(arguments, arguments.output);
  options.scalars = chooseScalars(arguments, arguments.scalars, source->description());
  options.differing = DifferingScalars::kKeepApart;
  options.title = arguments.grid.grid.stem().string();
  requireThreads(arguments.threads);
  std::vector<std::string> notes;
  if (ranks.isFirst()) notes = notesOnCells(*source, arguments);
  if (arguments.dry_run) {
    for (const std::string& note : notes) printMessage("note: {}", note);
    return dryRun(std::move(source), options, arguments);
  }

  Progress progress{ranks.isFirst() ? progressBar() : Progress::Display{}};
  const StopOnSignals stopping(progress);
  const StopRanksWith stopping_ranks(ranks, progress);
  const ConvertReport report = convert(*source, options, progress);
  if (!ranks.isFirst()) return;
  nlohmann::json numbers = statistics(report, progress);
  numbers["ranks"] = ranks.count();
  printWarnings(source->description(), arguments.grid.time_step, report);
  for (const std::string& note : notes) printMessage("note: {}", note);
  printSummary(arguments, report, secondsOf(progress));
  const StoredScalars stored = printStored(options.output);
  for (const double largest : stored.errors) numbers["stored_within"].push_back(largest);
  // The first step of a run often holds nothing but what it starts from.
  const size_t steps = source->description().times.size();
  if (!arguments.grid.time_step && steps > 1 && !stored.constant.empty())
    printMessage("note: the first step has one value of {} everywhere; --time-step {} takes the last step",
                 listed(stored.constant, 3), steps - 1);
  if (!arguments.statistics.empty()) writeStatistics(arguments.statistics, numbers);
}

/// Throws UsageError if an option was given that has no effect in this mode: one for which `hasNoEffect` is
/// true.
void refuseGiven(const CLI::App& command, const char* mode, const char* reason,
                 const std::function<bool(const std::string& name)>& hasNoEffect) {
  for (const CLI::Option* option : command.get_options())
    if (option->count() > 0 && hasNoEffect(option->get_name()))
      throw UsageError("{} cannot be combined with {}, {}",
                       option->get_name() == "SOLUTION" ? "a further file" : option->get_name(), mode,
                       reason);
}

/// Names what --overwrite has kept in the cache's folder.
void noteForeign(const ConvertArguments& arguments) {
  std::error_code none;
  if (!arguments.overwrite || !launchedRanks().isFirst() ||
      !std::filesystem::is_directory(arguments.output, none))
    return;
  const std::vector<std::filesystem::path> names = foreignNames(arguments.output);
  if (names.empty()) return;
  constexpr size_t kMaxNamed = 5;
  std::string text;
  for (size_t n = 0; n < std::min(kMaxNamed, names.size()); ++n)
    text += (n > 0 ? ", " : "") + names[n].string();
  if (names.size() > kMaxNamed) text += fmt::format(" and {} more", names.size() - kMaxNamed);
  printMessage("note: {}: kept what is not the cache's: {}", arguments.output.string(), text);
}

void refuseWithoutEffect(const CLI::App& command, const ConvertArguments& arguments) {
  using Names = std::set<std::string>;
  if (arguments.joins)
    return refuseGiven(command, "--join", "which joins what was converted", [](const std::string& name) {
      return !Names{"GRID", "--output", "--join", "--overwrite"}.contains(name);
    });
  if (!arguments.adds_steps && arguments.added_scalars.empty()) return;
  refuseGiven(command, arguments.adds_steps ? "--add-steps" : "--add-scalar",
              "which follows the choice made for the cache", [](const std::string& name) {
                return Names{"--value-precision", "--overlap", "--surface", "--no-surfaces"}.contains(name);
              });
}

void addSeriesOptions(CLI::App& command, ConvertArguments& arguments) {
  constexpr const char* kGroup = "Time steps";
  addStepsOption(command, arguments.steps)->group(kGroup);
  command.add_option("--every", arguments.every, "Convert every N-th time step")
      ->check(CLI::Range(uint64_t{1}, uint64_t{1'000'000}))
      ->group(kGroup);
  command
      .add_flag("--keep-going", arguments.keep_going,
                "Leave out time steps that do not fit: other blocks, a missing scalar, a time that does not "
                "increase")
      ->group(kGroup);
  command
      .add_flag("--add-steps", arguments.adds_steps,
                "Add the time steps of these files to the cache --to, after its last")
      ->group(kGroup);
  command
      .add_option("--part", arguments.part,
                  "Convert part i of n of the time steps, given as i/n, into the folder OUT.splats.parts, "
                  "for job arrays; --join joins the parts")
      ->group(kGroup);
  command
      .add_flag("--join", arguments.joins,
                "Join the parts in the folder OUT.splats.parts, given as GRID, to the cache -o")
      ->group(kGroup);
  CLI::Option* const follow =
      command
          .add_flag(
              "--follow", arguments.follows,
              "Go on converting the files that match the pattern while a simulation writes them; ends with "
              "Ctrl-C or --until")
          ->group(kGroup);
  command.add_option("--until", arguments.until, "End --follow when the cache has this many time steps")
      ->check(CLI::Range(uint64_t{1}, uint64_t{1'000'000}))
      ->needs(follow)
      ->group(kGroup);
}

}  // namespace

void addConvert(CLI::App& app) {
  auto arguments = std::make_shared<ConvertArguments>();
  CLI::App* command = app.add_subcommand("convert", "Convert a grid to a splat cache, in bounded memory");
  command
      ->add_option("GRID", arguments->grid.grid,
                   "Grid file (PLOT3D, VTK, CGNS, NetCDF, EnSight, Tecplot, XDMF, Exodus, Fluent, Gmsh or "
                   "SU2), or the "
                   "folder of an OpenFOAM case or a Zarr store")
      ->required();
  command->add_option("SOLUTION", arguments->grid.solutions,
                      "Further files of the grid: PLOT3D solution (Q) and function files; NetCDF, VTK or "
                      "CGNS files with fields, "
                      "masks, coordinates or blocks. Numbered files are time steps: q.0 q.1 ..., or a quoted "
                      "pattern such as 'q.*' "
                      "or 'run_%04d.vts'");
  command->add_option("-o,--output", arguments->output, "Splat cache to write: a directory NAME.splats");
  command
      ->add_option("--scalar", arguments->scalars,
                   "Scalars to convert: NAME, NAME,NAME or all; repeatable. A name, the number of a function "
                   "file's variable, or a PLOT3D function number (default: all that the files store)")
      ->take_all()
      ->allow_extra_args(false);
  command
      ->add_option("--add-scalar", arguments->added_scalars,
                   "Scalar to add to the cache --to, which was built from this grid; repeatable")
      ->take_all()
      ->allow_extra_args(false);
  command->add_option("--to", arguments->to, "Splat cache that --add-scalar or --add-steps changes");
  addSeriesOptions(*command, *arguments);
  command->add_option("--blank", arguments->blank_value, "Treat samples with this value as blanked");
  command
      ->add_option("--refine", arguments->refine,
                   "Cut each cell into N x N x N by its own trilinear map; 1: leave cells as they are. auto: "
                   "only where cells grow or bend steeply from one to the next, along the axes that need it, "
                   "into 2, 4 or 8 parts; small unstructured grids are halved as a whole (default: auto)")
      ->type_name("N|auto")
      ->check([](const std::string& text) {
        parseRefinement("--refine", text);
        return std::string();
      });
  command->add_option(
      "--value-precision", arguments->precision,
      "Precision of stored values: normal (16 bits over the local range of values), auto (as normal, "
      "and where long tails make that coarse by the scale of each value) or fine (24 bits, as in a "
      "float). info CACHE prints the rounding errors (default: auto)");
  addMemoryOption(*command, arguments->memory,
                  ", of this process (default: 2G, at most 1/4 of the machine's)");
  addThreadsOption(*command, arguments->threads);
  command->add_option("--tmp", arguments->temporary_folder,
                      "Directory for temporary files (default: beside the cache)");
  command->add_flag(
      "--dry-run", arguments->dry_run,
      "Print what the conversion will take (bytes, memory, time), estimated from a sample of the grid");
  command->add_flag("--no-preflight", arguments->no_preflight,
                    "Skip the check for free disk space before the conversion");
  command->add_flag("--resume", arguments->resume,
                    "Resume an interrupted conversion if there is one; keep finished work on an error");
  command->add_flag("--overwrite", arguments->overwrite,
                    "Replace an existing cache; discard an interrupted conversion unless --resume is given");
  command
      ->add_option("--surface", arguments->planes,
                   "Surface to keep besides the outer faces: an index plane, k=10 or \"block 1:k=10\", "
                   "indices from 0, "
                   "or blanks, the faces between drawn and blanked cells; repeatable")
      ->take_all()
      ->allow_extra_args(false);
  command->add_flag(
      "--no-surfaces", arguments->no_surfaces,
      "Leave the grid's outer faces out of the cache (render --surface kmin and the like need them)");
  command->add_option(
      "--overlap", arguments->overlap,
      "Where blocks overlap: owner draws each point once, by the block with the smallest cells "
      "there; all draws every block (default: owner)");
  addStatsOption(*command, arguments->statistics);
  addTraceOption(*command, arguments->trace);
  addGridOptions(*command, arguments->grid);
  addGasOptions(*command, arguments->gas);
  command->callback([arguments, command] {
    refuseWithoutEffect(*command, *arguments);
    requireSameOptions(*command);
    limitHeaps(kHeapsOfConversion);
    if (arguments->joins) {
      runJoinSeries(*arguments);
      return noteForeign(*arguments);
    }
    takeScalarsFromSolutions(*arguments);
    const bool series = isSeries(*arguments);
    const bool adds = !arguments->added_scalars.empty() || !arguments->to.empty();
    if (arguments->dry_run && (adds || arguments->follows))
      throw UsageError(
          "--dry-run: is for a new cache; leave out --add-scalar, --add-steps, --to and --follow");
    if (arguments->dry_run && !launchedRanks().alone())
      throw UsageError("--dry-run runs in one process; start curvisplat without mpirun");
    runTraced(arguments->trace, gridAndCaches(*arguments), [&] {
      if (series) {
        runConvertSeries(*arguments);
      } else {
        requireSameSteps(1);
        adds ? runAddScalar(*arguments) : runConvert(*arguments);
      }
      noteForeign(*arguments);
    });
  });
}

}  // namespace curvisplat
