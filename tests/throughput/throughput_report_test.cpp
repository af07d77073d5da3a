// The report's tables have a row for all that was measured, on one thread or on several. Plots, by their
// pixels: bars are as long as their values, points are where they belong.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "render/annotate/plot.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tools/throughput/disk_throughput.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/stage_throughput.h"
#include "tools/throughput/throughput_report.h"

namespace curvisplat {
namespace {

void addStages(Measurements& measurements, unsigned threads) {
  measurements.add("stages/read", "B/s", {1.8e9});
  for (const char* stage : {"verify", "decode", "project", "sort", "prepare", "draw/cpu"}) {
    measurements.add(stageName(stage, 1), "splats/s", {1e6});
    if (threads > 1) measurements.add(stageName(stage, threads), "splats/s", {3e6});
  }
  measurements.add(stageName("decode", 1) + "/bytes", "B/s", {2e6});
  if (threads > 1) measurements.add(stageName("decode", threads) + "/bytes", "B/s", {6e6});
  measurements.add("stages/draw/osmesa", "splats/s", {5e5});
}

TEST(ThroughputReport, StagesOnSeveralThreads) {
  Measurements measurements;
  addStages(measurements, 4);
  EXPECT_EQ(stageTable(measurements, 4),
            "stage                1 thread        4 threads  speedup\n"
            "read                                 1.80 GB/s\n"
            "verify        1.00 M splats/s  3.00 M splats/s     3.00\n"
            "decode        1.00 M splats/s  3.00 M splats/s     3.00\n"
            "                    2.00 MB/s        6.00 MB/s\n"
            "project       1.00 M splats/s  3.00 M splats/s     3.00\n"
            "sort          1.00 M splats/s  3.00 M splats/s     3.00\n"
            "prepare       1.00 M splats/s  3.00 M splats/s     3.00\n"
            "draw, cpu     1.00 M splats/s  3.00 M splats/s     3.00\n"
            "draw, osmesa                    500 k splats/s\n");
}

TEST(ThroughputReport, StagesOnOneThread) {
  Measurements measurements;
  addStages(measurements, 1);
  const std::string table = stageTable(measurements, 1);
  EXPECT_TRUE(
      table.starts_with("stage                1 thread\n"
                        "read                1.80 GB/s\n"))
      << table;
  expectSays(table, "draw, osmesa   500 k splats/s\n");
  EXPECT_EQ(throughputPlots(measurements, {}, 1).count("stages.png"), 1u);
}

TEST(ThroughputReport, DiskRowsAndWhatIsMissing) {
  Measurements measurements;
  measurements.add("disk/direct/4KiB/depth:8", "B/s", {100 << 20});
  measurements.add("disk/direct/256KiB/depth:8", "B/s", {800 << 20});
  EXPECT_EQ(
      diskTable(measurements),
      "MiB/s, 8 reads in flight  4 KiB  64 KiB  256 KiB  1 MiB\n"
      "direct                      100       -      800      -\n"
      "\n"
      "MiB/s, 256 KiB per read  1 in flight  2 in flight  4 in flight  8 in flight  16 in flight  32 in "
      "flight\n"
      "direct                             -            -            -          800             -         "
      "    -\n");
}

TEST(ThroughputReport, ReasonsComeOnce) {
  Measurements measurements;
  measurements.leaveOut("a", "no disk");
  measurements.leaveOut("b", "no card");
  measurements.leaveOut("c", "no disk");
  EXPECT_EQ(leftOutTable(measurements), "a and 1 more: no disk\nb: no card\n");
}

TEST(ThroughputReport, OfNothingThereIsNothing) {
  const Measurements none;
  EXPECT_EQ(diskTable(none) + stageTable(none, 2) + frameTable({}, none) + leftOutTable(none), "");
  EXPECT_TRUE(throughputPlots(none, {}, 2).empty());
  EXPECT_FALSE(verdictOf(none, {}, 2, false, "stages/draw/cpu/threads:2"));
}

TEST(ThroughputReport, JudgesTheFinestFrameOnAllThreads) {
  Measurements measurements;
  addStages(measurements, 4);
  std::vector<FramesOfConfiguration> frames(3);
  frames[0].configuration = {4, 4, 512 << 20};
  frames[1].configuration = {1, 4, 512 << 20};
  frames[2].configuration = {0.5, 1, 512 << 20};  // not on all threads
  for (FramesOfConfiguration& one : frames) {
    FrameStatistics& frame = one.warm.emplace_back();
    frame.total_s = 0.25 / one.configuration.lod_pixels;
    frame.splats_read = frame.splats_drawn = static_cast<uint64_t>(3e5 / one.configuration.lod_pixels);
    frame.bricks_read = 1;
    frame.bricks_cached = 3;
    one.bytes = 18'000'000;
  }
  const auto verdict = verdictOf(measurements, frames, 4, false, stageName("draw/cpu", 4));
  ASSERT_TRUE(verdict);
  expectSays(verdict->lines[0], "0.25 s");
  ASSERT_GE(verdict->lines.size(), 2u);
  EXPECT_EQ(
      verdict->lines[verdict->lines.size() - 2],
      "the disk could sustain 100.0 such frames per second with nothing in memory; 25 % of this frame's "
      "bricks were read from it");
}

TEST(TextTable, AlignsColumns) {
  TextTable table({"stage", "rate", "x"});
  table.add({"a", "1.5 M", ""});
  table.add({"decode", "100 M", "2"});
  EXPECT_EQ(table.text(),
            "stage    rate  x\n"
            "a       1.5 M\n"
            "decode  100 M  2\n");
}

TEST(TextTable, CountsCharactersNotBytes) {
  TextTable table({"µ", "a"});
  table.add({"xx", "±1"});
  EXPECT_EQ(table.text(), "µ    a\nxx  ±1\n");
}

TEST(TextTable, RowsMayBeShort) {
  TextTable table({"a", "b", "c"});
  EXPECT_TRUE(table.empty());
  table.add({"1"});
  EXPECT_FALSE(table.empty());
  EXPECT_EQ(table.text(), "a  b  c\n1\n");
}

TEST(ShortNumbers, HaveThreeDigits) {
  EXPECT_EQ(shortCount(0), "0");
  EXPECT_EQ(shortCount(12), "12");
  EXPECT_EQ(shortCount(999), "999");
  EXPECT_EQ(shortCount(1234), "1.23 k");
  EXPECT_EQ(shortCount(17.26e6), "17.3 M");
  EXPECT_EQ(shortCount(512e6), "512 M");
  EXPECT_EQ(shortBytes(1.8e9), "1.80 GB");
  EXPECT_EQ(shortBytes(12), "12 B");
  EXPECT_EQ(shortSeconds(0.0123), "12.3 ms");
  EXPECT_EQ(shortSeconds(0.42), "0.42 s");
  EXPECT_EQ(shortSeconds(17.2), "17.2 s");
}

Image imageOf(const std::vector<std::byte>& png) {
  const TemporaryFolder folder;
  writeFileAtomically(folder / "plot.png", png);
  return readImage(folder / "plot.png");
}

struct Colour {
  float r, g, b;
  bool is(const float* pixel) const {
    return std::abs(pixel[0] - r) < 0.02f && std::abs(pixel[1] - g) < 0.02f && std::abs(pixel[2] - b) < 0.02f;
  }
};
constexpr int kBelowTheKey = 98;
constexpr Colour kFirst{0.00f, 0.45f, 0.70f}, kSecond{0.84f, 0.37f, 0.00f};

/// How many pixels of a colour there are in each row, below the key.
std::vector<int> rowsOf(const Image& image, const Colour& colour) {
  std::vector<int> rows(static_cast<size_t>(image.size.height));
  for (int y = kBelowTheKey; y < image.size.height; ++y)
    for (int x = 0; x < image.size.width; ++x) rows[static_cast<size_t>(y)] += colour.is(image.pixel(x, y));
  return rows;
}
std::vector<int> columnsOf(const Image& image, const Colour& colour) {
  std::vector<int> columns(static_cast<size_t>(image.size.width));
  for (int y = kBelowTheKey; y < image.size.height; ++y)
    for (int x = 0; x < image.size.width; ++x)
      columns[static_cast<size_t>(x)] += colour.is(image.pixel(x, y));
  return columns;
}
/// The middles of the runs of numbers of at least `least`.
std::vector<double> middlesOf(const std::vector<int>& numbers, int least) {
  std::vector<double> middles;
  for (size_t n = 0; n < numbers.size(); ++n) {
    if (numbers[n] < least) continue;
    const size_t begin = n;
    while (n < numbers.size() && numbers[n] >= least) ++n;
    middles.push_back(0.5 * static_cast<double>(begin + n - 1));
  }
  return middles;
}

TEST(BarPlot, BarsAreAsLongAsTheirValues) {
  const BarPanel panel{"Title", "seconds", {{"one", 1, "1 s", 0}, {"three", 3, "3 s", 0}}, {}};
  const Image image = imageOf(drawPlot(std::vector{panel}));
  const std::vector<int> rows = rowsOf(image, kFirst);
  std::vector<int> lengths;
  for (const double middle : middlesOf(rows, 1)) lengths.push_back(rows[static_cast<size_t>(middle)]);
  ASSERT_EQ(lengths.size(), 2u);
  EXPECT_NEAR(lengths[1], 3.0 * lengths[0], 4);
  EXPECT_GT(lengths[0], 50);
}

TEST(BarPlot, OfNothingButZerosIsAPlot) {
  const BarPanel panel{"Title", "seconds", {{"none", 0, "0 s", 0}}, {}};
  EXPECT_GT(imageOf(drawPlot(std::vector{panel})).size.width, 100);
}

LinePanel panelOf(std::vector<PlotLine> lines, bool log_values) {
  return {"Title",   "size", "MiB/s", std::move(lines), [](double x) { return fmt::format("{:g}", x); },
          log_values};
}

TEST(LinePlot, PointsStandAtEqualRatios) {
  const Image image = imageOf(
      drawPlot(std::vector{panelOf({{"flat", {{4, 10}, {16, 10}, {64, 10}}}, {"other", {{4, 1}}}}, false)}));
  const std::vector<double> dots = middlesOf(columnsOf(image, kFirst), 8);  // the line is thinner
  ASSERT_EQ(dots.size(), 3u);
  EXPECT_NEAR(dots[1] - dots[0], dots[2] - dots[1], 2);
  EXPECT_GT(dots[1] - dots[0], 100);
}

TEST(LinePlot, ValuesStandWhereTheyBelong) {
  const auto heightsOf = [](double value, bool log_values) {
    const LinePanel panel =
        panelOf({{"flat", {{1, value}, {2, value}}}, {"ends", {{1, 1}, {2, 100}}}}, log_values);
    const Image image = imageOf(drawPlot(std::vector{panel}));
    const std::vector<double> level = middlesOf(rowsOf(image, kFirst), 300);
    const std::vector<int> ends = rowsOf(image, kSecond);
    const auto top = std::find_if(ends.begin(), ends.end(), [](int n) { return n > 0; }) - ends.begin();
    const auto bottom =
        ends.rend() - std::find_if(ends.rbegin(), ends.rend(), [](int n) { return n > 0; }) - 1;
    EXPECT_EQ(level.size(), 1u);
    return (static_cast<double>(bottom) - level.at(0)) / static_cast<double>(bottom - top);
  };
  EXPECT_NEAR(heightsOf(10, true), 0.5, 0.02);
  EXPECT_NEAR(heightsOf(50.5, false), 0.5, 0.02);
}

TEST(LinePlot, DrawsOnePointWithoutALine) {
  const LinePanel panel{
      "Title", "size", "MiB/s", {{"only", {{4, 0}}}}, [](double) { return std::string("4"); }};
  const Image image = imageOf(drawPlot(std::vector{panel}));
  EXPECT_EQ(middlesOf(rowsOf(image, kFirst), 1).size(), 1u);
}

TEST(Plots, PanelsStandSideBySide) {
  const BarPanel panel{"Title", "seconds", {{"a", 1, "1 s", 0}}, {"first", "second"}};
  const Image one = imageOf(drawPlot(std::vector{panel}));
  const Image two = imageOf(drawPlot(std::vector{panel, panel}));
  EXPECT_EQ(two.size.width, 2 * one.size.width);
  EXPECT_EQ(two.size.height, one.size.height);
}

}  // namespace
}  // namespace curvisplat
