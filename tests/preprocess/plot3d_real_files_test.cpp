// The PLOT3D files that people have: dimensions, fields and counts as their owners state them.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/plot3d/plot3d_detect.h"
#include "preprocess/formats/plot3d/plot3d_file.h"
#include "preprocess/grid/node_reader.h"
#include "stream/base/error.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

const std::filesystem::path kRealGrids = CURVISPLAT_SHARED_DATA;

class RealFiles : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::is_directory(kRealGrids)) GTEST_SKIP() << "needs " << kRealGrids;
  }

  static std::unique_ptr<GridSource> open(const std::string& grid,
                                          const std::vector<std::string>& solutions = {}) {
    OpenGridOptions options;
    options.grid = kRealGrids / grid;
    for (const std::string& solution : solutions) options.solutions.push_back(kRealGrids / solution);
    return openGrid(options);
  }

  static std::string errorOf(const std::string& grid, const std::vector<std::string>& solutions = {}) {
    return curvisplat::errorOf([&] { open(grid, solutions); });
  }

  struct Range {
    double min = std::numeric_limits<double>::infinity(), max = -min;
    void add(double value) {
      min = std::min(min, value);
      max = std::max(max, value);
    }
  };
  struct Content {
    uint64_t nodes = 0;
    BlankCounts blank;
    Range x, y, z;
    std::vector<Range> scalars;  // of the nodes that are there
  };

  static Content readAll(const GridSource& source) {
    const GridDescription& description = source.description();
    Content content;
    std::vector<uint32_t> scalars(description.scalars.size());
    for (uint32_t n = 0; n < scalars.size(); ++n) scalars[n] = n;
    content.scalars.resize(scalars.size());
    const NodeReader reader(source, scalars, std::nullopt);
    NodeArrays nodes;
    for (uint32_t b = 0; b < description.blocks.size(); ++b) {
      const GridBlock& block = description.blocks[b];
      content.nodes += block.nodes();
      content.blank += reader.read(b, {0, block.nj, 0, block.nk}, nodes);
      for (size_t n = 0; n < nodes.x.size(); ++n) {
        if (nodes.blank[n]) continue;
        content.x.add(nodes.x[n]);
        content.y.add(nodes.y[n]);
        content.z.add(nodes.z[n]);
        for (size_t s = 0; s < scalars.size(); ++s) content.scalars[s].add(nodes.scalars[s][n]);
      }
    }
    return content;
  }
};

std::string dims(const GridDescription& description) {
  std::string words;
  for (const GridBlock& block : description.blocks)
    words += fmt::format("{}{}x{}x{}", words.empty() ? "" : " ", block.ni, block.nj, block.nk);
  return words;
}

