// Meshes whose cells are cut into halves along each edge.
#include "preprocess/gather/halved_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "preprocess/moments/cell_moments.h"
#include "tests/reference/array_mesh.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

constexpr std::array<uint32_t, 1> kOfPoints{0}, kOfCells{1};

/// All of a piece, with the scalar "f" at points and "c" in cells.
struct Whole {
  MeshPoints points;
  MeshCells cells;

  explicit Whole(const MeshSource& mesh, uint32_t piece = 0) {
    const MeshPiece& of = mesh.description().pieces[piece];
    mesh.readPoints(piece, 0, of.points, kOfPoints, points);
    mesh.readCells(piece, 0, of.cells, kOfCells, cells);
  }
  glm::dvec3 place(uint64_t n) const { return {points.x[n], points.y[n], points.z[n]}; }
  CellBody body(size_t cell) const {
    std::vector<glm::dvec3> corners;
    for (const uint64_t n : cells.cornersOfCell(cell)) corners.push_back(place(n));
    return bodyOf({cells.shapes[cell], corners, {}, cells.facesOfCell(cell)});
  }
  double volume() const {
    double sum = 0;
    for (size_t n = 0; n < cells.size(); ++n) sum += body(n).volume;
    return sum;
  }
};

std::unique_ptr<MeshSource> halvedOf(std::vector<ArrayPiece> pieces, std::optional<double> blank_value = {}) {
  return halved(std::make_unique<ArrayMesh>(std::move(pieces)), blank_value);
}

double linear(const glm::dvec3& p) {
  return 1 + 2 * p.x - 3 * p.y + 0.5 * p.z;
}

/// n³ hexahedra of the unit cube.
ArrayPiece evenCube(uint64_t n) {
  std::vector<Box> boxes;
  for (uint64_t i = 0; i < n * n * n; ++i) boxes.push_back({{i % n, i / n % n, i / n / n}, 1});
  ArrayPiece piece = boxesOf(boxes);
  setValues(piece, linear);
  return piece;
}

TEST(HalvedMesh, PartsOfEveryShapeFillTheCellAndCarryLinearFields) {
  const std::vector<glm::dvec3> corners{{0, 0, 0}, {2, 0.1, 0},   {2.2, 1.9, 0.1}, {-0.1, 2, 0},
                                        {0, 0, 2}, {1.7, 0, 2.1}, {2, 2, 2.5},     {0, 1.8, 2}};
  for (const auto& [shape, numbers] :
       std::map<CellKind, std::vector<uint64_t>>{{CellKind::kTetrahedron, {0, 1, 3, 4}},
                                                 {CellKind::kPyramid, {0, 1, 2, 3, 4}},
                                                 {CellKind::kWedge, {0, 1, 3, 4, 5, 7}},
                                                 {CellKind::kHexahedron, {0, 1, 2, 3, 4, 5, 6, 7}}}) {
    ArrayPiece piece;
    piece.points = corners;
    piece.cells.append(shape, numbers);
    setValues(piece, linear);
    const double volume = Whole(ArrayMesh({piece})).volume();
    const Whole parts(*halvedOf({piece}));
    EXPECT_EQ(parts.cells.size(), shape == CellKind::kPyramid ? 10u : 8u);
    // Faces of four corners bend, so that parts of the cells differ in the third order.
    EXPECT_NEAR(parts.volume() / volume, 1, shape == CellKind::kTetrahedron ? 1e-12 : 2e-3);
    for (size_t n = 0; n < parts.points.x.size(); ++n)
      EXPECT_NEAR(parts.points.scalars[0][n], linear(parts.place(n)), 1e-6);
    for (size_t n = 0; n < parts.cells.size(); ++n)
      EXPECT_EQ(parts.cells.scalars[0][n], piece.cell_values[0]) << "there is no neighbour";
  }
}

