#include "tools/commands/convert_series.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>

#include "preprocess/addition/convert_series.h"
#include "preprocess/addition/join_series.h"
#include "preprocess/addition/shared_series.h"
#include "preprocess/formats/open/series_files.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/partial_folder.h"
#include "tools/commands/conversion_report.h"
#include "tools/commands/folder_events.h"
#include "tools/commands/written_files.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/option_parsers.h"
#include "tools/output/command_run.h"
#include "tools/output/launched_ranks.h"
#include "tools/output/results.h"
#include "tools/output/start_checks.h"

namespace curvisplat {
namespace {

void checkPartOfConversion(const ConvertArguments& arguments) {
  parsePart(*arguments.part);
  const auto refuse = [](bool given, const char* option, const char* reason) {
    if (given) throw UsageError("--part cannot be combined with {}: {}", option, reason);
  };
  refuse(arguments.adds_steps, "--add-steps", "parts are joined to a new cache");
  refuse(arguments.follows, "--follow", "parts are of a series that is complete");
  refuse(arguments.keep_going, "--keep-going",
         "steps that are left out would decide how later ones are coded");
  refuse(arguments.dry_run, "--dry-run", "leave out one of them");
  refuse(!launchedRanks().alone(), "mpirun", "ranks share out the steps themselves; leave out one of them");
}

void checkSeriesArguments(const ConvertArguments& arguments) {
  if (arguments.grid.time_step)
    throw UsageError("--time-step {}: chooses one step, and there are several here; use --steps {}",
                     *arguments.grid.time_step, *arguments.grid.time_step);
  if (arguments.follows && !launchedRanks().alone())
    throw UsageError("--follow: one process converts; start curvisplat without mpirun");
  if (arguments.follows && !arguments.statistics.empty())
    throw UsageError("--stats cannot be combined with --follow, which may go on without an end");
  if (arguments.part) checkPartOfConversion(arguments);
  if (!arguments.adds_steps) return;
  const auto refuse = [](bool given, const char* option) {
    if (given)
      throw UsageError("{} cannot be combined with --add-steps, which changes an existing cache", option);
  };
  if (arguments.to.empty()) throw UsageError("--add-steps needs --to CACHE, the cache to add to");
  refuse(!arguments.output.empty(), "--output");
  refuse(!arguments.scalars.empty(), "--scalar");
  refuse(!arguments.added_scalars.empty(), "--add-scalar");
  refuse(arguments.overwrite, "--overwrite");
}

/// Checks the folder for a new cache. A link stays: the folders for unfinished files are beside its target.
void checkCacheFolder(const std::filesystem::path& output) {
  checkOutputFolder("-o", output);
  checkOutputFolder("-o", linkTarget(output), launchedRanks().alone() ? kPartialSuffix : kRanksSuffix);
}

std::string titleOf(const OpenGridOptions& files) {
  return files.grid.stem().string();
}

SeriesOptions seriesOptions(const ConvertArguments& arguments) {
  SeriesOptions options;
  options.convert.output = linkTarget(arguments.adds_steps ? arguments.to : arguments.output);
  options.convert.overwrite = arguments.overwrite;
  options.convert.resume = arguments.resume;
  options.convert.title = titleOf(arguments.grid);
  applyCommonOptions(arguments, options.convert);
  applyGridUse(arguments, options.convert);
  options.convert.differing = DifferingScalars::kKeepApart;
  options.keep_going = arguments.keep_going;
  options.add = arguments.adds_steps;
  return options;
}

/// Prints each step as it comes, and keeps what --stats reports.
class StepLog {
 public:
  /// `last`: the last of several steps that are known.
  StepLog(const ConvertArguments& arguments, Progress& progress, std::optional<OpenGridOptions> last = {})
      : progress_(progress), cuts_by_need_(!arguments.refine), last_(std::move(last)) {}

  void add(const SeriesEvent& event) {
    const double now = secondsOf(progress_), seconds = now - before_;
    before_ = now;
    if (!event.reason.empty()) {
      progress_.end();
      printMessage("warning: left out {}: {}", event.name, event.reason);
      return;
    }
    if (event.source && event.converted)
      for (const auto* warnings : {&event.source->warnings, &event.converted->warnings})
        for (const std::string& warning : *warnings) printMessage("warning: {}", warning);
    if (event.source && event.converted && cuts_by_need_) note_ = noteOnCuts(*event.source);
    if (event.source && event.converted && last_)
      if (const std::string note = noteOnLaterScalars(*event.source, *last_); !note.empty())
        printMessage("warning: {}", note);
    if (event.added)
      for (const std::string& warning : event.added->warnings)
        printMessage("warning: {}: {}", event.name, warning);
    const std::vector<FileReport>& files = event.added ? event.added->files : event.converted->files;
    const bool is_new = !event.added || event.added->new_geometry;
    steps_.push_back(
        {{"name", event.name}, {"seconds", seconds}, {"bytes", totalBytes(files)}, {"new_geometry", is_new}});
    bytes_ += totalBytes(files);
  }

