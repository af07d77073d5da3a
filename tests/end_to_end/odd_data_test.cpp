// Data that is nearly none, or no numbers: what is drawn of it, and what is said about the rest.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "tests/support/cube_files.h"
#include "tests/support/program_test.h"
#include "tests/support/vts_writer.h"

namespace curvisplat {
namespace {

class OddDataTest : public ProgramTest {
 protected:
  /// Writes the cube, and how to convert it.
  Words convert(uint64_t side, const CubeNode& node, const Words& more = {}) const {
    writeCube(folder_ / "cube", side, node);
    return cubeArguments(folder_ / "cube", more);
  }
  void expectConverted(uint64_t side, const CubeNode& node) { said_ = run(convert(side, node)).err; }
  /// Draws the cube, 64x64, and keeps what was said.
  Image render(const Words& options = {}) {
    said_ = run(Words{"render", file("cube.splats"), "-o", file("out.pfm"), "--size", "64x64", "--background",
                      "white"} +
                options)
                .err;
    return readImage(file("out.pfm"));
  }
  static bool isWhite(const Image& image) {
    return std::all_of(image.rgba.begin(), image.rgba.end(), [](float value) { return value == 1; });
  }
  static bool isFinite(const Image& image) {
    return std::all_of(image.rgba.begin(), image.rgba.end(),
                       [](float value) { return std::isfinite(value); });
  }
  bool said(const std::string& words) const { return said_.find(words) != std::string::npos; }
  /// An empty picture, and one warning, which has `words` in it.
  void expectEmpty(const Words& options, const std::string& words) {
    EXPECT_TRUE(isWhite(render(options)));
    EXPECT_TRUE(said("the picture is empty: ")) << said_;
    EXPECT_TRUE(said(words)) << said_ << "lacks: " << words;
    EXPECT_EQ(said_.find("the picture is empty"), said_.rfind("the picture is empty")) << said_;
  }

  std::string said_;
};

void along(const GridNode& node, NodeValues& values) {
  values.scalars[0] = static_cast<float>(node.i);
}

/// The cell ends at faces on both sides along each axis, so that it is eight splats.
TEST_F(OddDataTest, ACacheOfOneCellIsDrawn) {
  VtsGrid grid = annulusVtsGrid(2, 2, 2);
  writeFileAtomically(folder_ / "one.vts", vtsFile(grid, VtsEncoding{}));
  const ProgramResult result = run({"convert", file("one.vts"), "-o", file("cube.splats"), "--scalar", "T"});
  expectSays(result.out, "8 splats in 1 brick, 1 level");
  const Image image = render({"--opacity-unit", "0.01", "--parallel-scale", "5"});
  EXPECT_LT(image.pixel(32, 32)[1], 0.9f) << said_;
  EXPECT_EQ(image.pixel(0, 0)[0], 1);
  EXPECT_TRUE(isFinite(image));
  run({"info", file("cube.splats"), "--verify"});
}

TEST_F(OddDataTest, ASingleRemainingNodeHasNoVolumeWhichIsReported) {
  expectConverted(2, [](const GridNode& node, NodeValues& values) {
    values.scalars[0] = 1;
    values.blank = node.i + node.j + node.k > 0;
  });
  EXPECT_TRUE(said("7 samples are blanked by the grid")) << said_;
  expectEmpty({}, "are flat and have no volume");
  EXPECT_TRUE(said("7 of 8")) << said_;
}

TEST_F(OddDataTest, NodesInOnePointHaveNoVolumeWhichIsReported) {
  expectConverted(4, [](const GridNode& node, NodeValues& values) {
    values.position = {1, 2, 3};
    along(node, values);
  });
  expectEmpty({}, "are flat and have no volume");
}

// `convert` says of flat samples what `render` says of a picture of nothing else, and what is seen of some of
// them beside others. From the front the flat ones would cover the right half.
TEST_F(OddDataTest, FlatSamplesAreInvisibleAndBothCommandsSaySo) {
  for (const bool all : {true, false}) {
    SCOPED_TRACE(all);
    std::filesystem::remove_all(file("cube.splats"));
    expectConverted(16, [&](const GridNode& node, NodeValues& values) {
      along(node, values);
      if (all || node.i >= 8) values.position.z = 3;
    });
    EXPECT_TRUE(
        said("samples are flat: they have no volume, or nearly none, and are as faint in volume "
             "rendering"))
        << said_;
    EXPECT_FALSE(said("drawn with")) << said_;
    const Words front{"--view", "+z", "--range", "0,15"};
    if (all) {
      expectEmpty(front, "are flat and have no volume, so they are invisible in volume rendering");
      continue;
    }
    const Image image = render(front);
    EXPECT_FALSE(said("empty")) << said_;
    EXPECT_LT(image.pixel(20, 32)[1], 0.9f);
    EXPECT_EQ(image.pixel(44, 32)[0], 1);
  }
}

TEST_F(OddDataTest, AGridWithoutNodesIsNotConverted) {
  expectRefused(convert(2, [](const GridNode&, NodeValues& values) { values.blank = true; }), 1,
                {"8 by the grid"});
  EXPECT_FALSE(std::filesystem::exists(file("cube.splats")));
}

TEST_F(OddDataTest, AnEmptyPictureNamesItsCause) {
  expectConverted(16, [](const GridNode& node, NodeValues& values) {
    along(node, values);
    values.blank = node.i >= 4 && node.i <= 11;
  });
  EXPECT_FALSE(isWhite(render()));
  // The range. Below it all is opaque, or so the preset says.
  expectEmpty({"--range", "20,30"}, "over the range 20..30, the transfer function 'matter'");
  EXPECT_TRUE(said("choose another --range")) << said_;
  // The function, over whichever range.
  writeFileAtomically(folder_ / "clear.json",
                      std::string(R"([{"Name": "clear", "RGBPoints": [0,1,0,0, 1,1,0,0],
                                       "Points": [0,0,0.5,0, 1,0,0.5,0]}])"));
  for (const char* range : {"0,15", "20,30"}) {
    expectEmpty({"--tf", file("clear.json"), "--range", range}, "'clear' is fully transparent");
    EXPECT_FALSE(said("--range;")) << said_;
  }
  // Blanking.
  expectEmpty({"--clip-box", "6,9,0,15,0,15"}, "is blanked (2048 of 4096 samples are)");
  expectEmpty({"--position", "7.5,-50,7.5", "--focal-point", "7.5,7.5,7.5", "--parallel-scale", "1"},
              "is blanked (2048 of 4096 samples are)");
  // The camera.
  expectEmpty({"--position", "100,0,0", "--focal-point", "200,0,0", "--view-angle", "30"},
              "does not see the data's box");
  expectEmpty({"--parallel-scale", "1e300"}, "choose a smaller --parallel-scale");
  expectEmpty({"--position", "1e9,0,0", "--view-angle", "30"}, "move the camera closer");
  render({"--position", "1e5,0,0", "--view-angle", "30"});  // of which a float picture has a trace
  EXPECT_TRUE(said("move the camera closer")) << said_;
  // What is seen is of values that are transparent.
  writeFileAtomically(folder_ / "high.json",
                      std::string(R"([{"Name": "high", "RGBPoints": [0,1,0,0, 15,1,0,0],
                                       "Points": [0,0,0.5,0, 11,0,0.5,0, 15,1,0.5,0]}])"));
  expectEmpty({"--tf", file("high.json"), "--clip-box", "0,3,0,15,0,15"},
              "the transfer function 'high' is transparent for all visible values of f");
}

