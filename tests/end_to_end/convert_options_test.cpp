// The convert subcommand, option by option, on the real program.
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class ConvertOptionsTest : public testing::Test {
 protected:
  void SetUp() override {
    Progress progress;
    writePlot3d(SceneGridSource(makeScene("wake"), {60, 50, 40}), folder_ / "wake", progress);
  }

  std::string file(const std::string& name) const { return (folder_ / name).string(); }

  ProgramResult convert(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(),
                     {"convert", file("wake.xyz"), file("wake.fun"), "-o", file("wake.splats")});
    return runProgram(arguments);
  }

  std::map<std::string, std::string> cacheFiles() const {
    std::map<std::string, std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "wake.splats"))
      files[entry.path().filename().string()] = readTextFile(entry.path());
    return files;
  }

  const TemporaryFolder folder_;
};

TEST_F(ConvertOptionsTest, PrintsWhatItDid) {
  const ProgramResult result = convert({"--stats", file("stats.json")});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(lineCount(result.out), 3) << result.out;
  EXPECT_NE(result.out.find("120000 samples, 118000 splats"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("rounded within"), std::string::npos) << result.out;
  EXPECT_NE(result.err.find("2000 nodes on block faces coincide"), std::string::npos) << result.err;

  const auto stats = nlohmann::json::parse(readTextFile(folder_ / "stats.json"));
  EXPECT_EQ(stats["samples"], 120000);
  EXPECT_EQ(stats["merged_nodes"], 2000);
  EXPECT_GT(stats["peak_memory_bytes"], 0);
  EXPECT_LE(stats["temporary_bytes"], 70 * 120000);
  std::vector<std::string> phases;
  for (const auto& phase : stats["phases"]) phases.push_back(phase["name"]);
  EXPECT_EQ(phases,
            (std::vector<std::string>{"scan", "count", "scatter", "seams", "build", "faces", "finish"}));
  uint64_t bytes = 0;
  for (const auto& [name, size] : stats["files"].items()) {
    EXPECT_EQ(size, std::filesystem::file_size(folder_ / "wake.splats" / name));
    bytes += size.get<uint64_t>();
  }
  EXPECT_EQ(stats["cache_bytes"], bytes);
}

TEST_F(ConvertOptionsTest, GivesTheSameCacheForAnyThreadsAndMemory) {
  ASSERT_EQ(convert({"--threads", "1", "--memory", "200M"}).status, 0);
  const auto one = cacheFiles();
  const ProgramResult result = convert({"--threads", "2", "--memory", "8G", "--overwrite"});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_TRUE(cacheFiles() == one);
}

TEST_F(ConvertOptionsTest, PutsTemporaryFilesIntoTheGivenFolderAndRemovesThem) {
  std::filesystem::create_directory(folder_ / "tmp");
  ASSERT_EQ(convert({"--tmp", file("tmp")}).status, 0);
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "tmp"));
  const ProgramResult result = convert({"--tmp", file("none"), "--overwrite"});
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("--tmp"), std::string::npos) << result.err;
}

TEST_F(ConvertOptionsTest, RefusesLessMemoryThanItNeeds) {
  const ProgramResult result = convert({"--memory", "10M"});
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("--memory"), std::string::npos) << result.err;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "wake.splats"));
}

TEST_F(ConvertOptionsTest, TakesATrailingSlash) {
  const ProgramResult result =
      runProgram({"convert", file("wake.xyz"), file("wake.fun"), "-o", file("slash.splats/")});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_TRUE(std::filesystem::exists(folder_ / "slash.splats" / "manifest.json"));
}

/// --dry-run's forecast, and the conversion that it is of.
void expectForecastHolds(const std::vector<std::string>& conversion, const TemporaryFolder& folder) {
  std::vector<std::string> dry = conversion, real = conversion;
  dry.insert(dry.end(), {"--dry-run", "--stats", (folder / "dry.json").string()});
  real.insert(real.end(), {"--stats", (folder / "real.json").string()});
  const ProgramResult forecast = runProgram(dry);
  ASSERT_EQ(forecast.status, 0) << forecast.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "out.splats"));
  for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
    EXPECT_EQ(entry.path().filename().string().find("dry-run"), std::string::npos) << entry.path();
  const ProgramResult converted = runProgram(real);
  ASSERT_EQ(converted.status, 0) << converted.err;
  uint64_t bytes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "out.splats"))
    bytes += entry.file_size();
  const auto found = nlohmann::json::parse(readTextFile(folder / "dry.json"))["dry_run"];
  EXPECT_NEAR(found["cache_bytes"].get<double>() / static_cast<double>(bytes), 1, 0.05) << forecast.out;
  const auto peak =
      nlohmann::json::parse(readTextFile(folder / "real.json"))["peak_memory_bytes"].get<double>();
  EXPECT_NEAR(found["memory_bytes"].get<double>() / peak, 1, 0.3) << forecast.out;
}

TEST_F(ConvertOptionsTest, ADryRunPredictsCostsAndLeavesNothing) {
  expectForecastHolds({"convert", file("wake.xyz"), file("wake.fun"), "-o", file("out.splats")}, folder_);
}

TEST_F(ConvertOptionsTest, ADryRunOfASeriesCountsItsSteps) {
  ASSERT_EQ(runProgram({"generate", "wake", "--size", "40x30x20", "--steps", "4", "-o", file("s")}).status,
            0);
  expectForecastHolds({"convert", file("s.xyz"), file("s_*.fun"), "-o", file("out.splats")}, folder_);
}

TEST_F(ConvertOptionsTest, ADryRunNeedsANewCache) {
  const ProgramResult added = runProgram(
      {"convert", file("wake.xyz"), "--add-scalar", "i", "--to", file("wake.splats"), "--dry-run"});
  EXPECT_EQ(added.status, 2);
  EXPECT_EQ(
      added.err,
      "curvisplat: --dry-run: is for a new cache; leave out --add-scalar, --add-steps, --to and --follow\n");
  ASSERT_EQ(convert({}).status, 0);
  const ProgramResult in_the_way = convert({"--dry-run"});
  EXPECT_EQ(in_the_way.status, 1);
  EXPECT_NE(in_the_way.err.find("--overwrite"), std::string::npos) << in_the_way.err;
}

}  // namespace
}  // namespace curvisplat
