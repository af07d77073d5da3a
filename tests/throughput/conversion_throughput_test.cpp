#include "tools/throughput/conversion_throughput.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>

#include "stream/base/error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

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
  for (const Progress::Phase& phase : report.phases)
    EXPECT_NE(table.find("\n" + phase.name), std::string::npos) << table;
  EXPECT_NE(conversionSummary(report, measurements).find("nodes/s, median of 2 runs"), std::string::npos);
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
  try {
    measureConversion({.nodes = uint64_t{1} << 50, .temporary_folder = folder.path()}, measurements,
                      progress);
    FAIL() << "a petabyte is free here";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("MiB free"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("--nodes"), std::string::npos) << error.what();
  }
  EXPECT_TRUE(progress.phases().empty());
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace curvisplat