TEST_F(OddDataTest, AConstantIsDrawn) {
  for (const float constant : {0.0f, 7.5f, -1e30f, 1e-40f}) {
    SCOPED_TRACE(constant);
    std::filesystem::remove_all(file("cube.splats"));
    expectConverted(6, [&](const GridNode&, NodeValues& values) { values.scalars[0] = constant; });
    const Image image = render({"--scalar-bar"});
    EXPECT_TRUE(said("everywhere")) << said_;
    EXPECT_FALSE(isWhite(image));
    EXPECT_TRUE(isFinite(image));
  }
}

TEST_F(OddDataTest, ValuesThatHardlyDifferAreAConstant) {
  expectConverted(6, [](const GridNode& node, NodeValues& values) {
    values.scalars[0] = 1e-44f * static_cast<float>(node.i);
  });
  EXPECT_FALSE(isWhite(render({"--scalar-bar"})));
  EXPECT_TRUE(said("everywhere")) << said_;
}

TEST_F(OddDataTest, NonFiniteSamplesAreCountedSkippedAndReported) {
  const float infinity = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const CubeNode node = [&](const GridNode& number, NodeValues& values) {
    along(number, values);
    if (number.k == 0) values.scalars[0] = nan;       // 64
    if (number.k == 7) values.scalars[0] = infinity;  // 64
    if (number.k == 6) values.scalars[0] = -infinity;
    if (number.k == 4 && number.j == 4) values.position.x = nan;  // 8
    if (number.k == 4 && number.j == 5) values.position.y = infinity;
  };
  writeCube(folder_ / "cube", 8, node);
  const ProgramResult result =
      run(cubeArguments(folder_ / "cube", {"--stats", file("stats.json"), "--refine", "1"}));
  expectSays(result.err,
             "note: 208 samples are not finite in single precision (NaN, infinite, or a value "
             "beyond 3.4e+38 in magnitude) and are blanked");
  const auto stats = jsonOf(folder_ / "stats.json");
  EXPECT_EQ(stats["blanked"]["not_finite"], 208);
  EXPECT_EQ(stats["splats"], 512 - 208);
  const ProgramResult info = run({"info", file("cube.splats"), "--json", "--verify"});
  const auto manifest = nlohmann::json::parse(info.out);
  EXPECT_EQ(manifest["blanked_nodes"], 208);
  EXPECT_EQ(manifest["variables"][0]["min"], 0);
  EXPECT_EQ(manifest["variables"][0]["max"], 7);
  const Image image = render();
  EXPECT_TRUE(isFinite(image));
  EXPECT_FALSE(isWhite(image));
}

