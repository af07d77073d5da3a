// The options of subcommands that read grids: how the files are read (addGridOptions(), addGasOptions()),
// what both modes of `convert` share (writing a new cache, adding scalars to one), and the time steps of a
// series.
//
// ConvertArguments holds values as given; the functions here parse and check them, and throw UsageError with
// the option, the value found and the form expected. They keep no state: any thread may call them.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "preprocess/convert/convert.h"
#include "preprocess/formats/derived/derived_source.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/open/series_files.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"
#include "stream/model/refinement.h"
#include "tools/options/option_parsers.h"
#include "tools/output/results.h"

namespace curvisplat {

/// Adds to `app` the options that set the given fields of `options`, which must outlive parsing:
///   options.time_step   --time-step
///   options.force       --byte-order, --records, --precision, --blocks, --iblank, --ascii, --binary
///   options.select      --select
///   options.cut_curved  --order
///   options.globe       --sphere, --flat, --vertical-scale
void addGridOptions(CLI::App& app, OpenGridOptions& options);

/// Adds --gamma and --gas-constant.
void addGasOptions(CLI::App& app, GasModel& gas);

/// Opens the grid and adds the scalars that can be derived from its own.
std::unique_ptr<DataSource> openWithDerived(const OpenGridOptions& grid, const DerivedOptions& derived);

/// Limit of --refine: a cell becomes 4096 cells.
inline constexpr uint32_t kMaxRefinement = 16;

/// Parses a number of parts or "auto", which is nullopt: cells are cut where their shapes need it. `option`: the
/// name in messages. Throws UsageError.
std::optional<uint32_t> parseRefinement(const std::string& option, const std::string& text);

/// Command-line arguments as given; checked and parsed later.
struct ConvertArguments {
  OpenGridOptions grid;
  GasModel gas;
  std::vector<std::string> scalars, added_scalars;
  std::set<std::string> unusable_scalars;  // are not converted unless they are named
  std::filesystem::path output, to, temporary_folder, statistics, trace;
  std::optional<double> blank_value;
  std::optional<std::string> refine;     // parts of a cell along each axis, or auto (the default)
  std::optional<Refinement> refinement;  // instead: as a cache has it
  std::optional<std::string> memory;
  unsigned threads = 0;
  bool overwrite = false, resume = false, no_preflight = false, dry_run = false;
  std::vector<std::string> planes;  // --surface
  bool no_surfaces = false;
  std::optional<std::string> overlap;  // owner or all
  std::string precision = "auto";      // or normal, fine
  std::optional<std::string> steps;    // of a series
  std::optional<uint64_t> every;
  bool keep_going = false, adds_steps = false, follows = false;
  std::optional<std::string> part;  // i/n of the steps
  bool joins = false;               // the grid is a folder of such parts
  std::optional<uint64_t> until;    // steps of a cache that follows a simulation
};

/// Opens the grid, refined as --refine says, or like the cache that is added to or continued. Temporary
/// files go to --tmp, or without it beside `cache`.
std::unique_ptr<DataSource> openSource(const ConvertArguments& arguments, const std::filesystem::path& cache);

/// The source with cells cut as a cache has it. Throws Error if these are cells of other blocks, or of an unstructured grid that
/// halved() refuses, or not cut into a power of two.
std::unique_ptr<DataSource> refinedBy(const Refinement& refinement, std::unique_ptr<DataSource> source,
                                      std::optional<double> blank_value);

/// The refinement by need of a grid (preprocess/survey/cell_bends.h), or of an unstructured one
/// (preprocess/gather/halved_mesh.h). `threads`: at most, or 0.
Refinement refinementByNeed(const DataSource& source, const std::vector<uint32_t>& scalars, unsigned threads,
                            std::optional<double> blank_value);
/// Says that cells are cut, and that `how_to_avoid` leaves them whole; empty if none are.
std::string noteOnCuts(const GridDescription& description, std::string_view how_to_avoid = "--refine 1");
/// Notes on a grid's cells, a line each: that they are cut without having been asked for, and that a picture of a structured one
/// will show them. `threads`: as above.
std::vector<std::string> notesOnCells(const DataSource& source, const ConvertArguments& arguments);

/// Positions of the scalars `names` in the description: names, lists "a,b", or "all". Without names it
/// chooses all that the files store, at most 16 of one centring, and a note says what is left out. Prints a
/// note for each number that could mean two scalars. Throws Error, not UsageError, for a scalar that the
/// files lack: the files decide, not the usage.
std::vector<uint32_t> chooseScalars(const ConvertArguments& arguments, const std::vector<std::string>& names,
                                    const GridDescription& description);

/// Moves words that are not files from the solutions to the scalars: the `b` of "--scalar a b".
void takeScalarsFromSolutions(ConvertArguments& arguments);

/// Sets the options of --surface, --no-surfaces, --overlap and --value-precision. Throws UsageError.
void applyGridUse(const ConvertArguments& arguments, ConvertOptions& options);

/// The sum over all phases.
double secondsOf(const Progress& progress);

uint64_t totalBytes(std::span<const FileReport> files);
double mebibytes(uint64_t bytes);
/// ", peak memory 123 MiB": the peak of this process so far; empty where the system does not report it.
std::string peakMemoryText();

/// The files of the grid, and the caches: what --stats and --trace must not overwrite.
std::vector<std::filesystem::path> gridAndCaches(const ConvertArguments& arguments);

/// Throws Error if the --stats file cannot be written or is one of the inputs or outputs.
void checkStatisticsFile(const ConvertArguments& arguments);

/// Sets the options that both modes have, and calls checkStatisticsFile(). Throws UsageError and Error.
template <typename Options>
void applyCommonOptions(const ConvertArguments& arguments, Options& options) {
  checkStatisticsFile(arguments);
  options.temporary_folder = arguments.temporary_folder;
  options.blank_value = arguments.blank_value;
  options.threads = arguments.threads;
  options.check_disk_space = !arguments.no_preflight;
  if (arguments.memory) options.memory_bytes = parseMemory("--memory", *arguments.memory);
}

/// Sets "seconds" and "phases".
void addPhases(const Progress& progress, nlohmann::json& json);

/// The part of --stats that both modes report.
template <typename Report>
nlohmann::json commonStatistics(const Report& report, const Progress& progress) {
  nlohmann::json json = runStatistics();
  json["threads"] = report.threads;
  json["memory_bytes"] = report.memory_bytes;
  json["splats"] = report.splats;
  json["temporary_bytes"] = report.temporary_bytes;
  addPhases(progress, json);
  for (const FileReport& file : report.files) json["files"][file.name] = file.bytes;
  return json;
}

/// The time steps of the files that --steps and --every select. `option`: the name of --steps in messages.
/// Throws UsageError, and Error if the files cannot be read.
std::vector<StepFiles> chosenSteps(const ConvertArguments& arguments, const std::string& option = "--steps");

/// The refinement of all `steps` of a series: that of `cache` if it is continued, or as --refine asks, by need of
/// the first step that can be opened. Throws UsageError and Error.
Refinement refinementOfSteps(const ConvertArguments& arguments, const std::filesystem::path& cache,
                             const std::vector<StepFiles>& steps);

/// A series for convertSeries(): opens each step as `arguments` say, and chooses the scalars from the first: where none are named, those
/// that all of the series' steps have (`all`; `steps` may be a part of them). The arguments must outlive the result.
SeriesInput seriesInput(const ConvertArguments& arguments, const std::vector<StepFiles>& steps,
                        const std::vector<StepFiles>& all);

}  // namespace curvisplat