TEST(HalvedMesh, CellsShareTheNewPointsAndTakeTheirSlopeFromTheirNeighbours) {
  const ArrayPiece cube = evenCube(4);
  const auto mesh = halvedOf({cube});
  const Whole parts(*mesh);
  EXPECT_EQ(parts.points.x.size(), 9u * 9 * 9);
  ASSERT_EQ(parts.cells.size(), 8u * 64);
  double sum = 0;
  for (size_t n = 0; n < parts.cells.size(); ++n) {
    const glm::dvec3 middle = parts.body(n).centre;
    const bool is_inside =
        glm::all(glm::greaterThan(middle, glm::dvec3(1))) && glm::all(glm::lessThan(middle, glm::dvec3(3)));
    if (is_inside) {
      EXPECT_NEAR(parts.cells.scalars[0][n], linear(middle), 1e-5);
    }
    sum += parts.cells.scalars[0][n] / 8;
  }
  EXPECT_NEAR(sum, std::accumulate(cube.cell_values.begin(), cube.cell_values.end(), 0.0), 1e-3);
  // Ranges are those of the whole.
  MeshPoints points;
  MeshCells cells;
  for (uint64_t first = 0; first < parts.cells.size(); first += 37) {
    const uint64_t count = std::min<uint64_t>(37, parts.cells.size() - first);
    mesh->readCells(0, first, count, kOfCells, cells);
    mesh->readPoints(0, first, count, kOfPoints, points);
    for (size_t n = 0; n < count; ++n) {
      EXPECT_TRUE(std::ranges::equal(cells.cornersOfCell(n), parts.cells.cornersOfCell(first + n)));
      EXPECT_EQ(cells.scalars[0][n], parts.cells.scalars[0][first + n]);
      EXPECT_EQ(points.x[n], parts.points.x[first + n]);
      EXPECT_EQ(points.scalars[0][n], parts.points.scalars[0][first + n]);
    }
  }
}

TEST(HalvedMesh, NodesThatHangAreTheMiddlesOfLargerCells) {
  const Whole parts(*halvedOf({partedCube(4)}));
  std::set<std::array<double, 3>> places;
  for (size_t n = 0; n < parts.points.x.size(); ++n)
    places.insert({parts.points.x[n], parts.points.y[n], parts.points.z[n]});
  EXPECT_EQ(places.size(), parts.points.x.size());
}

/// Hexahedra of 20 nodes that a file calls hexahedra of 8: nothing has been computed at the others.
TEST(HalvedMesh, PointsOfNoCellAreNoMiddles) {
  ArrayPiece cube = evenCube(2);
  const size_t corners = cube.points.size();
  cube.points.emplace_back(0.5, 0.0, 0.0);
  cube.point_values.push_back(NAN);
  const Whole parts(*halvedOf({cube}));
  EXPECT_EQ(parts.points.x.size(), corners + 1 + 98);  // 5^3 nodes of the halves, without 3^3
  for (const uint64_t corner : parts.cells.cornersOfCell(0)) EXPECT_NE(corner, corners);
}

TEST(HalvedMesh, NodesThatHangAreFoundWhereverSinglePrecisionRoundsThem) {
  const size_t points = Whole(*halvedOf({partedCube(2)})).points.x.size();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> part(-1, 1);
  for (int n = 0; n < 200; ++n) {
    const glm::dvec3 to(3 * part(random), 3 * part(random), 3 * part(random));
    const double size = std::exp(part(random));
    ArrayPiece cube = partedCube(2);
    for (glm::dvec3& point : cube.points) point = glm::dvec3(glm::vec3(to + size * point));
    EXPECT_EQ(Whole(*halvedOf({cube})).points.x.size(), points) << to.x << ' ' << size;
  }
}

TEST(HalvedMesh, CornersOfThinLayersFarFromTheOriginAreNoMiddles) {
  ArrayPiece cube =
      evenCube(2);  // metres of a map, in layers that are thinner than single precision's steps there
  for (glm::dvec3& point : cube.points) point = glm::dvec3(4e5, 5.5e6, 0) + glm::dvec3(100, 100, 0.1) * point;
  const Whole parts(*halvedOf({cube}));
  EXPECT_EQ(parts.points.x.size(), 5u * 5 * 5);
  EXPECT_NEAR(parts.volume(), 200 * 200 * 0.2, 1);
}

