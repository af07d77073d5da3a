// `curvisplat info` on grid files, and what conversion says of them.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class InfoGrid : public testing::Test {
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

  const TemporaryFolder folder_;
};

TEST_F(InfoGrid, PrintsAllProperties) {
  const std::vector<std::string> files{shared("bluntfin/bluntfinxyz.bin"), shared("bluntfin/bluntfinq.bin")};
  const ProgramResult text = runProgram({"info", files[0], files[1]});
  EXPECT_EQ(text.status, 0) << text.err;
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
  const ProgramResult info = runProgram({"info", overlapping, "--json"});
  EXPECT_EQ(info.status, 0) << info.err;
  EXPECT_FALSE(nlohmann::json::parse(info.out)["overlaps"].empty());
  EXPECT_TRUE(contains(runProgram({"info", overlapping}).out, "each point is drawn once"))
      << "as convert does";
  const ProgramResult converted =
      runProgram({"convert", overlapping, "-o", folder_ / "o.splats", "--scalar", "volume"});
  EXPECT_EQ(converted.status, 0) << converted.err;
  EXPECT_TRUE(contains(converted.err, "note: blocks overlap in about ")) << converted.err;
  EXPECT_TRUE(contains(converted.err, "each point is drawn once")) << converted.err;
  const ProgramResult all = runProgram(
      {"convert", overlapping, "-o", folder_ / "all.splats", "--scalar", "volume", "--overlap", "all"});
  EXPECT_EQ(all.status, 0) << all.err;
  EXPECT_TRUE(contains(all.err, "warning: blocks overlap in about ")) << all.err;
  const ProgramResult abutting = runProgram({"convert", shared("overset/cylinder_chimera_abutting.x"), "-o",
                                             folder_ / "a.splats", "--scalar", "k"});
  EXPECT_EQ(abutting.status, 0) << abutting.err;
  EXPECT_FALSE(contains(abutting.err, "overlap")) << abutting.err;
}

// Every PLOT3D file converts, or is refused for a stated reason.
TEST_F(InfoGrid, EveryPlot3dFileConvertsOrIsRefusedWithAReason) {
  const struct {
    std::vector<std::string> files;
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
    std::vector<std::string> arguments{"convert"};
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
