// Grid files of other formats, VTK's among them, through the real program: from the command line to a cache
// and a picture.
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/earth_files.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

class GridFormats : public ProgramTest {
 protected:
  static void convert(const Words& words, const std::string& cache) {
    run(Words{"convert"} + words + Words{"-o", cache});
    run({"info", cache, "--verify"});
  }

  /// The bytes of the picture, which is picture.pfm.
  std::string picture(const std::string& cache, const Words& more) const {
    pictureOf(cache, file("picture.pfm"), more, "200x200");
    return readTextFile(file("picture.pfm"));
  }
};

TEST_F(GridFormats, AnOceanOnTheSphereAndOnTheMap) {
  const std::string roms_file = file("roms.nc");
  roms::write(roms_file, NetcdfFileType::kNetcdf4Compressed, "ocean_s_coordinate_g2");
  // The next word after --sphere is the grid, not a radius.
  convert({"--sphere", roms_file, "--vertical-scale", "100", "--refine", "1"}, file("sphere.splats"));
  const Manifest sphere = CacheReader(file("sphere.splats")).manifest();
  EXPECT_EQ(sphere.variables.at(0).name, "temp");
  EXPECT_EQ(sphere.blanked_nodes, 4 * roms::kLevels);
  EXPECT_NEAR(sphere.upper.x, 6371 * 0.76, 60);  // at 40 degrees north

  convert({"--flat", roms_file, "--scalar", "u"}, file("flat.splats"));
  const Manifest flat = CacheReader(file("flat.splats")).manifest();
  EXPECT_EQ(flat.variables.at(0).name, "u");
  EXPECT_EQ(flat.nodes, (roms::kXi - 1) * roms::kEta * roms::kLevels);
  EXPECT_LT(flat.upper.x, 0);  // west of Greenwich
  EXPECT_GT(flat.lower.z, -1);

  EXPECT_EQ(runProgram({"info", roms_file, "--sphere=0"}).status, 2);
  EXPECT_EQ(runProgram({"info", roms_file, "--sphere", "--flat"}).status, 2);
  EXPECT_EQ(runProgram({"convert", roms_file, "-o", file("none.splats"), "--scalar", "temp", "--scalar", "u"})
                .status,
            1);
}

TEST_F(GridFormats, AScalarIsAddedToAnOcean) {
  const std::string roms_file = file("roms.nc");
  roms::write(roms_file, NetcdfFileType::kClassic, "ocean_s_coordinate_g2");
  convert({roms_file, "--scalar", "temp"}, file("ocean.splats"));
  run({"convert", roms_file, "--add-scalar", "salt", "--to", file("ocean.splats")});
  const Manifest manifest = CacheReader(file("ocean.splats")).manifest();
  ASSERT_EQ(manifest.variables.size(), 2u);
  EXPECT_EQ(manifest.variables[1].name, "salt");
}

class SharedGridFormats : public GridFormats {
 protected:
  void SetUp() override {
    if (!std::filesystem::is_directory(shared())) GTEST_SKIP() << "needs " << shared();
  }
  static std::filesystem::path shared() { return CURVISPLAT_SHARED_DATA; }
};