  /// Says once what was done to the cells, after the work: an error is one line.
  void sayNote() {
    if (!note_.empty()) printMessage("note: {}", note_);
    note_.clear();
  }
  uint64_t bytes() const { return bytes_; }
  const nlohmann::json& steps() const { return steps_; }

 private:
  Progress& progress_;
  bool cuts_by_need_;  // without being asked to
  std::string note_;
  std::optional<OpenGridOptions> last_;
  nlohmann::json steps_ = nlohmann::json::array();
  uint64_t bytes_ = 0;
  double before_ = 0;
};

/// Converts what a simulation writes until the cache has enough steps. Throws Interrupted.
void follow(const ConvertArguments& arguments) {
  SeriesOptions options = seriesOptions(arguments);
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  StepLog log(arguments, progress);
  FolderEvents events(foldersOf(arguments.grid));
  WrittenFiles files(arguments.grid);
  std::set<std::string> converted;  // names of steps: a file may have several, and be tried again
  uint64_t steps = 0;
  const std::filesystem::path manifest = options.convert.output / "manifest.json";
  if (options.add || (options.convert.resume && std::filesystem::exists(manifest))) {
    const CacheReader cache(options.convert.output);
    files.markDone(cache.seriesManifest().sources, options.convert.resume);
    steps = cache.series().steps.size();
    options.add = true;
  }
  while (!arguments.until || steps < *arguments.until) {
    const std::optional<StepFiles> step = files.next();
    for (const std::string& reason : files.takeReasons()) {
      progress.end();
      printMessage("warning: waiting for a file: {}", reason);
    }
    if (!step) {
      events.wait(files.untilNext(), progress);
      continue;
    }
    // What fails may not be written yet. But before a first step, options may be wrong.
    const bool may_grow = !converted.empty() && files.isLast();
    options.keep_going = arguments.keep_going && !may_grow;
    try {
      for (const StepFiles& one : stepsIn(*step)) {
        if (arguments.until && steps >= *arguments.until) break;
        if (converted.contains(one.name)) continue;
        progress.throwIfStopped();
        if (!options.add) options.convert.title = titleOf(one.options);
        const std::vector<StepFiles> only{one};
        const SeriesReport report = convertSeries(seriesInput(arguments, only, only), options, progress,
                                                  [&](const SeriesEvent& event) { log.add(event); });
        log.sayNote();
        if (report.converted > 0) printLine("step {}: {}", report.steps - 1, one.name);
        std::fflush(stdout);
        converted.insert(one.name);
        steps = report.steps;
        options.add = true;
        options.convert.overwrite = false;
      }
    } catch (const Interrupted&) {
      throw;
    } catch (const OutputError&) {
      throw;
    } catch (const UsageError&) {
      throw;
    } catch (const Error& error) {
      if (!files.isLast() || converted.empty()) throw;
      progress.end();
      printMessage("warning: not taken yet: {}; it is tried again when the file has changed", error.what());
      files.tryAgain(*step);
    }
  }
  printLine("{}: {}", options.convert.output.string(), countText(steps, "step"));
}

void printSums(const SeriesReport& report, const std::filesystem::path& cache) {
  printLine("{}: {}{}, {} of them converted now, {} with a geometry of their own", cache.string(),
            countText(report.steps, "step"),
            report.left_out > 0 ? fmt::format(" ({} left out)", report.left_out) : "", report.converted,
            report.new_geometries);
}

/// To the --stats file, if there is one.
void writeSeriesStatistics(const ConvertArguments& arguments, const SeriesReport& report, const StepLog& log,
                           const Progress& progress) {
  if (arguments.statistics.empty()) return;
  nlohmann::json json = runStatistics();
  json["ranks"] = launchedRanks().count();
  json["steps"] = report.steps;
  json["converted"] = report.converted;
  json["left_out"] = report.left_out;
  json["new_geometries"] = report.new_geometries;
  json["samples"] = report.nodes;
  json["each_step"] = log.steps();
  addPhases(progress, json);
  writeStatistics(arguments.statistics, json);
}

/// Steps `places` of `steps` into a part of their own.
void convertPart(const ConvertArguments& arguments, const std::vector<StepFiles>& steps) {
  const FramePart number = parsePart(*arguments.part);
  const SeriesPart part{number.index, number.count};
  const std::vector<uint64_t> places = placesOfPart(part, steps.size());
  SeriesOptions options = seriesOptions(arguments);
  const std::filesystem::path folder = partsFolder(options.convert.output);
  if (places.empty()) {
    makePartsFolder(folder);
    writePartRecord(folder, part, steps.size(), {});
    Progress nothing;
    writeSeriesStatistics(arguments, {}, StepLog(arguments, nothing), nothing);
    printLine("{}: no steps in this part", folder.string());
    return;
  }
  std::vector<StepFiles> own;
  for (const uint64_t place : places) own.push_back(steps[place]);
  ConvertArguments of_all = arguments;  // all parts have the same refinement
  if (of_all.temporary_folder.empty()) of_all.temporary_folder = folderOf(folder);  // `folder` is made later
  of_all.refinement = refinementOfSteps(of_all, partCache(folder, part), steps);
  SeriesInput input = seriesInput(of_all, own, steps);
  input.places = places;
  options.convert.output = partCache(folder, part);
  options.to_part = part.index > 0;
  options.before_change = [&] {
    makePartsFolder(folder);  // not before: wrong usage leaves nothing
    removePartRecord(folder, part);
  };
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  StepLog log(arguments, progress);
  const SeriesReport report = [&] {
    try {
      return convertSeries(input, options, progress, [&](const SeriesEvent& event) { log.add(event); });
    } catch (...) {
      ::rmdir(folder.c_str());  // if nothing is in it
      throw;
    }
  }();
  writePartRecord(folder, part, steps.size(), report.origins);
  log.sayNote();
  printSums(report, options.convert.output);
  writeSeriesStatistics(arguments, report, log, progress);
}

}  // namespace

void runJoinSeries(ConvertArguments arguments) {
  if (!launchedRanks().alone())
    throw UsageError("--join: one process joins the parts; start curvisplat without mpirun");
  if (arguments.output.empty()) throw UsageError("--output is required");
  if (!arguments.output.has_filename()) arguments.output = arguments.output.parent_path();  // "NAME.splats/"
  checkCacheFolder(arguments.output);
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const JoinReport report =
      joinParts({arguments.grid.grid, linkTarget(arguments.output), arguments.overwrite}, progress);
  printLine("{}: {} from {}; {} may be removed", arguments.output.string(), countText(report.steps, "step"),
            countText(report.parts, "part"), arguments.grid.grid.string());
}

bool isSeries(ConvertArguments& arguments) {
  if (arguments.follows) return true;
  expandPatterns(arguments.grid);
  return arguments.part || arguments.adds_steps || arguments.steps || arguments.every ||
         hasSeveralStepFiles(arguments.grid);
}

void runConvertSeries(ConvertArguments arguments) {
  checkSeriesArguments(arguments);
  if (!arguments.added_scalars.empty())
    throw UsageError(
        "--add-scalar adds to a cache of one time step; give the grid and the files of that step alone");
  if (!arguments.adds_steps && arguments.output.empty()) throw UsageError("--output is required");
  for (auto* path : {&arguments.output, &arguments.to})
    if (!path->empty() && !path->has_filename()) *path = path->parent_path();  // "NAME.splats/"
  if (!arguments.adds_steps) checkCacheFolder(arguments.output);
  if (arguments.follows) {
    if (arguments.steps || arguments.every)
      throw UsageError("--follow takes all steps; leave out --steps and --every");
    requireThreads(arguments.threads);
    return follow(arguments);
  }
  const std::vector<StepFiles> steps = chosenSteps(arguments);
  if (arguments.part) {
    requireThreads(arguments.threads);
    return convertPart(arguments, steps);
  }
  SeriesOptions options = seriesOptions(arguments);
  Ranks& ranks = launchedRanks();
  options.convert.ranks = &ranks;
  const SeriesInput input = seriesInput(arguments, steps, steps);
  if (arguments.dry_run) return dryRunOfSeries(input, options, arguments);
  requireSameSteps(steps.size());

  requireThreads(arguments.threads);
  Progress progress{ranks.isFirst() ? progressBar() : Progress::Display{}};
  const StopOnSignals stopping(progress);
  const StopRanksWith stopping_ranks(ranks, progress);
  const bool names_scalars = !arguments.scalars.empty() || arguments.adds_steps;
  StepLog log(arguments, progress,
              names_scalars || steps.size() < 2 ? std::nullopt : std::optional(steps.back().options));
  const SeriesReport report =
      convertSeries(input, options, progress, [&](const SeriesEvent& event) { log.add(event); });
  if (!ranks.isFirst()) return;
  log.sayNote();

  const double seconds = secondsOf(progress);
  const auto samples = static_cast<double>(report.nodes * report.converted);
  printSums(report, options.convert.output);
  if (report.converted > 0)
    fmt::print("{:.1f} s, {:.2f} M samples/s, {:.1f} MiB, {:.2f} bytes per sample and step{}\n", seconds,
               1e-6 * samples / seconds, mebibytes(log.bytes()), static_cast<double>(log.bytes()) / samples,
               peakMemoryText());
  if (report.steps > 0) printStored(options.convert.output, report.steps - 1, " at the last step");
  writeSeriesStatistics(arguments, report, log, progress);
}

}  // namespace curvisplat
