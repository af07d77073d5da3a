// `curvisplat info` on caches and on grid files, as a person runs it, and what conversion says of the files.
// What it says of a format's own parts: see the readers' tests.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <filesystem>

#include "tests/support/program_test.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

class InfoOfACache : public ProgramTest {
 protected:
  InfoOfACache() { SmallCache().write(path); }

  const std::filesystem::path path = folder_ / "a.splats";
};

TEST_F(InfoOfACache, PrintsItForPeople) {
  const ProgramResult result = run({"info", path});
  for (const char* word : {"small", "a.xyz", "6000", "density [kg/m3]", "geometry.bin", "bricks.vdb"})
    expectSays(result.out, word);
}

TEST_F(InfoOfACache, PrintsOneJsonObject) {
  const ProgramResult result = runProgram({"info", path, "--json", "--verify", "--probe", "900,0,0"});
  EXPECT_EQ(result.status, 1);
  expectSays(result.err, "the point 900, 0, 0 is outside of the data, which lies in x ");
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
  cache.write(folder_ / "b.splats");
  const glm::dvec3 at = cache.leaves[4].splats[10].position;
  const std::string point = fmt::format("{},{},{}", at.x, at.y, at.z);
  const ProgramResult text = run({"info", folder_ / "b.splats", "--probe=" + point});
  EXPECT_TRUE(text.out.starts_with(point.substr(0, point.find(',')))) << text.out;
  EXPECT_EQ(lineCount(text.out), 3) << "the probe and nothing else: " << text.out;
  EXPECT_NE(text.out.substr(0, text.out.find('\n')).find("(counted from 0), the middle of whose cell is at "),
            std::string::npos)
      << text.out;
  const ProgramResult result = runProgram({"info", folder_ / "b.splats", "--json", "--probe=" + point});
  const auto probe = nlohmann::json::parse(result.out)["probe"];
  ASSERT_TRUE(probe.is_object()) << result.out;
  EXPECT_LT(probe["distance"], 0.1);
  EXPECT_EQ(probe["values"].size(), 2u);
  EXPECT_EQ(probe["values"][1]["name"], "mach");
}

TEST_F(InfoOfACache, ProbesAFileOfPoints) {
  SmallCache cache;
  cache.write(folder_ / "b.splats");
  const glm::dvec3 at = cache.leaves[4].splats[10].position;
  overwriteFile(folder_ / "points.csv", fmt::format("x,y,z\n{},{},{}\n900 0 0\n", at.x, at.y, at.z));
  const ProgramResult table = run({"info", folder_ / "b.splats", "--probe", folder_ / "points.csv"});
  const ProgramResult one =
      runProgram({"info", folder_ / "b.splats", "--json", fmt::format("--probe={},{},{}", at.x, at.y, at.z)});
  const auto values = nlohmann::json::parse(one.out)["probe"]["values"];
  EXPECT_EQ(lineCount(table.out), 3) << table.out;
  expectSays(table.out, "x,y,z,density,mach,block,i,j,k\n");
  expectSays(table.out,
             fmt::format(",{},{},1,", values[0]["value"].get<float>(), values[1]["value"].get<float>()));
  expectSays(table.out, "900,0,0,,,,,,\n");
  overwriteFile(folder_ / "points.csv", "0,0,0\n1,2\n");
  expectRefused({"info", folder_ / "b.splats", "--probe", folder_ / "points.csv"}, 1,
                {"points.csv", "line 2"});
}

TEST_F(InfoOfACache, VerifyFindsDamage) {
  std::string bytes = bytesOfFile(path / "var.1.bin");
  bytes[200] ^= 8;
  overwriteFile(path / "var.1.bin", bytes);
  run({"info", path});
  const ProgramResult result = runProgram({"info", path, "--verify"});
  EXPECT_EQ(result.status, 1);
  expectSays(result.out, "finding: ");
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
}

TEST_F(InfoOfACache, RefusesInOneLine) {
  std::filesystem::create_directory(folder_ / "empty");
  for (const std::string name : {"empty", "missing"}) expectRefused({"info", folder_ / name}, 1, {name});
  EXPECT_EQ(runProgram({"info", path, "--probe", "1,2"}).status, 2);
  EXPECT_EQ(runProgram({"info", path, "solution.q"}).status, 2);
}

class InfoGrid : public ProgramTest {
 protected:
  static std::string shared(const std::string& name) {
    return (std::filesystem::path(CURVISPLAT_SHARED_DATA) / name).string();
  }
  void SetUp() override {
    if (!std::filesystem::is_directory(CURVISPLAT_SHARED_DATA))
      GTEST_SKIP() << "needs " << CURVISPLAT_SHARED_DATA;
  }
  static bool contains(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  }
};

