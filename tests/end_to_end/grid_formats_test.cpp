// Grid files of other formats through the real program: from the file to a cache and a picture.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/earth_files.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class GridFormats : public testing::Test {
 protected:
  std::string folder(const char* name) const { return folder_ / name; }

  void convert(const std::vector<std::string>& words, const std::string& cache) const {
    std::vector<std::string> arguments = {"convert"};
    arguments.insert(arguments.end(), words.begin(), words.end());
    arguments.insert(arguments.end(), {"-o", cache});
    const ProgramResult result = runProgram(arguments);
    ASSERT_EQ(result.status, 0) << result.err;
    const ProgramResult verified = runProgram({"info", cache, "--verify"});
    ASSERT_EQ(verified.status, 0) << verified.err;
  }

  std::string picture(const std::string& cache, const std::vector<std::string>& words) const {
    const std::string file = folder("picture.pfm");
    std::vector<std::string> arguments = {"render", cache, "-o", file, "--size", "200x200"};
    arguments.insert(arguments.end(), words.begin(), words.end());
    const ProgramResult result = runProgram(arguments);
    EXPECT_EQ(result.status, 0) << result.err;
    return readTextFile(file);
  }

  TemporaryFolder folder_;
};

TEST_F(GridFormats, AnOceanOnTheSphereAndOnTheMap) {
  const std::string file = folder("roms.nc");
  roms::write(file, NetcdfFileType::kNetcdf4Compressed, "ocean_s_coordinate_g2");
  // The next word after --sphere is the grid, not a radius.
  convert({"--sphere", file, "--vertical-scale", "100"}, folder("sphere.splats"));
  const Manifest sphere = CacheReader(folder("sphere.splats")).manifest();
  EXPECT_EQ(sphere.variables.at(0).name, "temp");
  EXPECT_EQ(sphere.blanked_nodes, 4 * roms::kLevels);
  EXPECT_NEAR(sphere.upper.x, 6371 * 0.76, 60);  // at 40 degrees north

  convert({"--flat", file, "--scalar", "u"}, folder("flat.splats"));
  const Manifest flat = CacheReader(folder("flat.splats")).manifest();
  EXPECT_EQ(flat.variables.at(0).name, "u");
  EXPECT_EQ(flat.nodes, (roms::kXi - 1) * roms::kEta * roms::kLevels);
  EXPECT_LT(flat.upper.x, 0);  // west of Greenwich
  EXPECT_GT(flat.lower.z, -1);

  EXPECT_EQ(runProgram({"info", file, "--sphere=0"}).status, 2);
  EXPECT_EQ(runProgram({"info", file, "--sphere", "--flat"}).status, 2);
  EXPECT_EQ(
      runProgram({"convert", file, "-o", folder("none.splats"), "--scalar", "temp", "--scalar", "u"}).status,
      1);
}

TEST_F(GridFormats, AScalarIsAddedToAnOcean) {
  const std::string file = folder("roms.nc");
  roms::write(file, NetcdfFileType::kClassic, "ocean_s_coordinate_g2");
  convert({file, "--scalar", "temp"}, folder("ocean.splats"));
  const ProgramResult added =
      runProgram({"convert", file, "--add-scalar", "salt", "--to", folder("ocean.splats")});
  ASSERT_EQ(added.status, 0) << added.err;
  const Manifest manifest = CacheReader(folder("ocean.splats")).manifest();
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
  const std::string cache = folder("delta.splats");
  convert({shared() / "delta_wing/delta_vertex.cgns", "--scalar", "Density"}, cache);
  // Seen from behind, of a slice across the rear of the wing: low density only above one half of it.
  writeFileAtomically(folder("vortex.json"),
                      std::string(R"([{"ColorSpace": "RGB", "RGBPoints": [0.86, 1, 0, 0, 1.02, 0, 0, 1],
                         "Points": [0.86, 0.9, 0.5, 0, 0.94, 0.5, 0.5, 0, 0.96, 0, 0.5, 0, 1.02, 0, 0.5, 0]}])"));
  const std::string file = folder("picture.pfm");
  picture(cache, {"--scalar", "Density", "--tf", folder("vortex.json"), "--opacity-unit", "0.02",
                  "--clip-box", "0.7,0.9,0,0.6,-0.3,0.5", "--position", "4,0.2,0.1", "--focal-point",
                  "0.8,0.2,0.1", "--view-up", "0,0,1", "--parallel-scale", "0.3"});
  const Image image = readImage(file);
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
  std::vector<std::string> pictures;
  for (const char* type : {"adf", "hdf"}) {
    const std::string cache = folder(type) + ".splats";
    convert({shared() / ("cgns/sqnz_s." + std::string(type) + ".cgns"), "--scalar", "Density"}, cache);
    const Manifest manifest = CacheReader(cache).manifest();
    EXPECT_TRUE(manifest.cells);
    EXPECT_EQ(manifest.nodes, 11'264u);
    pictures.push_back(picture(cache, {}));
  }
  EXPECT_EQ(pictures[0], pictures[1]);
}

}  // namespace
}  // namespace curvisplat
