#include <gtest/gtest.h>
#include <signal.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <random>

#include "render/camera/camera_path.h"
#include "stream/base/error.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"
#include "tools/throughput/conversion_throughput.h"
#include "tools/throughput/frame_throughput.h"
#include "tools/throughput/stage_throughput.h"
#include "tools/throughput/throughput_report.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMiB = 1 << 20, kGiB = 1 << 30;

TEST(FrameConfigurations, VaryOneThingAtATime) {
  const double errors[] = {1, 2, 4};
  const auto all = frameConfigurations(errors, 4, 512 * kMiB, 64 * kGiB);
  std::vector<std::string> names;
  for (const auto& one : all) names.push_back(one.name());
  EXPECT_EQ(names, (std::vector<std::string>{
                       "frames/lod:4/threads:4/memory:512MiB", "frames/lod:2/threads:4/memory:512MiB",
                       "frames/lod:1/threads:4/memory:512MiB", "frames/lod:2/threads:1/memory:512MiB",
                       "frames/lod:2/threads:2/memory:512MiB", "frames/lod:2/threads:4/memory:128MiB",
                       "frames/lod:2/threads:4/memory:2048MiB"}));
}

TEST(FrameConfigurations, DoNotTakeMostOfTheMemoryNorRepeat) {
  const double errors[] = {1};
  EXPECT_EQ(frameConfigurations(errors, 1, 512 * kMiB, 3 * kGiB).size(), 2u);  // and a quarter of the memory
}

TEST(FrameThroughput, MedianFrameIsOneOfThem) {
  std::vector<FrameStatistics> frames(4);
  for (size_t n = 0; n < frames.size(); ++n) frames[n].total_s = std::array{5.0, 1.0, 3.0, 9.0}[n];
  EXPECT_EQ(medianFrame(frames).total_s, 3);
}

class ThroughputOfACache : public testing::Test {
 protected:
  ThroughputOfACache() {
    writeLatticeCache(path_, 0.2, {0.01, 0.01, 0.01});
    cache_ = std::make_unique<CacheReader>(path_);
    const VariableInfo& info = cache_->manifest().variables[0];
    function_ = TransferFunction::preset("viridis", info.min, info.max, 1);
  }

  ThroughputScene scene() const {
    FrameOptions options;
    options.size = {60, 60};
    options.lod_pixels = 0;
    options.threads = 2;
    options.memory_bytes = 256 * kMiB;
    const auto orbit = [this](unsigned frames) {
      const Manifest& manifest = cache_->manifest();
      const Camera first =
          Camera::named("iso", manifest.lower, manifest.upper, {60, 60}, Projection::kOrthographic);
      std::vector<Camera> cameras;
      for (unsigned n = 0; n < frames; ++n) cameras.push_back(orbited(first, 360.0 * n / frames));
      return cameras;
    };
    return {*cache_, 0, *function_, options, Backend::kCpu, orbit};
  }

  const TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "a.splats";
  std::unique_ptr<CacheReader> cache_;
  std::optional<TransferFunction> function_;
};

TEST_F(ThroughputOfACache, FramesAreDrawnAndCounted) {
  const FrameConfiguration configurations[] = {{0, 2, 256 * kMiB}, {0, 1, 256 * kMiB}};
  Measurements measurements;
  Progress progress;
  const auto frames =
      measureFrames(scene(), configurations, {.configuration_s = 1e9, .total_s = 1e9, .max_frames = 3},
                    measurements, progress);
  ASSERT_EQ(frames.size(), 2u);
  for (size_t n = 0; n < 2; ++n) {
    EXPECT_EQ(frames[n].configuration, configurations[n]);
    EXPECT_EQ(frames[n].warm.size(), 3u);
    for (const FrameStatistics& frame : frames[n].warm) {
      EXPECT_EQ(frame.splats_read, 32u * 32 * 32);
      EXPECT_EQ(frame.bricks_read, 0u) << "what the first frame has read is in memory";
    }
    uint64_t bytes = 0;
    for (uint32_t brick = 0; brick < cache_->bricks().size(); ++brick)
      if (cache_->bricks()[brick].isLeaf())
        bytes += cache_->bricks()[brick].geometry.length + cache_->brickVariables(0)[brick].values.length;
    EXPECT_EQ(frames[n].bytes, bytes);
    EXPECT_EQ(measurements.find(configurations[n].name())->samples.size(), 3u);
  }
  const auto json = toJson(frames);
  EXPECT_EQ(json.size(), 2u);
  EXPECT_EQ(json[0]["median"]["splats_read"], 32 * 32 * 32);
}

