#include "tools/throughput/conversion_throughput.h"

#include <stdlib.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <system_error>

#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "stream/base/error.h"
#include "stream/base/os.h"
#include "stream/base/progress.h"
#include "tools/throughput/machine.h"
#include "tools/throughput/measurements.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using ConversionJson = nlohmann::ordered_json;

// Bytes on disk per node: 16 for the grid, 67 for scattered splats, up to 13 for the cache (bench/README.md),
// with a margin; a minimum for small grids.
constexpr uint64_t kDiskBytesPerNode = 100, kMinDiskBytes = 16 << 20;

/// A temporary folder, removed with its contents.
class WorkFolder {
 public:
  explicit WorkFolder(const fs::path& parent) {
    std::string name = (parent / "curvisplat-bench-XXXXXX").string();
    if (!::mkdtemp(name.data()))
      throw Error("--tmp {}: cannot create a directory in it: {}", parent.string(), std::strerror(errno));
    path_ = name;
  }
  ~WorkFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;

  fs::path operator/(const char* name) const { return path_ / name; }

 private:
  fs::path path_;
};

void checkSpace(const fs::path& folder, uint64_t nodes) {
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  if (error) throw Error("--tmp {}: cannot determine its free space: {}", folder.string(), error.message());
  const uint64_t needed = diskBytesFor(nodes);
  if (space.available < needed)
    throw Error(
        "--tmp {}: too little space for {} nodes (found {} MiB free, expected {} MiB); choose fewer --nodes "
        "or "
        "another --tmp",
        folder.string(), nodes, space.available >> 20, needed >> 20);
}

struct Run {
  double seconds = 0;
  std::vector<Progress::Phase> phases;
  uint64_t peak_memory_bytes = 0;
};

Run convertOnce(const GridSource& source, const ConvertOptions& options, Progress& progress,
                ConvertReport& report) {
  const size_t before = progress.phases().size();
  report = convert(source, options, progress);
  Run run;
  run.phases.assign(progress.phases().begin() + static_cast<ptrdiff_t>(before), progress.phases().end());
  for (const Progress::Phase& phase : run.phases) {
    run.seconds += phase.seconds;
    run.peak_memory_bytes = std::max(run.peak_memory_bytes, phase.usage.peak_memory_bytes);
  }
  return run;
}

void addRuns(const std::vector<Run>& runs, const ConversionReport& report, Measurements& to) {
  const std::string prefix = report.cold ? "conversion/cold/" : "conversion/warm/";
  std::vector<double> rates, peaks;
  std::vector<std::string> phases;
  std::map<std::string, std::vector<double>> seconds;  // by phase
  for (const Run& run : runs) {
    rates.push_back(static_cast<double>(report.nodes()) / run.seconds);
    peaks.push_back(static_cast<double>(run.peak_memory_bytes));
    for (const Progress::Phase& phase : run.phases) {
      if (!seconds.count(phase.name)) phases.push_back(phase.name);
      seconds[phase.name].push_back(phase.seconds);
    }
  }
  to.add(prefix + "rate", "nodes/s", std::move(rates));
  for (const std::string& phase : phases) to.add(prefix + "phase/" + phase, "s", seconds[phase]);
  if (report.peak_memory_bytes > 0)
    to.add(prefix + "peak_memory", "B", std::move(peaks));
  else
    to.leaveOut(prefix + "peak_memory", "the peak memory cannot be reset on this system");
  to.add(prefix + "temporary", "B", {static_cast<double>(report.last.temporary_bytes)});
  double cache_bytes = 0;
  for (const FileReport& file : report.last.files) cache_bytes += static_cast<double>(file.bytes);
  to.add(prefix + "cache", "B", {cache_bytes});
}

double perNode(const ConversionReport& report, uint64_t bytes) {
  return static_cast<double>(bytes) / static_cast<double>(report.nodes());
}

}  // namespace

SceneGridSize sizeOfGrid(uint64_t nodes) {
  const auto side = std::max<uint64_t>(8, std::llround(std::cbrt(static_cast<double>(nodes))));
  return {side, side, std::max<uint64_t>(8, (nodes + side * side / 2) / (side * side))};
}

uint64_t diskBytesFor(uint64_t nodes) {
  return nodes * kDiskBytesPerNode + kMinDiskBytes;
}