TEST(HalvedMesh, ThinWallsStayWalls) {
  // Two cubes with points of their own where they meet.
  ArrayPiece piece = evenCube(1), other = evenCube(1);
  for (glm::dvec3& point : other.points) point.x += 1;
  std::vector<uint64_t> corners;
  for (const uint64_t n : other.cells.cornersOfCell(0)) corners.push_back(n + 8);
  piece.points.insert(piece.points.end(), other.points.begin(), other.points.end());
  piece.cells.append(CellKind::kHexahedron, corners);
  setValues(piece, linear);
  EXPECT_EQ(Whole(*halvedOf({piece})).points.x.size(), 2u * 27);
}

TEST(HalvedMesh, PiecesHaveTheBitsOfTheWhole) {
  ArrayPiece ball = shuffled(evenCube(3), 5);
  for (glm::dvec3& point : ball.points)
    point = glm::normalize(point + glm::dvec3(0.7, 0.3, 0.1)) * glm::length(point);
  std::set<std::array<double, 3>> of_whole, of_pieces;
  const auto add = [](const Whole& parts, std::set<std::array<double, 3>>& places) {
    for (size_t n = 0; n < parts.points.x.size(); ++n)
      places.insert({parts.points.x[n], parts.points.y[n], parts.points.z[n]});
  };
  add(Whole(*halvedOf({ball})), of_whole);
  const auto pieces = halvedOf(split(ball, 3, [](size_t cell) { return cell % 3; }));
  for (uint32_t piece = 0; piece < 3; ++piece) add(Whole(*pieces, piece), of_pieces);
  EXPECT_EQ(of_whole, of_pieces);
}

TEST(HalvedMesh, MiddlesOfSamplesWithoutAValueHaveNone) {
  ArrayPiece cube = evenCube(2);
  cube.point_values[0] = -999;
  cube.cell_values[0] = -999;
  const Whole parts(*halvedOf({cube}, -999));
  size_t without = 0;
  for (const float value : parts.points.scalars[0]) {
    without += std::isnan(value);
    EXPECT_TRUE(std::isnan(value) || value == -999 || value > -10) << value;
  }
  EXPECT_EQ(without, 7u) << "3 edges, 3 faces and a hexahedron";
  EXPECT_EQ(std::ranges::count(parts.cells.scalars[0], -999.0f), 8);
  for (const float value : parts.cells.scalars[0]) EXPECT_TRUE(value == -999 || value > -10) << value;
}

TEST(HalvedMesh, ValuesStayAmongThoseOfTheNeighbours) {
  ArrayPiece row = boxesOf({{{0, 0, 0}, 1}, {{1, 0, 0}, 1}, {{2, 0, 0}, 1}, {{3, 0, 0}, 1}});
  row.cell_values = {0, 0, 10, 0};  // a step, and the largest of all
  const Whole parts(*halvedOf({row}));
  for (size_t n = 0; n < parts.cells.size(); ++n) {
    EXPECT_GE(parts.cells.scalars[0][n], 0);
    EXPECT_LE(parts.cells.scalars[0][n], 10);
    EXPECT_EQ(parts.cells.scalars[0][n] == 10, n / 8 == 2) << n;
  }
}

TEST(HalvedMesh, IsNeededWhereFewCellsDifferFromThoseBesideThem) {
  EXPECT_FALSE(isHalvedByNeed(ArrayMesh({evenCube(4)})));
  EXPECT_TRUE(isHalvedByNeed(ArrayMesh({partedCube(4)})));
  ArrayPiece bent = evenCube(4);
  for (glm::dvec3& point : bent.points) point.x = std::pow(1.1, point.x);
  EXPECT_TRUE(isHalvedByNeed(ArrayMesh({bent})));
  ArrayPiece many = evenCube(32);  // 32,768 cells
  for (glm::dvec3& point : many.points) point.x = std::pow(1.1, point.x);
  EXPECT_FALSE(isHalvedByNeed(ArrayMesh({many})));
}

TEST(HalvedMesh, OfVeryManyCellsIsRefused) {
  EXPECT_EQ(errorOf([] { halvedOf({evenCube(47)}); }),
            "mesh: has 103823 cells; unstructured grids of up to 100000 cells can be refined");
}

}  // namespace
}  // namespace curvisplat