TEST_F(InfoGrid, PrintsAllProperties) {
  const Words files{shared("bluntfin/bluntfinxyz.bin"), shared("bluntfin/bluntfinq.bin")};
  const ProgramResult text = run({"info", files[0], files[1]});
  for (const char* part :
       {"40x32x32, 39 degenerate cells", "cells     37479; 39 degenerate", "single precision",
        "scalar    density (100): 0.1", "vorticity_magnitude (211)", "Mach 2.95", "estimate"})
    EXPECT_TRUE(contains(text.out, part)) << part << "\n" << text.out;
  const ProgramResult result = runProgram({"info", files[0], files[1], "--json"});
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["cells"]["degenerate"], 39);
  EXPECT_EQ(json["blocks"][0]["nk"], 32);
  EXPECT_EQ(json["scalars"].size(), 5u);
  EXPECT_EQ(json["derived"].size(), 19u);
  EXPECT_EQ(json["estimate"]["splats"], 40960);
  EXPECT_GT(json["estimate"]["seconds"], 0);
  EXPECT_TRUE(json["overlaps"].empty());
}

TEST_F(InfoGrid, InfoAndConvertReportOverlaps) {
  const std::string overlapping = shared("overset/cylinder_chimera_overlapping_singledonor.x");
  const ProgramResult info = run({"info", overlapping, "--json"});
  EXPECT_FALSE(nlohmann::json::parse(info.out)["overlaps"].empty());
  EXPECT_TRUE(contains(runProgram({"info", overlapping}).out, "each point is drawn once"))
      << "as convert does";
  const ProgramResult converted =
      run({"convert", overlapping, "-o", folder_ / "o.splats", "--scalar", "volume"});
  EXPECT_TRUE(contains(converted.err, "note: blocks overlap in about ")) << converted.err;
  EXPECT_TRUE(contains(converted.err, "each point is drawn once")) << converted.err;
  const ProgramResult all =
      run({"convert", overlapping, "-o", folder_ / "all.splats", "--scalar", "volume", "--overlap", "all"});
  EXPECT_TRUE(contains(all.err, "warning: blocks overlap in about ")) << all.err;
  const ProgramResult abutting = run({"convert", shared("overset/cylinder_chimera_abutting.x"), "-o",
                                      folder_ / "a.splats", "--scalar", "k"});
  EXPECT_FALSE(contains(abutting.err, "overlap")) << abutting.err;
}

// Every PLOT3D file converts, or is refused for a stated reason.
TEST_F(InfoGrid, EveryPlot3dFileConvertsOrIsRefusedWithAReason) {
  const struct {
    Words files;
    std::string scalar;   // "": none is named
    std::string refusal;  // "": converts
  } cases[] = {
      {{"plot3d_multi/multi.p3d"}, "", ""},
      {{"plot3d_multi/test.p3d"}, "", "combxyz.bin, which does not exist"},
      {{"plot3d_multi/mbwavelet_ascii.xyz", "plot3d_multi/mbwavelet_ascii.q"}, "112", ""},
      {{"plot3d_multi/multi-ascii.xyz", "plot3d_multi/multi-ascii.q"}, "pressure", ""},
      {{"plot3d_multi/multi-bin-C.xyz", "plot3d_multi/multi-bin-C.q"}, "211", ""},
      {{"plot3d_multi/multi-bin.xyz", "plot3d_multi/multi-bin.q"}, "density", ""},
      {{"plot3d_multi/multi-bin.xyz", "plot3d_multi/multi-bin-oflow.q"}, "q_criterion", ""},
      {{"plot3d_multi/multi-bin-2D.xyz", "plot3d_multi/multi-bin-2D.q"}, "", "2-D"},
      {{"combustor/combxyz.bin", "combustor/combq.bin"}, "velocity_magnitude", ""},
      {{"lox_post/postxyz.bin", "lox_post/postq.bin"}, "vorticity_magnitude", ""},
      {{"nek/leadingEdge_block.xyz"}, "jacobian", ""},
      {{"nek/leadingEdge_block.xyz"}, "", "choose a derived one with --scalar"},
      {{"nek/leadingEdge_block.xyz", "nek/leadingEdge_block.fun"}, "", "number of variables is missing"},
      {{"fortran/sduct.new.x.bin"}, "j", ""},
      {{"delta_wing/delta_cfl3d.fmt"}, "volume", ""},
  };
  for (const auto& one : cases) {
    Words arguments{"convert"};
    for (const std::string& file : one.files) arguments.push_back(shared(file));
    arguments.insert(arguments.end(), {"-o", folder_ / "c.splats", "--overwrite"});
    if (!one.scalar.empty()) arguments.insert(arguments.end(), {"--scalar", one.scalar});
    const ProgramResult result = runProgram(arguments);
    SCOPED_TRACE(one.files.back() + " " + one.scalar + ": " + result.err);
    EXPECT_EQ(result.status, one.refusal.empty() ? 0 : 1);
    EXPECT_TRUE(contains(result.err, one.refusal));
    EXPECT_FALSE(contains(result.err, "overlap"));
  }
}

}  // namespace
}  // namespace curvisplat