ConversionReport measureConversion(const ConversionEffort& effort, Measurements& to, Progress& progress) {
  ConversionReport report;
  report.size = sizeOfGrid(effort.nodes);
  checkSpace(effort.temporary_folder, report.nodes());
  const WorkFolder folder(effort.temporary_folder);
  const Plot3dOutputs written =
      writePlot3d(SceneGridSource(makeScene("wake"), report.size), folder / "grid", progress);

  OpenGridOptions grid;
  grid.grid = written.grid;
  grid.solutions = {written.function};
  const std::vector<fs::path> files{written.grid, written.function, written.names};
  grid.temporary_folder = effort.temporary_folder;
  ConvertOptions options;
  options.output = folder / "grid.splats";
  options.scalars = {0};
  options.keep_interrupted = false;
  options.memory_bytes = effort.memory_bytes;
  options.threads = effort.threads;
  std::vector<Run> runs;
  double spent_s = 0;
  report.cold = true;
  bool peaks = true;
  while (runs.empty() || (runs.size() < effort.max_runs && spent_s < effort.repeat_s)) {
    fs::remove_all(options.output);
    const auto source = openGrid(grid);
    if (const auto reason = dropPages(files)) {
      if (report.cold) to.leaveOut("conversion/cold", *reason);
      report.cold = false;
    }
    peaks = os::resetPeakMemory() && peaks;
    runs.push_back(convertOnce(*source, options, progress, report.last));
    spent_s += runs.back().seconds;
  }
  if (peaks)
    for (const Run& run : runs)
      report.peak_memory_bytes = std::max(report.peak_memory_bytes, run.peak_memory_bytes);
  addRuns(runs, report, to);
  std::sort(runs.begin(), runs.end(), [](const Run& a, const Run& b) { return a.seconds < b.seconds; });
  report.phases = std::move(runs[(runs.size() - 1) / 2].phases);
  return report;
}

std::string conversionTable(const ConversionReport& report) {
  TextTable table({"phase", "time", "share", "cores", "read/node", "written/node", "peak memory so far"});
  double all_s = 0;
  for (const Progress::Phase& phase : report.phases) all_s += phase.seconds;
  for (const Progress::Phase& phase : report.phases)
    table.add({phase.name, shortSeconds(phase.seconds), fmt::format("{:.0f} %", 100 * phase.seconds / all_s),
               fmt::format("{:.2f}", phase.usage.cpu_seconds / std::max(phase.seconds, 1e-9)),
               fmt::format("{:.1f} B", perNode(report, phase.usage.bytes_read)),
               fmt::format("{:.1f} B", perNode(report, phase.usage.bytes_written)),
               fmt::format("{} MiB", phase.usage.peak_memory_bytes >> 20)});
  return table.text();
}

std::string conversionSummary(const ConversionReport& report, const Measurements& measurements) {
  const std::string prefix = report.cold ? "conversion/cold/" : "conversion/warm/";
  const Measurement& rate = *measurements.find(prefix + "rate");
  std::string text = shortCount(medianOf(rate.samples)) + " nodes/s";
  if (rate.samples.size() > 1)
    text += fmt::format(", median of {} runs, spread {:.0f} %", rate.samples.size(),
                        100 * spreadOf(rate.samples));
  text += "\n";
  if (report.peak_memory_bytes > 0)
    text += fmt::format("peak memory {} MiB\n", report.peak_memory_bytes >> 20);
  return text + fmt::format("per node {:.2f} B of temporary disk space and {:.2f} B of cache\n",
                            perNode(report, report.last.temporary_bytes),
                            *measurements.median(prefix + "cache") / static_cast<double>(report.nodes()));
}

Plots conversionPlots(const ConversionReport& report) {
  BarPanel times{"Time", "seconds", {}, {}}, bytes{"Bytes per node", "bytes", {}, {"read", "written"}},
      memory{"Peak memory so far", "MiB", {}, {}};
  for (const Progress::Phase& phase : report.phases) {
    times.bars.push_back({phase.name, phase.seconds, shortSeconds(phase.seconds), 0});
    const double read = perNode(report, phase.usage.bytes_read);
    const double written = perNode(report, phase.usage.bytes_written);
    bytes.bars.push_back({phase.name, read, fmt::format("{:.1f}", read), 0});
    bytes.bars.push_back({"", written, fmt::format("{:.1f}", written), 1});
    const auto peak = static_cast<double>(phase.usage.peak_memory_bytes >> 20);
    memory.bars.push_back({phase.name, peak, fmt::format("{:.0f}", peak), 0});
  }
  return {{"conversion.png", drawPlot(std::vector{times, bytes, memory})}};
}

ConversionJson toJson(const ConversionReport& report) {
  ConversionJson json{{"scene", "wake"},
                      {"size", {report.size.ni, report.size.nj, report.size.nk}},
                      {"nodes", report.nodes()},
                      {"grid_files_cold", report.cold},
                      {"threads", report.last.threads},
                      {"memory_bytes", report.last.memory_bytes},
                      {"phases", ConversionJson::array()}};
  for (const Progress::Phase& phase : report.phases)
    json["phases"].push_back({{"name", phase.name},
                              {"seconds", phase.seconds},
                              {"cpu_seconds", phase.usage.cpu_seconds},
                              {"bytes_read", phase.usage.bytes_read},
                              {"bytes_written", phase.usage.bytes_written},
                              {"peak_memory_bytes", phase.usage.peak_memory_bytes}});
  return json;
}

}  // namespace curvisplat