TEST_F(ThroughputOfACache, FramesThatDoNotFitAreLeftOutWithTheReason) {
  const FrameConfiguration configurations[] = {{0, 2, 1 * kMiB}};
  Measurements measurements;
  Progress progress;
  EXPECT_TRUE(measureFrames(scene(), configurations, {}, measurements, progress).empty());
  ASSERT_EQ(measurements.leftOut().size(), 1u);
  expectSays(measurements.leftOut()[0].reason, "--memory");

  Measurements late;
  const FrameConfiguration one[] = {{0, 2, 256 * kMiB}};
  EXPECT_TRUE(measureFrames(scene(), one, {.total_s = 0}, late, progress).empty());
  EXPECT_EQ(late.leftOut().size(), 1u);
}

TEST_F(ThroughputOfACache, EveryStageIsMeasuredOrLeftOut) {
  Measurements measurements;
  Progress progress;
  const StageEffort little{.sample_s = 0, .samples = 2, .max_splats = 5000, .max_read_bytes = 1 << 20};
  const StageReport report = measureStages(scene(), 2, little, measurements, progress);
  EXPECT_EQ(report.frame_splats, 32u * 32 * 32);
  EXPECT_GE(report.sampled_splats, 5000u);
  EXPECT_LT(report.sampled_splats, report.frame_splats);
  for (const char* stage : {"verify", "decode", "project", "sort", "prepare", "draw/cpu"})
    for (const unsigned threads : {1u, 2u}) {
      const Measurement* const found = measurements.find(stageName(stage, threads));
      ASSERT_NE(found, nullptr) << stage;
      EXPECT_EQ(found->unit, "splats/s");
      EXPECT_EQ(found->samples.size(), 2u);
    }
  std::string left_out;
  for (const auto& one : measurements.leftOut()) left_out += one.name + " ";
  for (const std::string name :
       {"stages/read", "stages/draw/osmesa", "stages/draw/egl", "stages/draw/egl-quads"})
    EXPECT_TRUE(measurements.find(name) || left_out.find(name) != std::string::npos) << name;
  EXPECT_EQ(report.backends.size(), 4u);
}

TEST_F(ThroughputOfACache, AnEmptyPictureIsReported) {
  const VariableInfo& info = cache_->manifest().variables[0];
  function_ = TransferFunction::preset("viridis", info.max + 100, info.max + 101, 1);
  Measurements measurements;
  Progress progress;
  measureStages(scene(), 1, {.sample_s = 0, .samples = 1}, measurements, progress);
  EXPECT_TRUE(measurements.all().empty());
  expectSays(leftOutTable(measurements), "transparent");
}

struct Bricks {
  explicit Bricks(size_t count, uint32_t least, uint32_t most) {
    std::mt19937 random(1);
    for (size_t n = 0; n < count; ++n) {
      bricks.emplace_back().splats = least + static_cast<uint32_t>(random() % (most - least + 1));
      parts.push_back({static_cast<uint32_t>(n)});
      splats += bricks.back().splats;
    }
  }
  std::vector<Brick> bricks;
  std::vector<BrickPart> parts;
  uint64_t splats = 0;
};

TEST(BrickSample, IsAllOfASmallFrame) {
  const Bricks frame(10, 5, 9);
  const BrickSample sample = sampleOf(frame.parts, frame.bricks, frame.splats);
  EXPECT_EQ(sample.parts, frame.parts);
  EXPECT_EQ(sample.splats, frame.splats);
  EXPECT_TRUE(sampleOf({}, {}, 100).parts.empty());
}

