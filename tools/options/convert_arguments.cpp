#include "tools/options/convert_arguments.h"

#include <fmt/format.h>

#include <cstdio>

#include "stream/base/error.h"
#include "stream/base/message.h"
#include "stream/base/process_usage.h"
#include "tools/options/grid_options.h"
#include "tools/output/output_paths.h"

namespace curvisplat {

std::unique_ptr<GridSource> openSource(const ConvertArguments& arguments,
                                       const std::filesystem::path& cache) {
  OpenGridOptions grid = arguments.grid;
  grid.temporary_folder =
      arguments.temporary_folder.empty() ? cache.parent_path() : arguments.temporary_folder;
  if (grid.temporary_folder.empty()) grid.temporary_folder = ".";
  grid.scalars = arguments.scalars;
  grid.scalars.insert(grid.scalars.end(), arguments.added_scalars.begin(), arguments.added_scalars.end());
  return openWithDerived(grid, {arguments.gas, arguments.blank_value});
}

std::vector<uint32_t> chooseScalars(const ConvertArguments& arguments, const std::vector<std::string>& names,
                                    const GridDescription& description) {
  try {
    for (const std::string& note : notesOnNumbers(description, names)) printMessage("note: {}", note);
    return scalarsNamed(description, names);
  } catch (const UsageError& error) {
    throw Error("{}: {}", arguments.grid.grid.string(), error.what());
  }
}

void checkStatisticsFile(const ConvertArguments& arguments) {
  if (arguments.statistics.empty()) return;
  std::vector<std::filesystem::path> inputs = arguments.grid.solutions;
  inputs.push_back(arguments.grid.grid);
  inputs.insert(inputs.end(), {arguments.to, arguments.output});
  checkOutputFile("--stats", arguments.statistics, inputs);
}

double secondsOf(const Progress& progress) {
  double seconds = 0;
  for (const Progress::Phase& phase : progress.phases()) seconds += phase.seconds;
  return seconds;
}

void addPhases(const Progress& progress, nlohmann::json& json) {
  json["seconds"] = secondsOf(progress);
  for (const Progress::Phase& phase : progress.phases())
    json["phases"].push_back({{"name", phase.name},
                              {"seconds", phase.seconds},
                              {"cpu_seconds", phase.usage.cpu_seconds},
                              {"steps", phase.steps},
                              {"unit", phase.unit},
                              {"bytes_read", phase.usage.bytes_read},
                              {"bytes_written", phase.usage.bytes_written},
                              {"peak_memory_bytes", phase.usage.peak_memory_bytes}});
}

uint64_t totalBytes(std::span<const FileReport> files) {
  uint64_t bytes = 0;
  for (const FileReport& file : files) bytes += file.bytes;
  return bytes;
}

double mebibytes(uint64_t bytes) {
  return static_cast<double>(bytes) / static_cast<double>(1 << 20);
}

std::string peakMemoryText() {
  const uint64_t bytes = ProcessUsage::now().peak_memory_bytes;
  return bytes > 0 ? fmt::format(", peak memory {:.0f} MiB", mebibytes(bytes)) : "";
}

}  // namespace curvisplat
