// `curvisplat convert --refine`, as a person runs it.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "tests/support/folder_files.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class RefineCommand : public testing::Test {
 protected:
  RefineCommand() {
    Progress progress;
    writePlot3d(SceneGridSource(makeScenes("duct"), {9, 7, 6}), folder_ / "duct", progress);
  }

  std::string file(const std::string& name) const { return (folder_ / name).string(); }

  ProgramResult convert(const std::string& cache, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"convert", file("duct.xyz"), file("duct.fun"), "-o", file(cache)});
    return runProgram(more);
  }
  nlohmann::json manifest(const std::string& cache) const {
    return nlohmann::json::parse(readTextFile(folder_ / cache / "manifest.json"));
  }
  /// That the program ends with one line that has these words.
  static void expectRefused(const ProgramResult& result, int status, const std::string& words) {
    EXPECT_EQ(result.status, status);
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    EXPECT_NE(result.err.find(words), std::string::npos) << result.err;
  }

  const TemporaryFolder folder_;
};

TEST_F(RefineCommand, CutsEachCellAndSaysSo) {
  ASSERT_EQ(convert("1.splats").status, 0);
  const ProgramResult result = convert("2.splats", {"--refine", "2", "--threads", "1"});
  ASSERT_EQ(result.status, 0) << result.err;
  const nlohmann::json whole = manifest("1.splats"), fine = manifest("2.splats");
  EXPECT_FALSE(whole.contains("refined"));
  EXPECT_EQ(fine["refined"], 2);
  EXPECT_EQ(fine["nodes"], 3 * 17 * 13 * 11);
  EXPECT_EQ(fine["blocks"][0]["ni"], 17);
  EXPECT_NEAR(fine["volume"].get<double>() / whole["volume"].get<double>(), 1, 1e-3);
  EXPECT_EQ(fine["lower"], whole["lower"]);
  EXPECT_EQ(fine["upper"], whole["upper"]);
  const ProgramResult info = runProgram({"info", file("2.splats")});
  EXPECT_NE(info.out.find("2 x 2 x 2"), std::string::npos) << info.out;
  const ProgramResult probe = runProgram({"info", file("2.splats"), "--probe", "0.5,0.5,0.5"});
  EXPECT_NE(probe.out.find("in the refined grid"), std::string::npos) << probe.out;
  EXPECT_EQ(runProgram({"info", file("1.splats")}).out.find("refined"), std::string::npos);

  const Files one = filesOf(folder_ / "2.splats");
  ASSERT_EQ(
      convert("2.splats", {"--refine", "2", "--threads", "2", "--memory", "200M", "--overwrite"}).status, 0);
  EXPECT_TRUE(filesOf(folder_ / "2.splats") == one);
  ASSERT_EQ(convert("1.splats", {"--refine", "1", "--overwrite"}).status, 0);
  EXPECT_EQ(manifest("1.splats"), whole);
}

TEST_F(RefineCommand, FurtherScalarsFollowTheCache) {
  ASSERT_EQ(convert("a.splats", {"--refine", "2"}).status, 0);
  const auto add = [&](const char* scalar, std::vector<std::string> more) {
    more.insert(more.begin(),
                {"convert", file("duct.xyz"), "--add-scalar", scalar, "--to", file("a.splats")});
    return runProgram(more);
  };
  EXPECT_EQ(add("i", {}).status, 0);
  EXPECT_EQ(add("j", {"--refine", "2"}).status, 0);
  expectRefused(add("k", {"--refine", "3"}), 2, "was converted with --refine 2");
  const nlohmann::json variables = manifest("a.splats")["variables"];
  ASSERT_EQ(variables.size(), 3u);
  EXPECT_EQ(variables[1]["max"], 8) << "the index of the grid's own nodes, interpolated";
  EXPECT_EQ(runProgram({"info", file("a.splats"), "--verify"}).status, 0);
}

TEST_F(RefineCommand, ASeriesGoesOnAsItBegan) {
  ASSERT_EQ(runProgram({"generate", "wake", "--size", "9x8x7", "--steps", "3", "-o", file("s")}).status, 0);
  const auto series = [&](const std::string& cache, std::vector<std::string> more) {
    more.insert(more.begin(), {"convert", file("s.xyz"), file("s_*.fun"), "-o", file(cache)});
    return runProgram(more);
  };
  ASSERT_EQ(series("all.splats", {"--refine", "2"}).status, 0);
  ASSERT_EQ(series("some.splats", {"--refine", "2", "--steps", "0:1"}).status, 0);
  expectRefused(series("some.splats", {"--resume", "--refine", "4"}), 2, "was converted with --refine 2");
  const ProgramResult resumed = series("some.splats", {"--resume"});
  EXPECT_EQ(resumed.status, 0) << resumed.err;
  EXPECT_TRUE(filesOf(folder_ / "some.splats") == filesOf(folder_ / "all.splats"));

  ASSERT_EQ(series("added.splats", {"--refine", "2", "--steps", "0:0"}).status, 0);
  const auto add = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"convert", file("s.xyz"), file("s_0001.fun"), file("s_0002.fun"),
                               "--add-steps", "--to", file("added.splats")});
    return runProgram(more);
  };
  expectRefused(add({"--refine", "3"}), 2, "was converted with --refine 2");
  const ProgramResult added = add({});
  EXPECT_EQ(added.status, 0) << added.err;
  EXPECT_TRUE(filesOf(folder_ / "added.splats") == filesOf(folder_ / "all.splats"));
}

TEST_F(RefineCommand, RefusesWhatCannotBeRefined) {
  writeFileAtomically(folder_ / "tetrahedron.vtk",
                      "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n"
                      "POINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n"
                      "POINT_DATA 4\nSCALARS s float\nLOOKUP_TABLE default\n1 2 3 4\n");
  const auto convert_it = [&](const char* parts) {
    return runProgram({"convert", file("tetrahedron.vtk"), "-o", file("t.splats"), "--refine", parts});
  };
  expectRefused(convert_it("2"), 1, "--refine is for structured grids");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "t.splats"));
  EXPECT_EQ(convert_it("1").status, 0);
  for (const char* const parts : {"0", "17", "x"}) {
    const ProgramResult result = convert("no.splats", {"--refine", parts});
    EXPECT_EQ(result.status, 2);
    EXPECT_NE(result.err.find("--refine"), std::string::npos) << result.err;
  }
}

}  // namespace
}  // namespace curvisplat
