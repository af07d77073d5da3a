// Measurements as numbers, and the verdict: its words follow from the numbers, and turn when those do.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <limits>

#include "tools/throughput/machine.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/verdict.h"

namespace curvisplat {
namespace {

TEST(Measurements, MedianIsTheMiddleSampleOrTheMeanOfTwo) {
  EXPECT_EQ(medianOf({7}), 7);
  EXPECT_EQ(medianOf({9, 1, 4}), 4);
  EXPECT_EQ(medianOf({8, 1, 4, 2}), 3);
}

TEST(Machine, SaysBeforehandWhenOthersUseIt) {
  Machine machine;
  machine.cores = 4;
  EXPECT_EQ(machine.busyNote(), "") << "the load is not known";
  for (const double load : {0.0, 0.3, 1.0}) {
    machine.load = load;
    EXPECT_EQ(machine.busyNote(), "") << load;
  }
  machine.load = 2.5;
  EXPECT_EQ(machine.busyNote(),
            "the machine is busy (load 2.5 in the last minute, 4 cores): these figures will be wrong; end "
            "other programs or wait, and measure again");
  EXPECT_EQ(machine.toJson()["load"], 2.5);
  const Machine here = Machine::here(".");
  ASSERT_TRUE(here.load);
  EXPECT_GE(*here.load, 0);
}

TEST(Measurements, SpreadIsHalfTheRangeOverTheMedian) {
  EXPECT_EQ(spreadOf({5}), 0);
  EXPECT_DOUBLE_EQ(spreadOf({9, 10, 13}), 0.2);
  EXPECT_EQ(spreadOf({0, 0}), 0);
}

TEST(Measurements, KnowsWhatIsBetter) {
  EXPECT_TRUE((Measurement{"a", "splats/s", {1}}).moreIsBetter());
  EXPECT_TRUE((Measurement{"a", "B/s", {1}}).moreIsBetter());
  EXPECT_FALSE((Measurement{"a", "s", {1}}).moreIsBetter());
  EXPECT_FALSE((Measurement{"a", "B", {1}}).moreIsBetter());
}

TEST(Measurements, AreFoundByName) {
  Measurements measurements;
  measurements.add("a/b:1", "s", {3, 1, 2});
  EXPECT_EQ(measurements.median("a/b:1"), 2);
  EXPECT_EQ(measurements.median("a/b:2"), std::nullopt);
  ASSERT_NE(measurements.find("a/b:1"), nullptr);
  EXPECT_EQ(measurements.find("a/b:1")->samples, (std::vector<double>{3, 1, 2}));
}

TEST(Measurements, AsJsonKeepEverySampleAndEveryReason) {
  Measurements measurements;
  measurements.add("disk/direct", "B/s", {3, 1, 2});
  measurements.leaveOut("disk/cold", "tmpfs has no disk");
  EXPECT_EQ(measurements.toJson().dump(),
            R"([{"name":"disk/direct","unit":"B/s","better":"more","median":2.0,"samples":[3.0,1.0,2.0]}])");
  EXPECT_EQ(measurements.leftOutAsJson().dump(), R"([{"name":"disk/cold","reason":"tmpfs has no disk"}])");
}

TEST(MeasurementsDeath, ANameComesOnceAndSamplesAreNumbers) {
  Measurements measurements;
  measurements.add("a", "s", {1});
  EXPECT_DEATH(measurements.add("a", "s", {1}), "internal error");
  EXPECT_DEATH(measurements.add("b", "s", {}), "internal error");
  EXPECT_DEATH(measurements.add("b", "s", {std::numeric_limits<double>::infinity()}), "internal error");
}

constexpr uint64_t kMebibyte = 1 << 20;

/// 1 M splats, half a second: 0.02 + 0.02 s decoded (nothing, in memory), 0.05 projected, 0.02 sorted, 0.4
/// drawn.
JudgedFrame frame() {
  return {.seconds = 0.5,
          .lod_pixels = 1,
          .threads = 2,
          .memory_bytes = 512 * kMebibyte,
          .splats_prepared = 1'000'000,
          .splats_drawn = 1'000'000,
          .bytes = 8'000'000,
          .read_fraction = 0,
          .draws_apart = false};
}
StageSpeeds speeds() {
  return {.read_bytes_s = 1e9,
          .verify_splats_s = 50e6,
          .decode_splats_s = 50e6,
          .project_splats_s = 20e6,
          .sort_splats_s = 50e6,
          .draw_splats_s = 2.5e6};
}

bool says(const Verdict& verdict, const std::string& words) {
  for (const std::string& line : verdict.lines)
    if (line.find(words) != std::string::npos) return true;
  return false;
}
std::string all(const Verdict& verdict) {
  return fmt::format("{}", fmt::join(verdict.lines, "\n"));
}

TEST(Verdict, DrawingOnTheCoresBounds) {
  const Verdict verdict = judge(frame(), speeds(), {});
  EXPECT_EQ(verdict.stage, "drawing");
  EXPECT_NEAR(verdict.share, 0.4 / 0.47, 1e-9);
  EXPECT_TRUE(
      verdict.lines[0].starts_with("drawing bounds the frame: 85 % of the work on the cores in 0.50 s"))
      << all(verdict);
  EXPECT_TRUE(
      says(verdict, "a graphics card would draw instead of the cores; their remaining work takes 70.0 ms"))
      << all(verdict);
  EXPECT_EQ(verdict.lines.back(),
            "to draw this faster, buy a graphics card; a faster disk would change little");
  // 8 MB a frame at 1 GB/s.
  EXPECT_TRUE(says(verdict, "the disk could sustain 125.0 such frames per second")) << all(verdict);
}

TEST(Verdict, DecodingBoundsWhereBricksAreReadEachTime) {
  JudgedFrame judged = frame();
  judged.read_fraction = 1;
  StageSpeeds slow = speeds();
  slow.decode_splats_s = 2e6;  // 0.5 s
  slow.draw_splats_s = 20e6;
  judged.seconds = 0.7;
  const Verdict verdict = judge(judged, slow, {});
  EXPECT_EQ(verdict.stage, "decoding");
  EXPECT_TRUE(says(verdict, "100 % of this frame's bricks were read from it")) << all(verdict);
  EXPECT_FALSE(says(verdict, "graphics card")) << all(verdict);
  // What is in memory is not decoded.
  judged.read_fraction = 0;
  EXPECT_NE(judge(judged, slow, {}).stage, "decoding");
}

/// A coarser picture is advised only where it is measured to be faster.
TEST(Verdict, AGainWithinTheSpreadIsNone) {
  const JudgedFrame judged = frame();
  OtherFrame same{judged.seconds, judged.lod_pixels, judged.threads, judged.memory_bytes, 1000, 0.1};
  OtherFrame coarser = same;
  coarser.lod_pixels = 2 * judged.lod_pixels;
  coarser.seconds = 0.7 * judged.seconds;
  const auto advised = [&] {
    return says(judge(judged, speeds(), std::array{same, coarser}),
                fmt::format("--lod-pixels {:g} takes", coarser.lod_pixels));
  };
  EXPECT_FALSE(advised());
  same.spread_s = coarser.spread_s = 0.01;
  EXPECT_TRUE(advised());
  coarser.splats_prepared = judged.splats_prepared;  // no coarser in truth
  EXPECT_FALSE(advised());
}

TEST(Verdict, ReadingBoundsWithASlowDisk) {
  JudgedFrame judged = frame();
  judged.read_fraction = 1;
  judged.seconds = 9;
  StageSpeeds slow = speeds();
  slow.read_bytes_s = 1e6;  // 8 s
  const Verdict verdict = judge(judged, slow, {});
  EXPECT_EQ(verdict.stage, "reading");
  EXPECT_TRUE(says(verdict, "reading bounds the frame: in isolation it takes 8.00 s of 9.00 s"))
      << all(verdict);
  EXPECT_TRUE(says(verdict, "to draw this faster, buy a faster disk")) << all(verdict);
  EXPECT_TRUE(says(verdict, "could sustain 0.1 such frames")) << all(verdict);
}

TEST(Verdict, ACardThatDrawsIsNotAdvised) {
  JudgedFrame judged = frame();
  judged.draws_apart = true;
  EXPECT_EQ(judge(judged, speeds(), {}).stage, "drawing");
  EXPECT_FALSE(says(judge(judged, speeds(), {}), "graphics card would"));
  EXPECT_EQ(judge(judged, speeds(), {}).lines.back(),
            "to draw this faster, buy a faster graphics card; a faster disk would change little");
  StageSpeeds fast = speeds();
  fast.draw_splats_s = 1e9;
  EXPECT_EQ(judge(judged, fast, {}).stage, "projecting");
  EXPECT_FALSE(says(judge(judged, fast, {}), "graphics card"));
}

TEST(Verdict, CoarserErrorsAreAdvisedByWhatTheyGave) {
  const OtherFrame others[] = {{0.5, 1, 2, 512 * kMebibyte, 1'000'000},
                               {0.2, 2, 2, 512 * kMebibyte, 250'000},
                               {0.49, 4, 2, 512 * kMebibyte, 900'000},  // within the noise
                               {0.1, 8, 1, 512 * kMebibyte, 100'000}};  // other threads
  const Verdict verdict = judge(frame(), speeds(), others);
  EXPECT_TRUE(says(verdict, "--lod-pixels 2 takes 0.20 s, 2.5 times as fast (4.0x fewer splats)"))
      << all(verdict);
  EXPECT_FALSE(says(verdict, "--lod-pixels 4")) << all(verdict);
  EXPECT_FALSE(says(verdict, "--lod-pixels 8")) << all(verdict);
}

TEST(Verdict, CoresAreAdvisedByWhatTheyGave) {
  JudgedFrame four = frame();
  four.threads = 4;
  OtherFrame others[] = {{0.2, 2, 4, 512 * kMebibyte, 250'000}, {0.6, 2, 1, 512 * kMebibyte, 250'000}};
  EXPECT_TRUE(
      says(judge(four, speeds(), others),
           "--threads 4 draws --lod-pixels 2 3.0 times as fast as --threads 1: more cores would help"));
  others[1].seconds = 0.5;
  EXPECT_TRUE(
      says(judge(four, speeds(), others), "2.5 times as fast as --threads 1: more cores would help little"));
  others[1].memory_bytes = 128 * kMebibyte;  // no longer the same but for threads
  EXPECT_FALSE(says(judge(four, speeds(), others), "more cores"));
  const OtherFrame two[] = {{0.2, 2, 2, 512 * kMebibyte, 250'000}, {0.38, 2, 1, 512 * kMebibyte, 250'000}};
  EXPECT_TRUE(says(judge(frame(), speeds(), two), "1.9 times as fast as --threads 1: more cores would help"));
}

TEST(Verdict, MemoryIsAdvisedByWhatItGave) {
  OtherFrame others[] = {{0.2, 2, 2, 512 * kMebibyte, 250'000}, {0.1, 2, 2, 2048 * kMebibyte, 250'000}};
  EXPECT_TRUE(
      says(judge(frame(), speeds(), others), "--memory 2048M would help: --lod-pixels 2 takes 0.10 s"));
  others[1].seconds = 0.195;
  EXPECT_TRUE(says(judge(frame(), speeds(), others), "more than --memory 512M would not help"));
  others[1].memory_bytes = 128 * kMebibyte;
  EXPECT_FALSE(says(judge(frame(), speeds(), others), "--memory"));
}

TEST(Verdict, ADifferenceWithinTheSpreadIsNone) {
  OtherFrame others[] = {{0.2, 2, 2, 512 * kMebibyte, 250'000, 0.06},
                         {0.1, 2, 2, 2048 * kMebibyte, 250'000, 0.05}};
  const Verdict same = judge(frame(), speeds(), others);
  EXPECT_TRUE(says(same, "--memory 2048M instead of 512M: no difference measured")) << all(same);
  EXPECT_FALSE(says(same, "would help")) << all(same);
  others[0].spread_s = 0.02;
  EXPECT_TRUE(says(judge(frame(), speeds(), others), "--memory 2048M would help"));

  JudgedFrame four = frame();
  four.threads = 4;
  const OtherFrame cores[] = {{0.2, 2, 4, 512 * kMebibyte, 250'000, 0.1},
                              {0.3, 2, 1, 512 * kMebibyte, 250'000, 0.1}};
  EXPECT_TRUE(says(judge(four, speeds(), cores), "--threads 4 instead of 1: no difference measured"));
}

/// Reading 0.44 s, the cores 0.47 s: which of them bounds the frame is not known if the rates vary by a tenth.
TEST(Verdict, OfTwoResourcesWithinTheSpreadNoneIsBlamed) {
  JudgedFrame judged = frame();
  judged.read_fraction = 1;
  StageSpeeds noisy = speeds();
  noisy.verify_splats_s = noisy.decode_splats_s = 1e12;
  noisy.read_bytes_s = 8e6 / 0.44;
  EXPECT_EQ(judge(judged, noisy, {}).lines.back(), "to draw this faster, buy a graphics card");
  noisy.spread = 0.1;
  const Verdict verdict = judge(judged, noisy, {});
  EXPECT_TRUE(says(verdict, "the work on the cores (0.47 s) and reading (0.44 s): no difference measured"))
      << all(verdict);
  EXPECT_TRUE(verdict.lines.back().starts_with("nothing that could be bought alone is sure to draw this"))
      << all(verdict);
  EXPECT_FALSE(says(verdict, "buy ")) << all(verdict);
  noisy.read_bytes_s = 8e6 / 0.2;  // far from it
  EXPECT_EQ(judge(judged, noisy, {}).lines.back(),
            "to draw this faster, buy a graphics card; a faster disk would change little");
}

TEST(Verdict, ReportsTimeThatNoStageTakes) {
  JudgedFrame judged = frame();
  EXPECT_FALSE(says(judge(judged, speeds(), {}), "overhead"));
  judged.seconds = 0.94;  // twice the stages' 0.47
  EXPECT_TRUE(says(judge(judged, speeds(), {}), "50 % of the frame is overhead"));
}

TEST(Verdict, DoesNotJudgeADiskThatWasNotMeasured) {
  StageSpeeds unknown = speeds();
  unknown.read_bytes_s = std::nullopt;
  EXPECT_FALSE(says(judge(frame(), unknown, {}), "the disk"));
}

}  // namespace
}  // namespace curvisplat
