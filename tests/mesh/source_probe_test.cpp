// Values of a grid's own cells at points: across seams, where the cache has one of two coincident nodes, and in meshes of any pieces.
#include "preprocess/probe/source_probe.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "tests/reference/array_mesh.h"
#include "tests/reference/function_grid.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

const std::vector<uint32_t> kFirst{0};
const std::vector<ValueRange> kAll{{-1e30, 1e30}};

double linear(const glm::dvec3& x) {
  return 1 + 2 * x.x - 3 * x.y + 0.5 * x.z;
}

TEST(SourceProbe, FindsTheCellAcrossASeam) {
  // A ring whose last nodes around are the first ones again, and a second block that goes on above it.
  const auto place = [](double i, double j, double k) {
    const double phi = 2 * std::numbers::pi * std::fmod(j, 24) / 24;
    return glm::dvec3((1 + 0.1 * i) * std::cos(phi), (1 + 0.1 * i) * std::sin(phi), k);
  };
  const FunctionGridSource grid({gridBlock(5, 25, 4), gridBlock(5, 25, 3)}, 1, [&](const GridNode& n) {
    const glm::dvec3 at = place(static_cast<double>(n.i), static_cast<double>(n.j),
                                static_cast<double>(n.k) + (n.block == 1 ? 3 : 0));
    return NodeValues{at, {static_cast<float>(linear(at))}, false};
  });
  const auto middleOf = [&](double j, double k) {
    glm::dvec3 sum(0.0);
    for (int c = 0; c < 8; ++c) sum += 0.125 * place(2 + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
    return sum;
  };
  const std::vector<glm::dvec3> points{
      middleOf(23, 1), middleOf(12, 3), middleOf(5, 1), {3, 0, 1}, {0, 0, 1}};
  // The nodes that a cache may have near them: that at the seam's other side, that of the other block, the cell's own.
  const std::vector<std::vector<NearSample>> near{
      {{0, {2, 0, 1}}}, {{0, {2, 12, 3}}}, {{0, {2, 5, 1}}}, {{0, {4, 0, 1}}}, {}};
  const auto found = probeGrid(grid, kFirst, kAll, points, near);
  for (size_t p = 0; p < 3; ++p) {
    ASSERT_TRUE(found[p]) << p;
    EXPECT_NEAR(found[p]->values[0], linear(points[p]), 1e-5) << p;
  }
  EXPECT_EQ(found[0]->block, 0u);
  EXPECT_GE(found[0]->at[1], 23u);
  EXPECT_EQ(found[1]->block, 1u);
  EXPECT_FALSE(found[3]) << "outside";
  EXPECT_FALSE(found[4]) << "in the hole, without a sample near it";
}

TEST(SourceProbe, AnswersInMeshesOfSeveralPieces) {
  const auto scene = makeScene("half-annulus");
  ArrayPiece piece = tetrahedraOf(*scene, 6, 4, 4);
  setValues(piece, linear);
  const ArrayMesh mesh(split(piece, 3, [](size_t cell) { return cell % 3; }));
  std::vector<glm::dvec3> points{{50, 0, 0}};
  for (size_t cell = 0; cell < piece.cells.size(); cell += 7) {
    glm::dvec3 middle(0.0);
    for (const uint64_t point : piece.cells.cornersOfCell(cell)) middle += 0.25 * piece.points[point];
    points.push_back(middle);
  }
  const TemporaryFolder folder;
  const auto found = probeMesh(mesh, kFirst, kAll, points, folder.path());
  EXPECT_FALSE(found[0]);
  for (size_t p = 1; p < points.size(); ++p) {
    ASSERT_TRUE(found[p]) << p;
    EXPECT_NEAR(found[p]->values[0], linear(points[p]), 1e-5);
    EXPECT_NEAR(found[p]->sample[0], linear(found[p]->place), 1e-5) << "the value of the point that is named";
  }
  EXPECT_FALSE(probeMesh(mesh, kFirst, std::vector<ValueRange>{{100, 200}}, points, folder.path())[1])
      << "values that are not in the cache";
}

TEST(SourceProbe, AnswersInMeshesWhereValuesAreConstant) {
  // Weights that do not add up to 1 to the last bit take 285 beyond the one value that there is.
  const auto scene = makeScene("half-annulus");
  ArrayPiece piece = tetrahedraOf(*scene, 6, 4, 4);
  setValues(piece, [](const glm::dvec3&) { return 285.0; });
  std::vector<glm::dvec3> points;
  constexpr std::array kWeights{0.71, 0.17, 0.09, 0.03};
  for (size_t cell = 0; cell < piece.cells.size(); ++cell) {
    const auto corners = piece.cells.cornersOfCell(cell);
    glm::dvec3 inside(0.0);
    for (size_t c = 0; c < 4; ++c) inside += kWeights[c] * piece.points[corners[c]];
    points.push_back(inside);
  }
  const TemporaryFolder folder;
  const std::vector<ValueRange> only{{285, 285}};
  const auto found = probeMesh(ArrayMesh({piece}), kFirst, only, points, folder.path());
  size_t rounded = 0;
  for (size_t p = 0; p < points.size(); ++p) {
    ASSERT_TRUE(found[p]) << p;
    EXPECT_NEAR(found[p]->values[0], 285, 1e-10);
    EXPECT_EQ(found[p]->sample[0], 285);
    rounded += found[p]->values[0] != 285;
  }
  EXPECT_GT(rounded, 0u);
}

TEST(SourceProbe, AnswersWithTheCellsOwnValue) {
  ArrayPiece piece = hexahedraOf(*makeScene("half-annulus"), 6, 4, 4);
  setValues(piece, linear);
  const ArrayMesh mesh({piece});
  uint32_t of_cells = 0;
  while (mesh.description().scalars[of_cells].centring != Centring::kCell) ++of_cells;
  std::vector<glm::dvec3> points;
  for (size_t cell = 0; cell < piece.cells.size(); ++cell) {
    glm::dvec3 middle(0.0);
    for (const uint64_t point : piece.cells.cornersOfCell(cell)) middle += 0.125 * piece.points[point];
    points.push_back(middle);
  }
  const TemporaryFolder folder;
  const auto found = probeMesh(mesh, std::vector<uint32_t>{of_cells}, kAll, points, folder.path());
  for (size_t p = 0; p < points.size(); ++p) {
    ASSERT_TRUE(found[p]);
    EXPECT_EQ(found[p]->at[0], p);
    EXPECT_EQ(found[p]->values[0], double{piece.cell_values[p]});
  }
}

}  // namespace
}  // namespace curvisplat
