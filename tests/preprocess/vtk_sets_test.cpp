// Sets of VTK files: pieces that overlap, blocks that lack arrays, files that name one another.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/survey/block_overlap.h"
#include "preprocess/survey/grid_statistics.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/expect_error.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/grid_nodes.h"
#include "tests/support/vts_writer.h"

namespace curvisplat {
namespace {

using test::TestFolder;

std::unique_ptr<GridSource> openVtkSet(const std::filesystem::path& path) {
  OpenGridOptions options;
  options.grid = path;
  options.temporary_folder = path.parent_path();
  return openGrid(options);
}

std::string setError(const std::filesystem::path& path) {
  return curvisplat::errorOf([&] { openVtkSet(path); });
}

std::string setOf(const std::string& type, const std::string& content, const std::string& attributes = "") {
  return "<VTKFile type=\"" + type + "\"><" + type + " " + attributes + ">" + content + "</" + type +
         "></VTKFile>\n";
}

/// How many of the parts each cell of `whole` is in.
void expectPartition(const std::vector<VtkExtent>& pieces) {
  const auto owned = ownedParts(pieces);
  ASSERT_EQ(owned.size(), pieces.size());
  std::map<std::array<int64_t, 3>, int> covered;
  const auto forCells = [](const VtkExtent& box, const auto& visit) {
    for (int64_t k = box.lower[2]; k < box.upper[2]; ++k)
      for (int64_t j = box.lower[1]; j < box.upper[1]; ++j)
        for (int64_t i = box.lower[0]; i < box.upper[0]; ++i) visit({i, j, k});
  };
  for (size_t n = 0; n < pieces.size(); ++n)
    for (const VtkExtent& part : owned[n]) {
      EXPECT_FALSE(part.isFlat());
      for (size_t axis = 0; axis < 3; ++axis) {
        EXPECT_GE(part.lower[axis], pieces[n].lower[axis]);
        EXPECT_LE(part.upper[axis], pieces[n].upper[axis]);
      }
      forCells(part, [&](const std::array<int64_t, 3>& cell) { ++covered[cell]; });
    }
  size_t cells = 0;
  for (const VtkExtent& piece : pieces)
    forCells(piece, [&](const std::array<int64_t, 3>& cell) {
      cells += covered.count(cell);
      ASSERT_EQ(covered[cell], 1);
    });
  EXPECT_GT(cells, 0u);
}

TEST(VtkSets, EachCellOfOverlappingPiecesIsOwnedOnce) {
  expectPartition(
      {{{0, 0, 0}, {5, 4, 6}}, {{0, 2, 0}, {5, 7, 6}}, {{3, 0, 0}, {8, 4, 6}}, {{3, 2, 0}, {8, 7, 6}}});
  expectPartition({{{0, 0, 0}, {4, 4, 4}}, {{0, 0, 0}, {4, 4, 4}}});
  std::mt19937_64 random(7);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<VtkExtent> pieces(1 + random() % 5);
    for (VtkExtent& piece : pieces)
      for (size_t axis = 0; axis < 3; ++axis) {
        piece.lower[axis] = static_cast<int64_t>(random() % 8) - 3;
        piece.upper[axis] = piece.lower[axis] + 1 + static_cast<int64_t>(random() % 6);
      }
    expectPartition(pieces);
  }
  EXPECT_EQ(ownedParts({{{0, 0, 0}, {4, 4, 4}}, {{1, 1, 1}, {3, 3, 3}}})[1].size(), 0u);
}

/// A grid of 9x8x7 nodes in eight pieces, each with one more layer of its neighbours' cells.
std::filesystem::path writePieces(const TestFolder& folder) {
  const VtsEncoding encoding{VtsEncoding::Format::kAppendedBase64, VtsEncoding::Compressor::kZlib, 4, false,
                             500};
  std::string pieces;
  for (int n = 0; n < 8; ++n) {
    const std::array<int64_t, 3> size = {9, 8, 7}, middle = {4, 3, 2};
    std::array<int64_t, 3> lower{}, upper{};
    for (size_t axis = 0; axis < 3; ++axis) {
      const bool second = n >> axis & 1;
      lower[axis] = second ? middle[axis] - 1 : 0;
      upper[axis] = second ? size[axis] - 1 : middle[axis] + 1;
    }
    const VtsGrid grid =
        annulusVtsGrid(upper[0] - lower[0] + 1, upper[1] - lower[1] + 1, upper[2] - lower[2] + 1, lower);
    const std::string name = "piece" + std::to_string(n) + ".vts";
    folder.write(name, vtsFile(grid, encoding));
    pieces += fmt::format("<Piece Extent=\"{}\" Source=\"{}\"/>", fmt::join(grid.extent, " "), name);
  }
  return folder.write(
      "grid.pvts", setOf("PStructuredGrid", pieces + "<Piece Extent=\"0 -1 0 -1 0 -1\" Source=\"none.vts\"/>",
                         "WholeExtent=\"0 8 0 7 0 6\" GhostLevel=\"1\""));
}

ConvertReport convertPressure(const std::filesystem::path& output, const GridSource& source) {
  ConvertOptions options;
  options.output = output;
  options.scalars = scalarsNamed(source.description(), {"p"});
  Progress progress;
  return convert(source, options, progress);
}

TEST(VtkSets, PiecesConvertAsTheWholeGridDoes) {
  const TestFolder folder("pvts");
  const auto pieces = openVtkSet(writePieces(folder));
  EXPECT_EQ(pieces->description().blocks.size(), 8u);
  EXPECT_EQ(pieces->description().files.size(), 9u);
  const auto whole = openVtkSet(folder.write("whole.vts", vtsFile(annulusVtsGrid(9, 8, 7), {})));
  const ConvertReport in_pieces = convertPressure(folder.path() / "pieces.splats", *pieces);
  const ConvertReport at_once = convertPressure(folder.path() / "whole.splats", *whole);
  // Coincident nodes of the seams have merged.
  EXPECT_EQ(in_pieces.splats, at_once.splats);
  EXPECT_EQ(in_pieces.splats, 9u * 8 * 7);
  EXPECT_GT(in_pieces.merged_nodes, 0u);
  EXPECT_NEAR(in_pieces.volume, at_once.volume, 1e-4 * at_once.volume);
}

TEST(VtkSets, PiecesElsewhereThanTheyShouldBeAreRefused) {
  const TestFolder folder("pvts-elsewhere");
  folder.write("a.vts", vtsFile(annulusVtsGrid(4, 4, 4), {}));
  const auto written = [&](const char* piece) {
    return setError(folder.write("grid.pvts", setOf("PStructuredGrid", piece)));
  };
  EXPECT_EQ(written("<Piece Extent='0 3 0 3 0 3' Source='a.vts'/>"), "");
  expectSays(written("<Piece Extent='0 3 0 3 0 2' Source='a.vts'/>"), "a.vts: has a piece of 4x4x4 nodes");
  expectSays(written("<Piece Extent='0 3 0 3 0 3' Source='b.vts'/>"), "b.vts");
  expectSays(written("<Piece Extent='0 3 0 3 0 3'/>"), "without Source");
  expectSays(written(""), "no structured grid");
  folder.write("a.vts", setOf("RectilinearGrid", ""));
  expectSays(written("<Piece Extent='0 3 0 3 0 3' Source='a.vts'/>"), "but belongs to a PStructuredGrid");
}

TEST(VtkSets, BlocksAreNamedByTheirPlaceInTheTree) {
  const TestFolder folder("vtm");
  folder.write("a.vts", vtsFile(annulusVtsGrid(4, 4, 4), {}));
  folder.write("b.vts", vtsFile(annulusVtsGrid(3, 3, 3), {}));
  const auto source = openVtkSet(folder.write(
      "grid.vtm",
      setOf(
          "vtkMultiBlockDataSet",
          "<Block index='0' name='Base'><Block index='0'><DataSet index='0' name='Zone 1' "
          "file='a.vts'/></Block>"
          "<DataSet index='1' file='b.vts'/><DataSet index='2'/></Block><DataSet index='1' file='a.vts'/>")));
  std::vector<std::string> names;
  for (const GridBlock& block : source->description().blocks) names.push_back(block.name);
  EXPECT_EQ(names, (std::vector<std::string>{"Base/Zone 1", "Base/b", "a"}));
  EXPECT_EQ(allNodes(*source, 1).x.size(), 27u);
}

TEST(VtkSets, BlocksWithoutAnArrayAreBlankInIt) {
  const TestFolder folder("vtm-partial");
  VtsGrid grid = annulusVtsGrid(3, 3, 3);
  folder.write("a.vts", vtsFile(grid, {}));
  grid.point_data.erase(grid.point_data.begin());
  grid.point_data.push_back({"only b", "Int16", 1, std::vector<double>(27, 4)});
  folder.write("b.vts", vtsFile(grid, {}));
  const auto source = openVtkSet(folder.write(
      "grid.vtm", setOf("vtkMultiBlockDataSet", "<DataSet file='a.vts'/><DataSet file='b.vts'/>")));
  const GridDescription& description = source->description();
  ASSERT_EQ(description.warnings.size(), 2u);
  EXPECT_EQ(description.warnings[0], "1 of 2 blocks have no array p; they are not drawn with it");
  const uint32_t p = scalarsNamed(description, {"p"})[0], only_b = scalarsNamed(description, {"only b"})[0];
  EXPECT_TRUE(std::isfinite(allNodes(*source, 0).scalars[p][0]));
  EXPECT_TRUE(std::isnan(allNodes(*source, 1).scalars[p][26]));
  EXPECT_TRUE(std::isnan(allNodes(*source, 0).scalars[only_b][0]));
  EXPECT_EQ(allNodes(*source, 1).scalars[only_b][0], 4);
}

TEST(VtkSets, FlatBlocksAreLeftOut) {
  const TestFolder folder("vtm-flat");
  folder.write("a.vts", vtsFile(annulusVtsGrid(3, 3, 3), {}));
  VtsGrid flat = annulusVtsGrid(3, 3, 1);
  flat.cell_data[0].values.assign(4, 1);  // as VTK counts cells
  folder.write("flat.vts", vtsFile(flat, {}));
  const auto source = openVtkSet(folder.write(
      "grid.vtm", setOf("vtkMultiBlockDataSet", "<DataSet file='flat.vts'/><DataSet file='a.vts'/>")));
  EXPECT_EQ(source->description().blocks.size(), 1u);
  ASSERT_EQ(source->description().warnings.size(), 1u);
  EXPECT_EQ(source->description().warnings[0],
            "1 of 2 blocks are flat and left out, such as flat (3x3x1 nodes)");
  EXPECT_EQ(allNodes(*source, 0).x.size(), 27u);
  expectSays(setError(folder.path() / "flat.vts"), "block 1 (3x3x1 nodes) is flat");
}

TEST(VtkSets, FilesThatNameThemselvesAreRefused) {
  const TestFolder folder("vtm-cycle");
  folder.write("a.vtm", setOf("vtkMultiBlockDataSet", "<DataSet file='./b.vtm'/>"));
  const auto b = folder.write("b.vtm", setOf("vtkMultiBlockDataSet", "<DataSet file='a.vtm'/>"));
  expectSays(setError(b), "contains itself");
  const auto series = folder.write("c.pvd", setOf("Collection", "<DataSet timestep='0' file='d.pvd'/>"));
  folder.write("d.pvd", setOf("Collection", "<DataSet timestep='0' file='a.vts'/>"));
  expectSays(setError(series), "a time series inside another");
}

TEST(VtkSets, FilesThatNameOthersOverAndOverAreRefused) {
  const TestFolder folder("vtm-fan");
  // Ten levels, each of which names the next ten times.
  for (int level = 0; level < 10; ++level) {
    std::string members;
    for (int n = 0; n < 10; ++n) members += fmt::format("<DataSet file='{}.vtm'/>", level + 1);
    folder.write(fmt::format("{}.vtm", level), setOf("vtkMultiBlockDataSet", members));
  }
  folder.write("10.vtm", setOf("vtkMultiBlockDataSet", ""));
  expectSays(setError(folder.path() / "0.vtm"), "refers to more than 100000 files");
}

/// Counts for `info` of a set that names one file `times` times: opened files, and reads.
std::pair<int64_t, int64_t> readForInfo(const TestFolder& folder, int times) {
  std::string members;
  for (int n = 0; n < times; ++n) members += "<DataSet file='one.vts'/>";
  const auto path = folder.write("set.vtm", setOf("vtkMultiBlockDataSet", members));
  faults::FaultySystemCalls counting;
  const ScopedSystemCalls scope(counting);
  const auto source = openVtkSet(path);
  Progress progress;
  EXPECT_EQ(measureGrid(*source, {0}, 32 << 20, progress).cells(), static_cast<uint64_t>(times));
  EXPECT_FALSE(findOverlaps(*source, {32 << 20, 128 << 20}, progress).empty());
  return {counting.calls - counting.reads, counting.reads};
}

TEST(VtkSets, OfOneFileThousandsOfTimesAreMeasuredInReadsThatGrowAsTheSet) {
  const TestFolder folder("vtm-one");
  folder.write("one.vts", vtsFile(annulusVtsGrid(2, 2, 2), {}));
  constexpr int kFew = 150;
  const auto [few_others, few_reads] = readForInfo(folder, kFew);
  const auto [others, reads] = readForInfo(folder, 10 * kFew);
  EXPECT_LE(few_reads, 20 * kFew);
  EXPECT_LE(reads, 11 * few_reads);
  EXPECT_LE(others, few_others + 10);  // the file is opened once, not once a block
}

// More pieces than files can be open at once.
TEST(VtkSets, ManyPiecesNeedFewOpenFiles) {
  const TestFolder folder("vtm-many");
  std::string members;
  for (int n = 0; n < 200; ++n) {
    VtsGrid grid = annulusVtsGrid(2, 2, 2, {n, 0, 0});
    folder.write(std::to_string(n) + ".vts", vtsFile(grid, {}));
    members += fmt::format("<DataSet file='{}.vts'/>", n);
  }
  const auto source = openVtkSet(folder.write("grid.vtm", setOf("vtkMultiBlockDataSet", members)));
  for (uint32_t b = 0; b < 200; ++b)
    EXPECT_FLOAT_EQ(static_cast<float>(allNodes(*source, b).x[0]), static_cast<float>(-std::sin(0.1 * b)));
  const auto files = std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
  EXPECT_LT(files, 100);
}

TEST(VtkSets, AStepThatWasNotChosenIsReported) {
  GridDescription description;
  EXPECT_FALSE(timeStepNote(description, std::nullopt));
  description.times = {0, 1, 2.5};
  EXPECT_EQ(timeStepNote(description, std::nullopt),
            "3 time steps from 0 to 2.5; using the first: choose with --time-step 0..2");
  EXPECT_FALSE(timeStepNote(description, 1));
}

}  // namespace
}  // namespace curvisplat