TEST_F(SharedGridFormats, TheDeltaWingHasItsVortex) {
  const std::string cache = file("delta.splats");
  convert({shared() / "delta_wing/delta_vertex.cgns", "--scalar", "Density"}, cache);
  // Seen from behind, of a slice across the rear of the wing: low density only above one half of it.
  writeFileAtomically(file("vortex.json"),
                      std::string(R"([{"ColorSpace": "RGB", "RGBPoints": [0.86, 1, 0, 0, 1.02, 0, 0, 1],
                         "Points": [0.86, 0.9, 0.5, 0, 0.94, 0.5, 0.5, 0, 0.96, 0, 0.5, 0, 1.02, 0, 0.5, 0]}])"));
  picture(cache, {"--scalar", "Density", "--tf", file("vortex.json"), "--opacity-unit", "0.02", "--clip-box",
                  "0.7,0.9,0,0.6,-0.3,0.5", "--position", "4,0.2,0.1", "--focal-point", "0.8,0.2,0.1",
                  "--view-up", "0,0,1", "--parallel-scale", "0.3", "--background", "white"});
  const Image image = readImage(file("picture.pfm"));
  double red_weight = 0, y = 0, z = 0;
  for (int row = 0; row < image.size.height; ++row)
    for (int column = 0; column < image.size.width; ++column) {
      const double red = 1 - image.pixel(column, row)[2];  // what is not white
      red_weight += red;
      y += red * (0.2 + 0.3 * ((column + 0.5) / 100.0 - 1));
      z += red * (0.1 - 0.3 * ((row + 0.5) / 100.0 - 1));
    }
  ASSERT_GT(red_weight, 300);
  // The mean of the nodes there, by their volumes and extinctions: with numpy, of what h5py reads.
  EXPECT_NEAR(y / red_weight, 0.147, 0.01);
  EXPECT_NEAR(z / red_weight, 0.070, 0.01);
}

TEST_F(SharedGridFormats, CellsInAdfAndInHdf5AreOnePicture) {
  Words pictures;
  for (const char* type : {"adf", "hdf"}) {
    const std::string cache = file(type) + ".splats";
    convert({shared() / ("cgns/sqnz_s." + std::string(type) + ".cgns"), "--scalar", "Density"}, cache);
    const Manifest manifest = CacheReader(cache).manifest();
    EXPECT_TRUE(manifest.cells);
    EXPECT_EQ(manifest.nodes, 11'264u);
    pictures.push_back(picture(cache, {}));
  }
  EXPECT_EQ(pictures[0], pictures[1]);
}

const std::string kMade = std::string(CURVISPLAT_TEST_DATA) + "/vtk/";

class VtkProgram : public ProgramTest {
 protected:
  Words convert(const std::string& grid, const Words& more = {}) const {
    return Words{"convert", grid, "-o", cache_, "--overwrite"} + more;
  }

  const std::string cache_ = (folder_ / "out.splats").string();
};

TEST_F(VtkProgram, ReportsTimeStepsUnlessOneIsChosen) {
  ProgramResult result = run(convert(kMade + "series.pvd"));
  expectSays(result.err, "note: 3 time steps from 0.5 to 4; using the first: choose with --time-step 0..2");
  EXPECT_EQ(CacheReader(cache_).manifest().steps.at(0).time, 0.5);

  result = run(convert(kMade + "series.pvd", {"--time-step", "2", "--scalar", "wall_distance"}));
  EXPECT_EQ(result.err.find("time step"), std::string::npos) << result.err;
  const CacheReader cache(cache_);
  EXPECT_EQ(cache.manifest().steps.at(0).time, 4.0);
  EXPECT_EQ(cache.manifest().variables.at(0).name, "wall distance");
  EXPECT_FLOAT_EQ(static_cast<float>(cache.manifest().variables[0].min), 4.70710678f);

  expectRefused(convert(kMade + "series.pvd", {"--time-step", "3"}), 1, {});
}

TEST_F(VtkProgram, AddsAScalarOfAVector) {
  run(convert(kMade + "ghosts.pvts", {"--scalar", "RTData"}));
  run(convert(kMade + "raw_lz4_64.vts", {"--scalar", "p"}));
  run({"convert", kMade + "raw_lz4_64.vts", "--add-scalar", "U:mag", "--to", cache_});
  EXPECT_EQ(CacheReader(cache_).manifest().variables.at(1).name, "U:mag");
  run({"info", "--verify", cache_});
}

TEST_F(VtkProgram, ConvertsValuesInCells) {
  run(convert(kMade + "ghosts.pvts", {"--scalar", "RTData:cell"}));
  EXPECT_EQ(CacheReader(cache_).manifest().splats, 8u * 7 * 6);
}

TEST_F(VtkProgram, InfoReportsNodesAndCells) {
  const ProgramResult result = run({"info", "--json", kMade + "blocks.vtm"});
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
