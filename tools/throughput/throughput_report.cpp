#include "tools/throughput/throughput_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>

#include "tools/throughput/disk_throughput.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/stage_throughput.h"

namespace curvisplat {
namespace {

struct DiskWay {
  DiskRun::Way way;
  const char* label;
};
constexpr DiskWay kDiskWays[] = {{DiskRun::Way::kDirect, "direct"},
                                 {DiskRun::Way::kDirectPread, "direct, pread"},
                                 {DiskRun::Way::kBufferedCold, "buffered, cold"},
                                 {DiskRun::Way::kBufferedWarm, "buffered, warm"}};
constexpr const char* kWorkerStages[] = {"verify", "decode", "project", "sort", "prepare"};
constexpr const char* kBackends[] = {"cpu", "osmesa", "egl-quads", "egl"};

std::string sizeText(double bytes) {
  return bytes >= 1 << 20 ? fmt::format("{:.0f} MiB", bytes / (1 << 20))
                          : fmt::format("{:.0f} KiB", bytes / (1 << 10));
}

double mebibytesOf(double bytes) {
  return bytes / (1 << 20);
}

std::string rateCell(std::optional<double> median) {
  return median ? fmt::format("{:.0f}", mebibytesOf(*median)) : "-";
}

std::string diskRows(const Measurements& measurements, const std::string& head, std::span<const DiskRun> runs,
                     const std::function<std::string(const DiskRun&)>& column) {
  std::vector<std::string> heads{head};
  for (const DiskRun& run : runs) heads.push_back(column(run));
  TextTable table(heads);
  for (const auto& [way, label] : kDiskWays) {
    std::vector<std::string> row{label};
    bool any = false;
    for (DiskRun run : runs) {
      run.way = way;
      const auto median = measurements.median(run.name());
      any |= median.has_value();
      row.push_back(rateCell(median));
    }
    if (any) table.add(row);
  }
  return table.empty() ? "" : table.text();
}

std::vector<DiskRun> byBlock() {
  std::vector<DiskRun> runs;
  for (const uint64_t block : kDiskBlocks) runs.push_back({DiskRun::Way::kDirect, block, kPagerDepth});
  return runs;
}
std::vector<DiskRun> byDepth() {
  std::vector<DiskRun> runs;
  for (const unsigned depth : kDiskDepths) runs.push_back({DiskRun::Way::kDirect, kPagerBlock, depth});
  return runs;
}

std::string splatRate(std::optional<double> rate) {
  return rate ? shortCount(*rate) + " splats/s" : "-";
}

std::string byteRate(std::optional<double> rate) {
  return rate ? shortBytes(*rate) + "/s" : "-";
}

/// A stage's row: its rate on one thread and on all threads, and the ratio.
std::vector<std::string> stageRow(const std::string& label, const Measurements& measurements,
                                  const std::string& one_name, const std::string& all_name,
                                  std::string (*cell)(std::optional<double>)) {
  const auto one = measurements.median(one_name), all = measurements.median(all_name);
  std::vector<std::string> row{label, cell(one)};
  if (one_name == all_name) return row;
  row.push_back(cell(all));
  if (one && all) row.push_back(fmt::format("{:.2f}", *all / *one));
  return row;
}

/// The row of a stage with its own threads; its rate goes to the column of all threads.
std::vector<std::string> ownRow(const std::string& label, const std::string& cell, unsigned threads) {
  return threads > 1 ? std::vector<std::string>{label, "", cell} : std::vector<std::string>{label, cell};
}

LinePanel diskPanel(const Measurements& measurements, std::span<const DiskRun> runs, bool over_blocks) {
  LinePanel panel;
  panel.title = over_blocks ? fmt::format("Disk by read size, {} reads in flight", kPagerDepth)
                            : fmt::format("Disk by reads in flight, {} each",
                                          sizeText(static_cast<double>(kPagerBlock)));
  panel.x_name = over_blocks ? "read size" : "reads in flight";
  panel.y_name = "MiB/s";
  panel.log_values = true;  // disk and memory differ by orders of magnitude
  panel.x_label = [over_blocks](double x) { return over_blocks ? sizeText(x) : fmt::format("{:g}", x); };
  for (const auto& [way, label] : kDiskWays) {
    PlotLine line{label, {}};
    for (DiskRun run : runs) {
      run.way = way;
      if (const auto median = measurements.median(run.name()))
        line.points.push_back(
            {over_blocks ? static_cast<double>(run.block_bytes) : run.depth, mebibytesOf(*median)});
    }
    if (!line.points.empty()) panel.lines.push_back(std::move(line));
  }
  return panel;
}

BarPanel stagePanel(const Measurements& measurements, unsigned threads) {
  BarPanel panel;
  panel.title = "Each stage in isolation";
  panel.x_name = "million splats per second";
  panel.kinds = {"1 thread"};
  if (threads > 1) panel.kinds.push_back(fmt::format("{} threads", threads));
  panel.kinds.push_back("own threads");
  const size_t own = panel.kinds.size() - 1;
  const auto add = [&](const std::string& name, const std::string& label, size_t colour) {
    const auto rate = measurements.median(name);
    if (rate) panel.bars.push_back({label, 1e-6 * *rate, shortCount(*rate), colour});
  };
  // Checksums are so much faster that their bar would make all others unreadable.
  for (const std::string stage : kWorkerStages) {
    if (stage == "verify") continue;
    add(stageName(stage, 1), stage, 0);
    if (threads > 1) add(stageName(stage, threads), stage, 1);
  }
  for (const std::string backend : kBackends) {
    add(stageName("draw/" + backend, 1), "draw, " + backend, 0);
    if (threads > 1) add(stageName("draw/" + backend, threads), "draw, " + backend, 1);
    add("stages/draw/" + backend, "draw, " + backend, own);
  }
  return panel;
}

std::vector<BarPanel> framePanels(std::span<const FramesOfConfiguration> frames) {
  BarPanel panel;
  panel.title = "Frames on an orbit";
  panel.x_name = "seconds";
  panel.kinds = {"later frames", "first frame, from disk"};
  for (const FramesOfConfiguration& one : frames) {
    const FrameConfiguration& with = one.configuration;
    const std::string label =
        fmt::format("{:g} px, {} thread{}, {:.0f} MiB", with.lod_pixels, with.threads,
                    with.threads > 1 ? "s" : "", mebibytesOf(static_cast<double>(with.memory_bytes)));
    const double seconds = medianFrame(one.warm).total_s;
    panel.bars.push_back({label, seconds, shortSeconds(seconds), 0});
    if (one.cold) panel.bars.push_back({"", one.cold->total_s, shortSeconds(one.cold->total_s), 1});
  }
  return {panel};
}

double readFraction(const FrameStatistics& frame) {
  const uint64_t bricks = frame.bricks_read + frame.bricks_cached;
  return bricks ? static_cast<double>(frame.bricks_read) / static_cast<double>(bricks) : 0;
}

/// Half the distance between the quartiles of the frames' times; a tenth of the time of a single frame.
double halfQuartiles(const std::vector<FrameStatistics>& frames) {
  std::vector<double> seconds;
  for (const FrameStatistics& frame : frames) seconds.push_back(frame.total_s);
  std::sort(seconds.begin(), seconds.end());
  if (seconds.size() < 2) return 0.1 * seconds.front();
  const size_t last = seconds.size() - 1;
  return 0.5 * (seconds[last - last / 4] - seconds[last / 4]);
}

}  // namespace

std::string diskTable(const Measurements& measurements) {
  const std::string blocks =
      diskRows(measurements, fmt::format("MiB/s, {} reads in flight", kPagerDepth), byBlock(),
               [](const DiskRun& run) { return sizeText(static_cast<double>(run.block_bytes)); });
  const std::string depths =
      diskRows(measurements, fmt::format("MiB/s, {} per read", sizeText(static_cast<double>(kPagerBlock))),
               byDepth(), [](const DiskRun& run) { return fmt::format("{} in flight", run.depth); });
  return blocks.empty() ? depths : depths.empty() ? blocks : blocks + "\n" + depths;
}

std::string stageTable(const Measurements& measurements, unsigned threads) {
  std::vector<std::string> heads{"stage", "1 thread"};
  if (threads > 1) heads.insert(heads.end(), {fmt::format("{} threads", threads), "speedup"});
  TextTable table(heads);
  if (const auto read = measurements.median("stages/read"))
    table.add(ownRow("read", byteRate(read), threads));
  const auto add = [&](const std::string& label, const std::string& stage) {
    const std::string one = stageName(stage, 1), all = stageName(stage, threads);
    if (!measurements.find(one)) return;
    table.add(stageRow(label, measurements, one, all, splatRate));
    if (!measurements.find(one + "/bytes")) return;
    auto bytes = stageRow("", measurements, one + "/bytes", all + "/bytes", byteRate);
    bytes.resize(std::min<size_t>(bytes.size(), 3));  // the speedup is the same
    table.add(bytes);
  };
  for (const std::string stage : kWorkerStages) add(stage, stage);
  for (const std::string backend : kBackends) {
    add("draw, " + backend, "draw/" + backend);
    if (const auto own = measurements.median("stages/draw/" + backend))
      table.add(ownRow("draw, " + backend, splatRate(own), threads));
  }
  return table.empty() ? "" : table.text();
}

std::string frameTable(std::span<const FramesOfConfiguration> frames, const Measurements& measurements) {
  TextTable table(
      {"error", "threads", "memory", "first", "later", "spread", "frames", "splats", "from disk"});
  for (const FramesOfConfiguration& one : frames) {
    const FrameStatistics& middle = medianFrame(one.warm);
    const Measurement& times = *measurements.find(one.configuration.name());
    table.add({fmt::format("{:g} px", one.configuration.lod_pixels),
               fmt::format("{}", one.configuration.threads),
               fmt::format("{:.0f} MiB", mebibytesOf(static_cast<double>(one.configuration.memory_bytes))),
               one.cold ? shortSeconds(one.cold->total_s) : "-", shortSeconds(medianOf(times.samples)),
               fmt::format("{:.0f} %", 100 * spreadOf(times.samples)), fmt::format("{}", one.warm.size()),
               shortCount(static_cast<double>(middle.splats_drawn)),
               fmt::format("{:.0f} %", 100 * readFraction(middle))});
  }
  return table.empty() ? "" : table.text();
}

std::string leftOutTable(const Measurements& measurements) {
  std::vector<std::string> reasons;
  std::map<std::string, std::vector<std::string>> names;  // by reason
  for (const auto& [name, reason] : measurements.leftOut()) {
    if (!names.count(reason)) reasons.push_back(reason);
    names[reason].push_back(name);
  }
  std::string text;
  for (const std::string& reason : reasons) {
    const auto& with = names[reason];
    text += with.size() == 1 ? fmt::format("{}: {}\n", with.front(), reason)
                             : fmt::format("{} and {} more: {}\n", with.front(), with.size() - 1, reason);
  }
  return text;
}

Plots throughputPlots(const Measurements& measurements, std::span<const FramesOfConfiguration> frames,
                      unsigned threads) {
  Plots plots;
  const std::vector<DiskRun> blocks = byBlock(), depths = byDepth();
  const std::vector<LinePanel> disk{diskPanel(measurements, blocks, true),
                                    diskPanel(measurements, depths, false)};
  if (!disk[0].lines.empty()) plots["disk.png"] = drawPlot(disk);
  const BarPanel stages = stagePanel(measurements, threads);
  if (!stages.bars.empty()) plots["stages.png"] = drawPlot(std::vector{stages});
  if (!frames.empty()) plots["frames.png"] = drawPlot(framePanels(frames));
  return plots;
}

std::optional<Verdict> verdictOf(const Measurements& measurements,
                                 std::span<const FramesOfConfiguration> frames, unsigned threads,
                                 bool draws_apart, const std::string& draw_stage) {
  const auto rate = [&](const std::string& stage) { return measurements.median(stageName(stage, threads)); };
  const auto verify = rate("verify"), decode = rate("decode"), project = rate("project"), sort = rate("sort");
  const auto draw = measurements.median(draw_stage);
  if (frames.empty() || !verify || !decode || !project || !sort || !draw) return std::nullopt;

  const FramesOfConfiguration* finest = nullptr;
  std::vector<OtherFrame> others;
  for (const FramesOfConfiguration& one : frames) {
    const FrameConfiguration& with = one.configuration;
    const FrameStatistics& middle = medianFrame(one.warm);
    others.push_back({middle.total_s, with.lod_pixels, with.threads, with.memory_bytes, middle.splats_read,
                      halfQuartiles(one.warm)});
    if (with.threads == threads && (!finest || with.lod_pixels < finest->configuration.lod_pixels))
      finest = &one;
  }
  if (!finest) return std::nullopt;
  const FrameStatistics& middle = medianFrame(finest->warm);
  const JudgedFrame judged{.seconds = middle.total_s,
                           .lod_pixels = finest->configuration.lod_pixels,
                           .threads = threads,
                           .memory_bytes = finest->configuration.memory_bytes,
                           .splats_prepared = middle.splats_read,
                           .splats_drawn = middle.splats_drawn,
                           .bytes = finest->bytes,
                           .read_fraction = readFraction(middle),
                           .draws_apart = draws_apart};
  double spread = 0;
  for (const std::string& name :
       {std::string("stages/read"), stageName("verify", threads), stageName("decode", threads),
        stageName("project", threads), stageName("sort", threads), draw_stage})
    if (const Measurement* const measured = measurements.find(name))
      spread = std::max(spread, spreadOf(measured->samples));
  const StageSpeeds speeds{
      measurements.median("stages/read"), *verify, *decode, *project, *sort, *draw, spread};
  return judge(judged, speeds, others);
}

}  // namespace curvisplat
