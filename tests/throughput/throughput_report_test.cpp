// The tables have a row for all that was measured, on one thread or on several.
#include "tools/throughput/throughput_report.h"

#include <gtest/gtest.h>

#include "tools/throughput/disk_throughput.h"
#include "tools/throughput/stage_throughput.h"

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
  EXPECT_NE(table.find("draw, osmesa   500 k splats/s\n"), std::string::npos) << table;
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
  EXPECT_NE(verdict->lines[0].find("0.25 s"), std::string::npos) << verdict->lines[0];
  ASSERT_GE(verdict->lines.size(), 2u);
  EXPECT_EQ(
      verdict->lines[verdict->lines.size() - 2],
      "the disk could sustain 100.0 such frames per second with nothing in memory; 25 % of this frame's "
      "bricks were read from it");
}

}  // namespace
}  // namespace curvisplat
