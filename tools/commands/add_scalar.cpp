#include "tools/commands/add_scalar.h"

#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/time_steps.h"
#include "stream/base/error.h"
#include "stream/base/message.h"
#include "tools/output/launched_ranks.h"
#include "tools/output/progress_bar.h"
#include "tools/output/required_threads.h"
#include "tools/output/run_statistics.h"
#include "tools/output/stop_signals.h"

namespace curvisplat {
namespace {

void checkArguments(const ConvertArguments& arguments) {
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

void printSummary(const ConvertArguments& arguments, const AddScalarReport& report, double seconds) {
  const auto samples = static_cast<double>(report.nodes);
  std::string names;
  for (const std::string& name : report.scalars) names += (names.empty() ? "" : ", ") + name;
  fmt::print("{}: added {} for {} splats\n", arguments.to.string(), names, report.splats);
  fmt::print("{:.1f} s, {:.2f} M samples/s, {:.1f} MiB, {:.2f} bytes per sample{}\n", seconds,
             1e-6 * samples / seconds, mebibytes(totalBytes(report.files)),
             static_cast<double>(totalBytes(report.files)) / samples, peakMemoryText());
}

nlohmann::json statistics(const AddScalarReport& report, const Progress& progress) {
  nlohmann::json json = commonStatistics(report, progress);
  json["scalars"] = report.scalars;
  json["samples"] = report.nodes;
  return json;
}

}  // namespace

void runAddScalar(ConvertArguments arguments) {
  checkArguments(arguments);
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
  nlohmann::json numbers = statistics(report, progress);
  numbers["ranks"] = ranks.count();
  for (const std::string& warning : source->description().warnings) printMessage("warning: {}", warning);
  if (const auto note = timeStepNote(source->description(), arguments.grid.time_step))
    printMessage("note: {}", *note);
  printSummary(arguments, report, secondsOf(progress));
  if (!arguments.statistics.empty()) writeStatistics(arguments.statistics, numbers);
}

}  // namespace curvisplat
