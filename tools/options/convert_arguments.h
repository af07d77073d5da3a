// What `curvisplat convert` was asked for, and what its two ways of working (a new cache, or scalars added to
// one) have in common.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/open_grid.h"
#include "stream/base/progress.h"
#include "tools/options/option_parsers.h"
#include "tools/output/run_statistics.h"

namespace curvisplat {

/// The command line's words, as given.
struct ConvertArguments {
  OpenGridOptions grid;
  GasModel gas;
  std::vector<std::string> scalars, added_scalars;
  std::filesystem::path output, to, temporary_folder, statistics;
  std::optional<double> blank_value;
  std::optional<std::string> memory;
  unsigned threads = 0;
  bool overwrite = false, resume = false;
};

/// Opens the grid: temporary files go where the words say, else beside `cache`.
std::unique_ptr<GridSource> openSource(const ConvertArguments& words, const std::filesystem::path& cache);

/// Positions of the scalars called `names`. One that the files lack is bad input, not wrong usage, since the
/// files decide: throws Error. Prints notes on numbers that mean two of them.
std::vector<uint32_t> chooseScalars(const ConvertArguments& words, const std::vector<std::string>& names,
                                    const GridDescription& description);

/// Of all phases.
double secondsOf(const Progress& progress);

uint64_t totalBytes(std::span<const FileReport> files);
double mebibytes(uint64_t bytes);

/// Throws Error for a --stats that cannot be written, or would change what is read.
void checkStatisticsFile(const ConvertArguments& words);

/// What the words say of either way's options. Throws as checkStatisticsFile().
template <typename Options>
void takeCommonWords(const ConvertArguments& words, Options& options) {
  checkStatisticsFile(words);
  options.temporary_folder = words.temporary_folder;
  options.blank_value = words.blank_value;
  options.threads = words.threads;
  if (words.memory) options.memory_bytes = parseMemory("--memory", *words.memory);
}

/// Sets "seconds" and "phases".
void addPhases(const Progress& progress, nlohmann::json& json);

/// What --stats tells of either way.
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

}  // namespace curvisplat