TEST(BrickSample, IsAFewRunsSpreadOverALargeOne) {
  const Bricks frame(5000, 500, 1500);
  constexpr uint64_t kWanted = 400'000;
  const BrickSample sample = sampleOf(frame.parts, frame.bricks, kWanted, 8);
  uint64_t splats = 0;
  size_t runs = 0;
  for (size_t n = 0; n < sample.parts.size(); ++n) {
    splats += frame.bricks[sample.parts[n].brick].splats;
    if (n == 0 || sample.parts[n].brick != sample.parts[n - 1].brick + 1) ++runs;
    if (n > 0) {
      EXPECT_GT(sample.parts[n].brick, sample.parts[n - 1].brick);
    }
  }
  EXPECT_EQ(sample.splats, splats);
  EXPECT_EQ(runs, 8u);
  // Each run may go over its share by one brick.
  EXPECT_GE(splats, kWanted);
  EXPECT_LE(splats, kWanted + 8 * 1500);
  // One run an eighth of the frame.
  for (size_t eighth = 0; eighth < 8; ++eighth)
    EXPECT_TRUE(std::any_of(sample.parts.begin(), sample.parts.end(), [&](const BrickPart& part) {
      return part.brick >= eighth * 600 && part.brick < (eighth + 1) * 640;
    })) << eighth;
}

TEST(BrickSample, HasOnePartAtLeast) {
  const Bricks frame(3, 1000, 1000);
  const BrickSample sample = sampleOf(frame.parts, frame.bricks, 10);
  ASSERT_GE(sample.parts.size(), 1u);
  EXPECT_EQ(sample.parts.front().brick, 0u);
}

TEST(BrickSample, CountsTheOctantsThatAreDrawn) {
  Bricks frame(1, 80, 80);
  frame.bricks[0].octant_splats.fill(10);
  frame.parts[0].octants = 0b101;
  EXPECT_EQ(sampleOf(frame.parts, frame.bricks, 1000).splats, 20u);
}

TEST(ConversionThroughput, GridsHaveAboutAsManyNodesAsAskedFor) {
  for (const uint64_t nodes : {1000ull, 5000ull, 200'000ull, 8'000'000ull, 100'000'000'000ull}) {
    const SceneGridSize size = sizeOfGrid(nodes);
    EXPECT_NEAR(static_cast<double>(size.ni * size.nj * size.nk) / static_cast<double>(nodes), 1, 0.05)
        << nodes;
    EXPECT_EQ(size.ni, size.nj);
  }
  EXPECT_EQ(sizeOfGrid(1).nk, 8u);
}

TEST(ConversionThroughput, MeasuresEveryPhaseAndLeavesNothing) {
  const TemporaryFolder folder;
  Measurements measurements;
  Progress progress;
  const ConversionEffort effort{
      .nodes = 20'000, .threads = 2, .temporary_folder = folder.path(), .repeat_s = 1e9, .max_runs = 2};
  const ConversionReport report = measureConversion(effort, measurements, progress);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  EXPECT_EQ(report.last.nodes, report.nodes());
  const std::string prefix = report.cold ? "conversion/cold/" : "conversion/warm/";
  ASSERT_NE(measurements.find(prefix + "rate"), nullptr);
  EXPECT_EQ(measurements.find(prefix + "rate")->samples.size(), 2u);
  for (const char* phase : {"scan", "scatter", "build"})
    EXPECT_NE(measurements.find(prefix + "phase/" + phase), nullptr) << phase;
  ASSERT_FALSE(report.phases.empty());
  const std::string table = conversionTable(report);
  for (const Progress::Phase& phase : report.phases) expectSays(table, "\n" + phase.name);
  expectSays(conversionSummary(report, measurements), "nodes/s, median of 2 runs");
  EXPECT_EQ(toJson(report)["phases"].size(), report.phases.size());
  EXPECT_EQ(conversionPlots(report).count("conversion.png"), 1u);
}

TEST(ConversionThroughput, LeavesNothingWhenItIsStopped) {
  const TemporaryFolder folder;
  Measurements measurements;
  Progress progress;
  progress.stop(SIGINT);
  EXPECT_THROW(
      measureConversion({.nodes = 20'000, .temporary_folder = folder.path()}, measurements, progress),
      Interrupted);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(ConversionThroughput, ChecksFreeSpaceBeforeAnyWork) {
  const TemporaryFolder folder;
  Measurements measurements;
  Progress progress;
  expectError(
      [&] {
        measureConversion({.nodes = uint64_t{1} << 50, .temporary_folder = folder.path()}, measurements,
                          progress);
      },
      {"MiB free", "--nodes"});
  EXPECT_TRUE(progress.phases().empty());
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace curvisplat
