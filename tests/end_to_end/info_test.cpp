// `curvisplat info` on caches, as a person runs it. On grids: see the readers' tests.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/stream/test_bricks.h"
#include "tests/support/run_program.h"

namespace curvisplat {
namespace {

class InfoOfACache : public testing::Test {
 protected:
  InfoOfACache() { SmallCache().write(path); }

  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "a.splats";
};

TEST_F(InfoOfACache, PrintsItForPeople) {
  const ProgramResult result = runProgram({"info", path});
  EXPECT_EQ(result.status, 0) << result.err;
  for (const char* word : {"small", "a.xyz", "6000", "density [kg/m3]", "geometry.bin", "bricks.vdb"})
    EXPECT_NE(result.out.find(word), std::string::npos) << word << "\n" << result.out;
}

TEST_F(InfoOfACache, PrintsOneJsonObject) {
  const ProgramResult result = runProgram({"info", path, "--json", "--verify", "--probe", "900,0,0"});
  EXPECT_EQ(result.status, 1);
  EXPECT_NE(result.err.find("the point 900, 0, 0 is outside of the data, which lies in x "),
            std::string::npos)
      << result.err;
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["bricks"], 10);
  EXPECT_EQ(json["bricks_by_level"].size(), 2u);
  EXPECT_EQ(json["bricks_by_level"][1]["leaves"], 9);
  EXPECT_EQ(json["bricks_by_level"][1]["splats"], json["splats"]);
  EXPECT_TRUE(json["findings"].empty());
  EXPECT_TRUE(json["probe"].is_null());
  uint64_t bytes = 0;
  for (const auto& file : json["files"]) bytes += file["size"].get<uint64_t>();
  EXPECT_EQ(json["bytes"], bytes);
}

TEST_F(InfoOfACache, ProbesANode) {
  SmallCache cache;
  cache.write(folder / "b.splats");
  const glm::dvec3 at = cache.leaves[4].splats[10].position;
  const std::string point = fmt::format("{},{},{}", at.x, at.y, at.z);
  const ProgramResult text = runProgram({"info", folder / "b.splats", "--probe=" + point});
  EXPECT_EQ(text.status, 0) << text.err;
  EXPECT_TRUE(text.out.starts_with(point.substr(0, point.find(',')))) << text.out;
  EXPECT_NE(text.out.substr(0, text.out.find('\n')).find("(counted from 0) at "), std::string::npos)
      << text.out;
  const ProgramResult result = runProgram({"info", folder / "b.splats", "--json", "--probe=" + point});
  const auto probe = nlohmann::json::parse(result.out)["probe"];
  ASSERT_TRUE(probe.is_object()) << result.out;
  EXPECT_LT(probe["distance"], 0.1);
  EXPECT_EQ(probe["values"].size(), 2u);
  EXPECT_EQ(probe["values"][1]["name"], "mach");
}

TEST_F(InfoOfACache, VerifyFindsDamage) {
  std::string bytes = bytesOfFile(path / "var.1.bin");
  bytes[200] ^= 8;
  overwriteFile(path / "var.1.bin", bytes);
  EXPECT_EQ(runProgram({"info", path}).status, 0);
  const ProgramResult result = runProgram({"info", path, "--verify"});
  EXPECT_EQ(result.status, 1);
  EXPECT_NE(result.out.find("finding: "), std::string::npos) << result.out;
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
}

TEST_F(InfoOfACache, RefusesInOneLine) {
  std::filesystem::create_directory(folder / "empty");
  for (const std::string name : {"empty", "missing"}) {
    const ProgramResult result = runProgram({"info", folder / name});
    EXPECT_EQ(result.status, 1) << name;
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    EXPECT_NE(result.err.find(name), std::string::npos) << result.err;
  }
  EXPECT_EQ(runProgram({"info", path, "--probe", "1,2"}).status, 2);
  EXPECT_EQ(runProgram({"info", path, "solution.q"}).status, 2);
}

}  // namespace
}  // namespace curvisplat