TEST_F(RealFiles, BluntFin) {
  const auto source = open("bluntfin/bluntfinxyz.bin", {"bluntfin/bluntfinq.bin"});
  const GridDescription& description = source->description();
  EXPECT_EQ(dims(description), "40x32x32");
  EXPECT_EQ(
      description.format,
      "PLOT3D grid bluntfinxyz.bin: big-endian, C (no record markers), single precision, single-block, no "
      "iblank; Q solution bluntfinq.bin: big-endian, C (no record markers), single precision, single-block");
  EXPECT_EQ(description.warnings, std::vector<std::string>{"bluntfinq.bin: 484 trailing bytes ignored"});
  EXPECT_EQ(description.coordinate_bytes, 4);
  ASSERT_EQ(description.flow.size(), 1u);
  EXPECT_NEAR(description.flow[0].mach, 2.95, 1e-6);
  const Content content = readAll(*source);
  EXPECT_EQ(content.nodes, 40'960u);
  EXPECT_EQ(content.blank.total(), 0u);
  EXPECT_NEAR(content.scalars[0].min, 0.193, 1e-3);
  EXPECT_NEAR(content.scalars[0].max, 4.98, 1e-2);
  EXPECT_NEAR(content.scalars[4].min, 0.769, 1e-3);
  EXPECT_NEAR(content.scalars[4].max, 25.2, 1e-1);
}

TEST_F(RealFiles, LoxPostDrawsNegativeIblank) {
  const auto source = open("lox_post/postxyz.bin", {"lox_post/postq.bin"});
  EXPECT_EQ(dims(source->description()), "38x76x38");
  EXPECT_TRUE(source->description().blocks[0].has_blanking);
  EXPECT_TRUE(source->description().warnings.empty());
  const Content content = readAll(*source);
  EXPECT_EQ(content.nodes, 109'744u);
  EXPECT_EQ(content.blank.total(), 0u);
  EXPECT_EQ(content.scalars[0].min, 1);
  EXPECT_EQ(content.scalars[0].max, 1);

  const auto file = std::make_shared<InputFile>(kRealGrids / "lox_post/postxyz.bin");
  const Plot3dFile grid(detectPlot3dGrid(file, {}, std::filesystem::temp_directory_path()).fit);
  std::vector<int32_t> iblank(content.nodes);
  grid.readIblank(0, {0, 76, 0, 38}, iblank);
  EXPECT_EQ(std::count(iblank.begin(), iblank.end(), -1), 4'332);
  EXPECT_EQ(std::count(iblank.begin(), iblank.end(), 1), 105'412);
}

TEST_F(RealFiles, Combustor) {
  const auto source = open("combustor/combxyz.bin", {"combustor/combq.bin"});
  EXPECT_EQ(dims(source->description()), "57x33x25");
  const Content content = readAll(*source);
  EXPECT_NEAR(content.scalars[0].min, 0.198, 1e-3);
  EXPECT_NEAR(content.scalars[0].max, 0.710, 1e-3);
  EXPECT_EQ(content.scalars[4].min, 0);
  EXPECT_EQ(content.scalars[4].max, 0);
}

TEST_F(RealFiles, MultiBlockInThreeEncodingsIsTheSame) {
  const auto ascii = open("plot3d_multi/multi-ascii.xyz", {"plot3d_multi/multi-ascii.q"});
  const auto c = open("plot3d_multi/multi-bin-C.xyz", {"plot3d_multi/multi-bin-C.q"});
  const auto fortran = open("plot3d_multi/multi-bin.xyz", {"plot3d_multi/multi-bin.q"});
  EXPECT_EQ(c->description().coordinate_bytes, 8);
  for (const auto* source : {&ascii, &c, &fortran}) {
    EXPECT_EQ(dims((*source)->description()), "8x12x12 8x12x12");
    EXPECT_EQ((*source)->description().flow.size(), 2u);
    EXPECT_NEAR((*source)->description().flow[1].mach, 2.95, 1e-5);
    NodeArrays expected, found;
    const std::vector<uint32_t> scalars = {0, 4};
    for (uint32_t block = 0; block < 2; ++block) {
      fortran->read(block, {2, 9, 3, 12}, scalars, expected);
      (*source)->read(block, {2, 9, 3, 12}, scalars, found);
      ASSERT_EQ(found.x.size(), 8u * 7 * 9);
      for (size_t n = 0; n < found.x.size(); ++n) {
        ASSERT_NEAR(found.x[n], expected.x[n], 1e-5);
        ASSERT_NEAR(found.z[n], expected.z[n], 1e-5);
        ASSERT_NEAR(found.scalars[0][n], expected.scalars[0][n], 1e-4);
        ASSERT_NEAR(found.scalars[1][n], expected.scalars[1][n], 1e-4);
      }
    }
  }
}

TEST_F(RealFiles, WaveletInAscii) {
  const auto source = open("plot3d_multi/mbwavelet_ascii.xyz", {"plot3d_multi/mbwavelet_ascii.q"});
  EXPECT_EQ(dims(source->description()), "4x11x11 4x11x11 4x11x11");
  const Content content = readAll(*source);
  EXPECT_EQ(content.x.min, -5);
  EXPECT_NEAR(content.scalars[0].min, 60.7635, 30);
}

TEST_F(RealFiles, TwoDimensionalFilesAreRefused) {
  expectSays(errorOf("plot3d_multi/multi-bin-2D.xyz"), "2-D");
}

TEST_F(RealFiles, OverflowSolutionHasTheValuesOfThePlainOne) {
  const auto plain = open("plot3d_multi/multi-bin.xyz", {"plot3d_multi/multi-bin.q"});
  const auto overflow = open("plot3d_multi/multi-bin.xyz", {"plot3d_multi/multi-bin-oflow.q"});
  expectSays(overflow->description().format, "OVERFLOW Q solution");
  ASSERT_EQ(overflow->description().scalars.size(), 5u);
  ASSERT_EQ(overflow->description().flow.size(), 2u);
  EXPECT_NEAR(overflow->description().flow[1].mach, 2.95, 1e-5);
  EXPECT_EQ(overflow->description().flow[0].reynolds, plain->description().flow[0].reynolds);
  EXPECT_EQ(overflow->description().flow[0].time, plain->description().flow[0].time);
  NodeArrays expected, found;
  const std::vector<uint32_t> scalars{0, 1, 2, 3, 4};
  for (uint32_t block = 0; block < 2; ++block) {
    plain->read(block, {0, 12, 0, 12}, scalars, expected);
    overflow->read(block, {0, 12, 0, 12}, scalars, found);
    EXPECT_EQ(found.scalars, expected.scalars);
  }
}

TEST_F(RealFiles, MetaFileNamesItsFiles) {
  const auto source = open("plot3d_multi/multi.p3d");
  EXPECT_EQ(dims(source->description()), "8x12x12 8x12x12");
  EXPECT_EQ(source->description().scalars.size(), 5u);
  ASSERT_EQ(source->description().warnings.size(), 1u);
  expectSays(source->description().warnings[0], "multi-bin.f, which does not exist");
  expectSays(errorOf("plot3d_multi/test.p3d"), "combxyz.bin, which does not exist");
}

TEST_F(RealFiles, NekFunctionFile) {
  const auto source = open("nek/Combined_PressureSide_Block.xyz", {"nek/pressure.fun"});
  const GridDescription& description = source->description();
  EXPECT_EQ(dims(description), "61x10x151");
  ASSERT_EQ(description.scalars.size(), 4u);
  EXPECT_EQ(description.scalars[3].name, "4");
  EXPECT_EQ(description.scalars[3].number, 4u);
  EXPECT_EQ(readAll(*source).nodes, 92'110u);
}

TEST_F(RealFiles, NekLeadingEdgeHasAMalformedFunctionFile) {
  const auto source = open("nek/leadingEdge_block.xyz");
  EXPECT_EQ(source->description().blocks.size(), 1'080u);
  EXPECT_EQ(readAll(*source).nodes, 1'080u * 64);
  const std::string error = errorOf("nek/leadingEdge_block.xyz", {"nek/leadingEdge_block.fun"});
  expectSays(error, "number of variables is missing");
}

TEST_F(RealFiles, FortranBigEndianDuct) {
  const auto source = open("fortran/sduct.new.x.bin");
  EXPECT_EQ(dims(source->description()), "25x31x21 123x31x21");
  expectSays(source->description().format, "big-endian, Fortran (4-byte record markers), single precision");
  EXPECT_EQ(readAll(*source).blank.total(), 0u);
}

TEST_F(RealFiles, OversetInDoublePrecision) {
  for (const char* name : {"cylinder_chimera_abutting.x", "cylinder_chimera_overlapping_singledonor.x"}) {
    const auto source = open(std::string("overset/") + name);
    EXPECT_EQ(dims(source->description()), "25x25x9 25x25x9 25x25x9 25x25x9");
    EXPECT_EQ(source->description().coordinate_bytes, 8);
    EXPECT_EQ(readAll(*source).blank.total(), 0u);
  }
}

TEST_F(RealFiles, DeltaWingInAsciiWithRepeatCounts) {
  const auto source = open("delta_wing/delta_cfl3d.fmt");
  EXPECT_EQ(dims(source->description()), "37x65x65");
  EXPECT_EQ(source->description().coordinate_bytes, 8);
  NodeArrays nodes;
  source->read(0, {0, 1, 0, 1}, {}, nodes);
  EXPECT_EQ(nodes.x[0], -0.8);
  EXPECT_EQ(nodes.x[7], -2.641e-2);
  EXPECT_EQ(readAll(*source).nodes, 156'325u);
}

TEST_F(RealFiles, NorthSeaHasLandAndNames) {
  const auto source = open("nemo_northsea/nemo_northsea_u.xyz", {"nemo_northsea/nemo_northsea_u.fun"});
  const GridDescription& description = source->description();
  EXPECT_EQ(dims(description), "151x201x75");
  ASSERT_EQ(description.scalars.size(), 2u);
  EXPECT_EQ(description.scalars[0].name, "uo");
  EXPECT_EQ(description.scalars[1].name, "depth");
  EXPECT_EQ(scalarsNamed(description, {"2", "uo"}), (std::vector<uint32_t>{1, 0}));
  const Content content = readAll(*source);
  EXPECT_EQ(content.blank.by_grid, 1'375'206u);
  EXPECT_EQ(content.blank.not_finite, 0u);
  EXPECT_NEAR(content.scalars[0].min, -0.984, 1e-3);
  EXPECT_NEAR(content.scalars[0].max, 0.651, 1e-3);
}

TEST_F(RealFiles, SolutionOfAnotherGridNamesBoth) {
  const std::string error = errorOf("bluntfin/bluntfinxyz.bin", {"lox_post/postq.bin"});
  expectSays(error, "38x76x38");
  expectSays(error, "40x32x32");
  const std::string blocks = errorOf("plot3d_multi/multi-bin.xyz", {"plot3d_multi/mbwavelet_ascii.q"});
  expectSays(blocks, "3 blocks");
  expectSays(blocks, "2 blocks");
}

TEST_F(RealFiles, ForeignFilesAreNamed) {
  expectSays(errorOf("bluntfin/bluntfinxyz.bin", {"vtk/SampleStructGrid.vtk"}), "legacy VTK");
  expectSays(errorOf("bluntfin/bluntfinxyz.bin", {"vtk/StructuredGrid.vts"}), "XML");
  expectSays(errorOf("bluntfin/bluntfinxyz.bin", {"cgns/sqnz_s.adf.cgns"}), "ADF");
  expectSays(errorOf("bluntfin/bluntfinxyz.bin", {"cgns/sqnz_s.hdf.cgns"}), "HDF5");
  expectSays(errorOf("README.md"), "expected a number");
  expectSays(errorOf("bluntfin"), "is a directory");
  expectSays(errorOf("bluntfin/missing.xyz"), "cannot be opened");
}

TEST_F(RealFiles, ASolutionIsRefusedAsAGrid) {
  const std::string error = errorOf("bluntfin/bluntfinq.bin");
  expectSays(error, "looks like a solution without its grid (a Q solution of 1 block of 40x32x32");
  expectSays(error, "choose its grid, too");
}

}  // namespace
}  // namespace curvisplat
