// Isosurfaces of cells of every kind: closed, where they have to be, on the surface of the closed form or of VTK's contour, and the same
// however the grid is read.
#include "preprocess/contour/contour.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "tests/reference/array_mesh.h"
#include "tests/reference/function_grid.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

struct Triangles : TriangleSink {
  std::vector<glm::dvec3> at;
  std::vector<glm::vec3> normals;
  std::vector<std::array<uint32_t, 3>> corners;

  void addVertex(const glm::dvec3& place, const glm::vec3& normal) override {
    at.push_back(place);
    normals.push_back(normal);
  }
  void addTriangle(const std::array<uint32_t, 3>& triangle) override { corners.push_back(triangle); }

  glm::dvec3 normalOf(const std::array<uint32_t, 3>& t) const {
    return 0.5 * glm::cross(at.at(t[1]) - at.at(t[0]), at.at(t[2]) - at.at(t[0]));
  }
  double area() const {
    double sum = 0;
    for (const auto& triangle : corners) sum += glm::length(normalOf(triangle));
    return sum;
  }
  /// The edges of one triangle alone. No edge may be there twice in the same direction.
  std::vector<std::pair<uint32_t, uint32_t>> openEdges() const {
    std::map<std::pair<uint32_t, uint32_t>, int> edges;
    for (const auto& t : corners)
      for (size_t n = 0; n < 3; ++n) ++edges[{t[n], t[(n + 1) % 3]}];
    std::vector<std::pair<uint32_t, uint32_t>> open;
    for (const auto& [edge, count] : edges) {
      EXPECT_EQ(count, 1);
      if (!edges.contains({edge.second, edge.first})) open.push_back(edge);
    }
    return open;
  }
};

using Field = std::function<double(const glm::dvec3&)>;
using Place = std::function<glm::dvec3(double i, double j, double k)>;

FunctionGridSource gridOf(const GridBlock& size, const Place& place, const Field& field,
                          const std::function<bool(const GridNode&)>& blank = {}) {
  return {{size}, 1, [=](const GridNode& n) {
            const glm::dvec3 at =
                place(static_cast<double>(n.i), static_cast<double>(n.j), static_cast<double>(n.k));
            return NodeValues{at, {static_cast<float>(field(at))}, blank && blank(n)};
          }};
}

ContourOptions optionsFor(double value) {
  ContourOptions options;
  options.value = value;
  options.lower = -1e30;
  options.upper = 1e30;
  return options;
}

Triangles contourOf(const GridSource& grid, double value) {
  Triangles found;
  Progress progress;
  contourGrid(grid, optionsFor(value), found, progress);
  return found;
}
Triangles contourOf(const MeshSource& mesh, double value) {
  const TemporaryFolder folder;
  Triangles found;
  Progress progress;
  contourMesh(mesh, optionsFor(value), folder.path(), found, progress);
  return found;
}

TEST(Contour, LosesNothingInThinLayersAtAWall) {
  // Layers around half a cylinder, the first a thousandth as thick as the last. The figures are those of VTK 9.1's contour of this grid.
  GridBlock size = gridBlock(17, 13, 11);
  const Place place = [](double i, double j, double k) {
    const double phi = std::numbers::pi * i / 16, r = 1 + std::exp2(k - 10);
    return glm::dvec3(r * std::cos(phi), r * std::sin(phi), j / 6);
  };
  const FunctionGridSource grid({size}, 1, [&](const GridNode& n) {
    const double phi = std::numbers::pi * static_cast<double>(n.i) / 16, z = static_cast<double>(n.j) / 6;
    const glm::dvec3 at = place(static_cast<double>(n.i), static_cast<double>(n.j), static_cast<double>(n.k));
    return NodeValues{
        at,
        {static_cast<float>(static_cast<double>(n.k) + 0.5 * std::sin(2 * phi) * std::cos(3 * z))},
        false};
  });
  const struct {
    double value;
    size_t triangles, vertices;
    double area;
  } of_vtk[] = {{1.3, 452, 257, 6.289104262}, {2.5, 384, 221, 6.309892088}, {8.7, 452, 257, 9.196485036}};
  for (const auto& expected : of_vtk) {
    const Triangles found = contourOf(grid, expected.value);
    EXPECT_EQ(found.corners.size(), expected.triangles) << expected.value;
    EXPECT_EQ(found.at.size(), expected.vertices) << expected.value;
    EXPECT_NEAR(found.area(), expected.area, 2e-4 * expected.area) << expected.value;
  }
}

