// The lattice that stands for a mesh in a preview.
#include "preprocess/gather/mesh_lattice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "preprocess/convert/convert.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/array_mesh.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr uint64_t kPlenty = uint64_t{1} << 30;

/// n x n x n cubes in a box of 2 x 1 x 1 whose cells grow with x; without those that `has` does not have.
ArrayPiece boxOfCubes(uint64_t n, const std::function<bool(const glm::dvec3&)>& has) {
  ArrayPiece piece;
  const auto x = [n](uint64_t i) { return 2 * std::pow(static_cast<double>(i) / static_cast<double>(n), 2); };
  const auto part = [n](uint64_t j) { return static_cast<double>(j) / static_cast<double>(n); };
  for (uint64_t k = 0; k <= n; ++k)
    for (uint64_t j = 0; j <= n; ++j)
      for (uint64_t i = 0; i <= n; ++i) piece.points.push_back({x(i), part(j), part(k)});
  piece.cells.clear();
  const auto at = [n](uint64_t i, uint64_t j, uint64_t k) { return i + (n + 1) * (j + (n + 1) * k); };
  for (uint64_t k = 0; k < n; ++k)
    for (uint64_t j = 0; j < n; ++j)
      for (uint64_t i = 0; i < n; ++i) {
        if (!has(0.5 * (piece.points[at(i, j, k)] + piece.points[at(i + 1, j + 1, k + 1)]))) continue;
        const std::vector<uint64_t> corners{
            at(i, j, k),     at(i + 1, j, k),     at(i + 1, j + 1, k),     at(i, j + 1, k),
            at(i, j, k + 1), at(i + 1, j, k + 1), at(i + 1, j + 1, k + 1), at(i, j + 1, k + 1)};
        piece.cells.append(CellKind::kHexahedron, corners);
      }
  setValues(piece, [](const glm::dvec3& at_point) { return at_point.x + 10 * at_point.y; });
  return piece;
}

struct Nodes {
  NodeArrays arrays;
  GridBlock block;
};
Nodes nodesOf(const GridSource& source) {
  Nodes nodes{{}, source.description().blocks.front()};
  const std::vector<uint32_t> scalars{0};
  source.read(0, {0, nodes.block.nj, 0, nodes.block.nk}, scalars, nodes.arrays);
  return nodes;
}

class MeshLattice : public testing::TestWithParam<uint32_t> {  // the scalar: of points, of cells
 protected:
  static std::unique_ptr<GridSource> latticeOf(const ArrayMesh& mesh, uint64_t nodes,
                                               uint64_t memory_bytes = kPlenty) {
    const MeshReader reader(mesh, {GetParam()}, std::nullopt);
    Progress progress;
    return curvisplat::latticeOf(reader, nodes, memory_bytes, progress);
  }
};

/// The hole is blank, the rest has the field's values, and no node lies beyond the box.
TEST_P(MeshLattice, HasTheMeshsShapeAndValues) {
  const double hole = 2 * std::pow(21.0 / 30, 2);  // where a row of cells begins
  const auto has = [hole](const glm::dvec3& at) { return at.x < hole || at.y < 0.5; };
  const ArrayMesh mesh({boxOfCubes(30, has)});
  const auto lattice = latticeOf(mesh, 8000);
  ASSERT_TRUE(lattice);
  const auto [arrays, block] = nodesOf(*lattice);
  EXPECT_EQ(block.ni, 20u);
  EXPECT_EQ(arrays.x.size(), 8000u);
  EXPECT_EQ(arrays.x.front(), 0);
  EXPECT_EQ(arrays.x.back(), 2);
  EXPECT_EQ(lattice->description().scalars.at(0).centring, Centring::kNode);
  const double cell = 2 - 2 * std::pow(29.0 / 30, 2);  // the largest
  for (size_t n = 0; n < arrays.x.size(); ++n) {
    const glm::dvec3 at(arrays.x[n], arrays.y[n], arrays.z[n]);
    if (has(at)) {
      EXPECT_EQ(arrays.blank[n], 0) << at.x << ' ' << at.y;
    } else if (at.x > hole + cell && at.y > 0.5 + 1.0 / 30) {
      EXPECT_EQ(arrays.blank[n], 1) << at.x << ' ' << at.y;
    }
    if (!arrays.blank[n]) {
      EXPECT_NEAR(static_cast<double>(arrays.scalars[0][n]), at.x + 10 * at.y, cell + 10.0 / 30) << n;
    }
  }
}

/// Half of the points have x < 0.5, a quarter of the box.
TEST_P(MeshLattice, LinesAreDenseWhereThePointsAre) {
  const ArrayMesh mesh({boxOfCubes(30, [](const glm::dvec3&) { return true; })});
  const auto lattice = latticeOf(mesh, 27000);
  ASSERT_TRUE(lattice);
  const Nodes nodes = nodesOf(*lattice);
  uint64_t below = 0;
  for (uint64_t i = 0; i < nodes.block.ni; ++i) below += nodes.arrays.x[i] < 0.5;
  // Half of the lines as the points, half as the length: 3/8 of them.
  EXPECT_NEAR(static_cast<double>(below) / static_cast<double>(nodes.block.ni), 0.375, 0.05);
}

/// Cells of a piece number the points of their own piece.
TEST_P(MeshLattice, HasTheValuesOfAMeshInPieces) {
  const ArrayPiece whole = boxOfCubes(12, [](const glm::dvec3&) { return true; });
  const ArrayMesh in_pieces(split(whole, 3, [](size_t cell) { return cell % 3; }));
  const auto lattice = latticeOf(in_pieces, 1000);
  ASSERT_TRUE(lattice);
  const NodeArrays arrays = nodesOf(*lattice).arrays;
  const double cell = 2 - 2 * std::pow(11.0 / 12, 2);  // the largest
  for (size_t n = 0; n < arrays.x.size(); ++n) {
    EXPECT_EQ(arrays.blank[n], 0) << n;
    EXPECT_NEAR(static_cast<double>(arrays.scalars[0][n]), arrays.x[n] + 10 * arrays.y[n], cell + 10.0 / 12)
        << n;
  }
}

TEST_P(MeshLattice, ThereIsNoneBeyondItsMemoryOrOfAPlane) {
  const ArrayMesh mesh({boxOfCubes(10, [](const glm::dvec3&) { return true; })});
  EXPECT_FALSE(latticeOf(mesh, 1000, 1000));
  ArrayPiece flat = boxOfCubes(10, [](const glm::dvec3&) { return true; });
  for (glm::dvec3& point : flat.points) point.z = 1;
  EXPECT_FALSE(latticeOf(ArrayMesh({flat}), 1000));
}

TEST_P(MeshLattice, IsConverted) {
  const TemporaryFolder folder;
  const ArrayMesh mesh({boxOfCubes(20, [](const glm::dvec3& at) { return at.x < 1 || at.y < 0.5; })});
  const auto lattice = latticeOf(mesh, 4096);
  ASSERT_TRUE(lattice);
  ConvertOptions options;
  options.output = folder / "lattice.splats";
  options.scalars = {0};
  Progress progress;
  convert(*lattice, options, progress);
  const Manifest manifest = CacheReader(options.output).manifest();
  EXPECT_EQ(manifest.nodes, 4096u);
  EXPECT_GT(manifest.splats, 2000u);
  EXPECT_LT(manifest.splats, 4000u);
}

INSTANTIATE_TEST_SUITE_P(Centrings, MeshLattice, testing::Values(0u, 1u));

}  // namespace
}  // namespace curvisplat
