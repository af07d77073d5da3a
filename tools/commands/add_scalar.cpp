#include "tools/commands/add_scalar.h"

#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/grid/time_steps.h"
#include "stream/base/error.h"
#include "stream/base/message.h"
#include "tools/output/progress_bar.h"
#include "tools/output/run_statistics.h"
#include "tools/output/stop_signals.h"

namespace curvisplat {
namespace {

void checkWords(const ConvertArguments& words) {
  if (words.to.empty()) throw UsageError("--add-scalar: name the cache with --to");
  if (words.added_scalars.empty()) throw UsageError("--to: name scalars with --add-scalar");
  const auto refuse = [](bool given, const char* option) {
    if (given)
      throw UsageError("{} makes a new cache, and --add-scalar changes one: leave one of them out", option);
  };
  refuse(!words.output.empty(), "--output");
  refuse(!words.scalars.empty(), "--scalar");
  refuse(words.overwrite, "--overwrite");
  refuse(words.resume, "--resume");
}

void printSummary(const ConvertArguments& words, const AddScalarReport& report, double seconds,
                  uint64_t peak_memory_bytes) {
  const auto nodes = static_cast<double>(report.nodes);
  std::string names;
  for (const std::string& name : report.scalars) names += (names.empty() ? "" : ", ") + name;
  fmt::print("{}: added {} to {} splats\n", words.to.string(), names, report.splats);
  fmt::print("{:.1f} s, {:.2f} M nodes/s, {:.1f} MiB, {:.2f} bytes a node, peak memory {:.0f} MiB\n", seconds,
             1e-6 * nodes / seconds, mebibytes(totalBytes(report.files)),
             static_cast<double>(totalBytes(report.files)) / nodes, mebibytes(peak_memory_bytes));
}

nlohmann::json statistics(const AddScalarReport& report, const Progress& progress) {
  nlohmann::json json = commonStatistics(report, progress);
  json["scalars"] = report.scalars;
  json["nodes"] = report.nodes;
  return json;
}

}  // namespace

void runAddScalar(ConvertArguments words) {
  checkWords(words);
  if (!words.to.has_filename()) words.to = words.to.parent_path();  // "NAME.splats/"
  AddScalarOptions options;
  options.cache = words.to;
  takeCommonWords(words, options);

  const auto source = openSource(words, words.to);
  options.scalars = chooseScalars(words, words.added_scalars, source->description());
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const AddScalarReport report = addScalars(*source, options, progress);
  const nlohmann::json numbers = statistics(report, progress);
  for (const std::string& warning : source->description().warnings) printMessage("warning: {}", warning);
  if (const auto note = timeStepNote(source->description(), words.grid.time_step))
    printMessage("note: {}", *note);
  printSummary(words, report, secondsOf(progress), numbers["peak_memory_bytes"]);
  if (!words.statistics.empty()) writeStatistics(words.statistics, numbers);
}

}  // namespace curvisplat