TEST(Contour, OfASphereIsClosedAndFacesSmallerValues) {
  const Place place = [](double i, double j, double k) {
    return glm::dvec3(i, j, k) / 12.0 - glm::dvec3(1.0);
  };
  const FunctionGridSource grid =
      gridOf(gridBlock(25, 25, 25), place, [](const glm::dvec3& x) { return -glm::length(x); });
  const Triangles found = contourOf(grid, -0.75);  // some nodes have exactly this value
  EXPECT_TRUE(found.openEdges().empty());
  EXPECT_EQ(found.at.size() + found.corners.size() - 3 * found.corners.size() / 2, 2u)
      << "vertices + faces - edges";
  EXPECT_NEAR(found.area(), 4 * std::numbers::pi * 0.75 * 0.75, 0.05);
  for (const auto& triangle : found.corners)
    EXPECT_GT(glm::dot(found.normalOf(triangle), found.at[triangle[0]]), 0);
  for (size_t n = 0; n < found.at.size(); ++n)
    EXPECT_GT(glm::dot(glm::dvec3(found.normals[n]), glm::normalize(found.at[n])), 0.97);
}

TEST(Contour, HasNoGapsWhereValuesAreWild) {
  // Values at random: faces that are crossed at all four edges, next to cells of any kind.
  const Place place = [](double i, double j, double k) { return glm::dvec3(i, j, k); };
  const Field wild = [](const glm::dvec3& x) {
    const double s = std::sin(12.9898 * x.x + 78.233 * x.y + 37.719 * x.z) * 43758.5453;
    return s - std::floor(s) - 0.5;
  };
  const auto isAtBorder = [](const glm::dvec3& x) {
    return std::min({x.x, x.y, x.z}) == 0 || std::max({x.x, x.y, x.z}) == 9;
  };
  const Triangles found = contourOf(gridOf(gridBlock(10, 10, 10), place, wild), 0);
  EXPECT_GT(found.corners.size(), 1000u);
  for (const auto& [a, b] : found.openEdges())
    EXPECT_TRUE(isAtBorder(found.at[a]) && isAtBorder(found.at[b]));
}

TEST(Contour, IsTheSameAcrossSlabs) {
  // Blocks of several slabs: of whole planes, of strips of rows, of parts of rows.
  const GridBlock sizes[] = {gridBlock(100, 60, 60), gridBlock(40, 1700, 7), gridBlock(75000, 3, 3)};
  for (const GridBlock& size : sizes) {
    const glm::dvec3 last(size.ni - 1, size.nj - 1, size.nk - 1);
    const auto isInside = [&](const glm::dvec3& p, const glm::dvec3& q) {
      for (int axis = 0; axis < 3; ++axis)
        if ((p[axis] == 0 && q[axis] == 0) || (p[axis] == last[axis] && q[axis] == last[axis])) return false;
      return true;
    };
    const Field waves = [&](const glm::dvec3& x) {
      return (x.x / last.x - 0.5) + 0.3 * std::sin(0.9 * x.y) + 0.2 * std::cos(0.7 * x.z) +
             0.1 * std::sin(0.3 * x.x);
    };
    const Place place = [](double i, double j, double k) { return glm::dvec3(i, j, k); };
    const Triangles found = contourOf(gridOf(size, place, waves), 0.02);
    EXPECT_EQ(found.at.size(), found.normals.size());
    EXPECT_GT(found.corners.size(), 500u);
    size_t inside = 0;
    for (const auto& [a, b] : found.openEdges())
      inside += static_cast<size_t>(isInside(found.at[a], found.at[b]));
    EXPECT_EQ(inside, 0u) << size.ni;
    for (const auto& triangle : found.corners)
      for (const uint32_t corner : triangle) ASSERT_LT(corner, found.at.size());
  }
}

TEST(Contour, EndsAtBlankNodesAndValuesThatDoNotCount) {
  const Place place = [](double i, double j, double k) { return glm::dvec3(i, j, k); };
  const Field height = [](const glm::dvec3& x) { return x.z == 4 ? 100 : x.z; };
  const GridBlock size = gridBlock(7, 7, 5);
  EXPECT_NEAR(contourOf(gridOf(size, place, height), 1.5).area(), 36, 1e-9);
  const auto corner = [](const GridNode& n) { return n.i == 0 && n.j == 0; };
  EXPECT_NEAR(contourOf(gridOf(size, place, height, corner), 1.5).area(), 35, 1e-9);
  EXPECT_NEAR(contourOf(gridOf(size, place, height), 50).area(), 36, 1e-9);
  ContourOptions options = optionsFor(50);
  options.upper = 10;
  Triangles found;
  Progress progress;
  contourGrid(gridOf(size, place, height), options, found, progress);
  EXPECT_TRUE(found.corners.empty());
}