/// A VTK file of 4 x 4 x 4 nodes, a hexahedron between each eight if it is a mesh, with a scalar of doubles.
std::string vtkOfDoubles(bool mesh, bool in_cells, const std::function<double(int)>& value) {
  constexpr int kSide = 4;
  std::string points, cells;
  int count = 0;
  for (int k = 0; k < kSide; ++k)
    for (int j = 0; j < kSide; ++j)
      for (int i = 0; i < kSide; ++i) {
        points += fmt::format("{} {} {}\n", i, j, k);
        if (i + 1 == kSide || j + 1 == kSide || k + 1 == kSide) continue;
        const int at = i + kSide * (j + kSide * k);
        cells += fmt::format("8 {} {} {} {} {} {} {} {}\n", at, at + 1, at + 5, at + 4, at + 16, at + 17,
                             at + 21, at + 20);
        ++count;
      }
  std::string text = "# vtk DataFile Version 3.0\ndoubles\nASCII\n";
  text += mesh ? "DATASET UNSTRUCTURED_GRID\n" : "DATASET STRUCTURED_GRID\nDIMENSIONS 4 4 4\n";
  text += "POINTS 64 double\n" + points;
  if (mesh) {
    text += fmt::format("CELLS {} {}\n{}CELL_TYPES {}\n", count, 9 * count, cells, count);
    for (int n = 0; n < count; ++n) text += "12\n";
  }
  const int values = in_cells ? count : 64;
  text += fmt::format("{} {}\nSCALARS p double 1\nLOOKUP_TABLE default\n",
                      in_cells ? "CELL_DATA" : "POINT_DATA", values);
  for (int n = 0; n < values; ++n) text += fmt::format("{}\n", value(n));
  return text;
}

// A double is finite, and infinite as the float that splats store.
TEST_F(OddDataTest, ValuesBeyondSinglePrecisionAreCountedAndTheLimitIsNamed) {
  const std::string named =
      "not finite in single precision (NaN, infinite, or a value beyond 3.4e+38 in magnitude)";
  for (const bool mesh : {false, true})
    for (const bool in_cells : {false, true}) {
      SCOPED_TRACE(fmt::format("mesh {}, in cells {}", mesh, in_cells));
      writeFileAtomically(folder_ / "huge.vtk", vtkOfDoubles(mesh, in_cells, [](int n) {
                            return n == 5 ? 1e300 : n == 6 ? -1e39 : n == 7 ? 3.4e38 : n;
                          }));
      const ProgramResult info = run({"info", file("huge.vtk")});
      const std::string counted = mesh ? "2 of its values are " : in_cells ? "2 with values " : "grid, 2 ";
      expectSays(info.out, counted + named);
      expectSays(info.out, "0 .. 3.4e+38");
      const ProgramResult converted =
          run({"convert", file("huge.vtk"), "-o", file("huge.splats"), "--overwrite", "--blank", "3.4e38"});
      expectSays(converted.err, "note: 2 samples are " + named + " and are blanked");
    }
}

TEST_F(OddDataTest, ValuesTooFarApartAreRefusedUnlessTheyAreBlank) {
  const CubeNode node = [](const GridNode& number, NodeValues& values) {
    along(number, values);
    if (number.i == 0) values.scalars[0] = 1e20f;
  };
  expectRefused(convert(8, node), 1, {"f: its values go from 1 to 1e+20", "--blank"});
  EXPECT_FALSE(std::filesystem::exists(file("cube.splats")));
  const ProgramResult taken = run(convert(8, node, {"--blank", "1e20"}));
  expectSays(taken.err, "64 samples have the blank value");
  EXPECT_FALSE(isWhite(render()));
}

TEST_F(OddDataTest, ValuesTooFarApartAreNotAdded) {
  expectConverted(8, along);
  writeCube(
      folder_ / "far", 8,
      [](const GridNode& number, NodeValues& values) { values.scalars[0] = number.i == 0 ? 1e20f : 1; },
      "far");
  expectRefused(cubeAdditionWords(folder_ / "far", "far", folder_ / "cube.splats"), 1,
                {"far: its values go from 1 to 1e+20"});
  const ProgramResult info = run({"info", file("cube.splats"), "--verify", "--json"});
  EXPECT_EQ(nlohmann::json::parse(info.out)["variables"].size(), 1u);
}

TEST_F(OddDataTest, ValuesFarApartButNotTooFarAreDrawn) {
  expectConverted(8, [](const GridNode& number, NodeValues& values) {
    values.scalars[0] = (number.i + number.j + number.k) % 2 ? 4.9e17f : -4.9e17f;
  });
  for (const char* backend : {"cpu", "osmesa"}) {
    const Image image = render({"--backend", backend});
    EXPECT_TRUE(isFinite(image)) << backend;
    EXPECT_FALSE(isWhite(image)) << backend;
  }
  run({"info", file("cube.splats"), "--verify"});
}

}  // namespace
}  // namespace curvisplat
