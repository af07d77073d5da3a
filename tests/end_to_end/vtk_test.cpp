// VTK files through the real program: from the command line to the cache.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "stream/cache/cache_reader.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

const std::string kMade = std::string(CURVISPLAT_TEST_DATA) + "/vtk/";

class VtkProgram : public testing::Test {
 protected:
  ProgramResult convert(const std::string& grid, std::vector<std::string> arguments = {}) const {
    arguments.insert(arguments.begin(), {"convert", grid, "-o", cache_, "--overwrite"});
    return runProgram(arguments);
  }

  const TemporaryFolder folder_;
  const std::string cache_ = (folder_ / "out.splats").string();
};

TEST_F(VtkProgram, ReportsTimeStepsUnlessOneIsChosen) {
  ProgramResult result = convert(kMade + "series.pvd");
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_NE(
      result.err.find("note: 3 time steps from 0.5 to 4; using the first: choose with --time-step 0..2"),
      std::string::npos)
      << result.err;
  EXPECT_EQ(CacheReader(cache_).manifest().steps.at(0).time, 0.5);

  result = convert(kMade + "series.pvd", {"--time-step", "2", "--scalar", "wall_distance"});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.err.find("time step"), std::string::npos) << result.err;
  const CacheReader cache(cache_);
  EXPECT_EQ(cache.manifest().steps.at(0).time, 4.0);
  EXPECT_EQ(cache.manifest().variables.at(0).name, "wall distance");
  EXPECT_FLOAT_EQ(static_cast<float>(cache.manifest().variables[0].min), 4.70710678f);

  result = convert(kMade + "series.pvd", {"--time-step", "3"});
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
}

TEST_F(VtkProgram, AddsAScalarOfAVector) {
  ASSERT_EQ(convert(kMade + "ghosts.pvts", {"--scalar", "RTData"}).status, 0);
  EXPECT_EQ(convert(kMade + "raw_lz4_64.vts", {"--scalar", "p"}).status, 0);
  const ProgramResult result =
      runProgram({"convert", kMade + "raw_lz4_64.vts", "--add-scalar", "U:mag", "--to", cache_});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(CacheReader(cache_).manifest().variables.at(1).name, "U:mag");
  EXPECT_EQ(runProgram({"info", "--verify", cache_}).status, 0);
}

TEST_F(VtkProgram, ConvertsValuesInCells) {
  const ProgramResult result = convert(kMade + "ghosts.pvts", {"--scalar", "RTData:cell"});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(CacheReader(cache_).manifest().splats, 8u * 7 * 6);
}

TEST_F(VtkProgram, InfoReportsNodesAndCells) {
  const ProgramResult result = runProgram({"info", "--json", kMade + "blocks.vtm"});
  ASSERT_EQ(result.status, 0) << result.err;
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["nodes"], 120);
  EXPECT_EQ(json["blanked"]["not_finite"], 0);
  EXPECT_EQ(json["blocks"][1]["name"], "outlet");
  EXPECT_EQ(json["scalars"][0]["name"], "p");
  EXPECT_EQ(json["scalars"][0]["centring"], "node");
  const auto& last = json["scalars"].back();
  EXPECT_EQ(last["name"], "flux:z");
  EXPECT_EQ(last["centring"], "cell");
  EXPECT_EQ(last["max"], 46);  // of 24 cells
}

}  // namespace
}  // namespace curvisplat