TEST(Contour, OfAMeshIsThatOfTheSameCells) {
  const auto scene = makeScene("half-annulus");
  const Triangles of_grid = contourOf(SceneGridSource(scene, {25, 13, 13}), 0.5);
  const Field field = [&](const glm::dvec3& x) { return scene->scalar(x); };
  ArrayPiece hexahedra = hexahedraOf(*scene, 24, 12, 12), tetrahedra = tetrahedraOf(*scene, 24, 12, 12);
  setValues(hexahedra, field);
  setValues(tetrahedra, field);
  const Triangles of_mesh = contourOf(ArrayMesh({hexahedra}), 0.5),
                  mixed = contourOf(ArrayMesh({shuffled(hexahedra, 7)}), 0.5),
                  of_tetrahedra = contourOf(ArrayMesh({tetrahedra}), 0.5),
                  in_pieces = contourOf(
                      ArrayMesh(split(hexahedra, 3, [](size_t cell) { return cell / 1000 % 3; })), 0.5);
  EXPECT_GT(of_grid.corners.size(), 500u);
  for (const Triangles* const same : {&of_mesh, &mixed, &in_pieces}) {
    EXPECT_EQ(same->corners.size(), of_grid.corners.size());
    EXPECT_EQ(same->at.size(), of_grid.at.size());
    EXPECT_NEAR(same->area(), of_grid.area(), 1e-3 * of_grid.area());
    EXPECT_EQ(same->openEdges().size(), of_grid.openEdges().size());
  }
  EXPECT_NEAR(of_tetrahedra.area(), of_grid.area(), 0.02 * of_grid.area());
}

TEST(Contour, GoesThroughCellsOfEveryShape) {
  // A box of 2 x 1 x 1: a cube, and beside it a wedge, a pyramid and two tetrahedra, or a polyhedron.
  ArrayPiece piece;
  for (double z : {0.0, 1.0})
    for (double y : {0.0, 1.0})
      for (double x : {0.0, 1.0, 2.0}) piece.points.emplace_back(x, y, z);
  const auto append = [&](CellKind shape, std::vector<uint64_t> points) {
    piece.cells.append(shape, points);
  };
  append(CellKind::kHexahedron, {0, 1, 4, 3, 6, 7, 10, 9});
  append(CellKind::kWedge, {1, 2, 4, 7, 8, 10});
  append(CellKind::kPyramid, {4, 2, 8, 10, 5});
  append(CellKind::kTetrahedron, {8, 10, 5, 11});
  setValues(piece, [](const glm::dvec3& x) { return x.x + 0.5 * x.z; });
  const Triangles found = contourOf(ArrayMesh({piece}), 1.2);
  EXPECT_NEAR(found.area(), std::sqrt(1.25), 1e-6) << "a plane through all of them, from x = 0.7 to 1.2";
  for (const auto& triangle : found.corners)
    EXPECT_NEAR(glm::dot(glm::normalize(found.normalOf(triangle)), glm::normalize(glm::dvec3(-1, 0, -0.5))),
                1, 1e-6);
  for (const auto& [a, b] : found.openEdges()) {
    const glm::dvec3 middle = 0.5 * (found.at[a] + found.at[b]);
    EXPECT_TRUE(std::min(middle.y, middle.z) < 1e-9 || std::max(middle.y, middle.z) > 1 - 1e-9);
  }
  ArrayPiece prism;
  prism.points = {{0, 0, 0}, {2, 0, 0}, {3, 1, 0}, {2, 2, 0}, {0, 2, 0},
                  {0, 0, 1}, {2, 0, 1}, {3, 1, 1}, {2, 2, 1}, {0, 2, 1}};
  prism.cells.appendPrism(std::vector<uint64_t>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9});
  setValues(prism, [](const glm::dvec3& x) { return x.z; });
  EXPECT_NEAR(contourOf(ArrayMesh({prism}), 0.25).area(), 5, 1e-6);
}

}  // namespace
}  // namespace curvisplat
