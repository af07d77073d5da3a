// Meshes of one layer of cells, as two-dimensional cases are written: each cell is two splats, one at each face.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <mutex>
#include <numbers>
#include <span>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/convert/mesh_origin.h"
#include "preprocess/moments/mesh_splats.h"
#include "preprocess/shape/shape.h"
#include "stream/cache/cache_reader.h"
#include "stream/model/growth_code.h"
#include "tests/reference/array_mesh.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

const glm::dmat3 kJacobian(2, 0.3, 0, -0.4, 1, 0.2, 0, 0.1, 0.5);

/// n x n sheared cells in `layers` layers.
ArrayPiece plate(uint64_t n, uint64_t layers = 1) {
  ArrayPiece piece;
  for (uint64_t k = 0; k <= layers; ++k)
    for (uint64_t j = 0; j <= n; ++j)
      for (uint64_t i = 0; i <= n; ++i)
        piece.points.push_back(
            kJacobian * glm::dvec3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)));
  const auto at = [n](uint64_t i, uint64_t j, uint64_t k) { return i + (n + 1) * (j + (n + 1) * k); };
  for (uint64_t k = 0; k < layers; ++k)
    for (uint64_t j = 0; j < n; ++j)
      for (uint64_t i = 0; i < n; ++i)
        piece.cells.append(
            CellKind::kHexahedron,
            std::array{at(i, j, k), at(i + 1, j, k), at(i + 1, j + 1, k), at(i, j + 1, k), at(i, j, k + 1),
                       at(i + 1, j, k + 1), at(i + 1, j + 1, k + 1), at(i, j + 1, k + 1)});
  setValues(piece, [](const glm::dvec3& x) { return 3 + x.x - 2 * x.y; });
  return piece;
}

/// Collects the splats that an origin makes, by number.
class Collected : public SplatSink {
 public:
  struct Made {
    NodeSplat node;
    SplatScalar value;
  };
  void add(const NodeSplat& splat, std::span<const SplatScalar> values) override {
    const std::lock_guard lock(mutex_);
    EXPECT_TRUE(made.emplace(splat.node, Made{splat, values.front()}).second) << splat.node;
  }
  std::map<uint64_t, Made> made;

 private:
  std::mutex mutex_;
};

class SlabCells : public ::testing::Test {
 protected:
  /// `follow`: the rows of a cache's block; 0: none.
  std::map<uint64_t, Collected::Made> splatsOf(const ArrayMesh& mesh, uint64_t follow = 0) {
    MeshOrigin origin(mesh, {1}, std::nullopt, MemoryPlan::of(uint64_t{512} << 20, 1, 2), folder_.path());
    if (follow > 0) {
      Manifest manifest;
      manifest.cells = true;
      manifest.blocks = {{"cells", 1, 1, follow}};
      origin.follow(manifest);
    }
    Progress progress;
    Collected sink;
    origin.survey(progress);
    halved_ = origin.scatter([&]() -> SplatSink& { return sink; }, {}, progress).halved;
    return sink.made;
  }

  ConvertOptions options(const char* name = "mesh.splats") const {
    ConvertOptions options;
    options.output = folder_ / name;
    options.scalars = {1};
    options.overwrite = true;
    options.memory_bytes = uint64_t{512} << 20;
    return options;
  }

  const TemporaryFolder folder_;
  uint64_t halved_ = 0;
};

TEST_F(SlabCells, EndAtBothOfTheirFaces) {
  constexpr uint64_t kAlong = 6, kCells = kAlong * kAlong;
  const auto made = splatsOf(ArrayMesh({plate(kAlong)}));
  ASSERT_EQ(made.size(), 2 * kCells);
  EXPECT_EQ(halved_, kCells);
  const glm::dvec3 normal = glm::normalize(glm::cross(kJacobian[0], kJacobian[1]));
  for (const auto& [number, splat] : made) {
    const double i = static_cast<double>(number % kAlong), j = static_cast<double>(number % kCells / kAlong);
    const auto other = made.find((number + kCells) % (2 * kCells));
    ASSERT_NE(other, made.end());
    const glm::dvec3 centre = kJacobian * glm::dvec3(i + 0.5, j + 0.5, 0.5);
    const Splat& half = splat.node.splat;
    EXPECT_LT(glm::distance(0.5 * (half.position + other->second.node.splat.position), centre), 1e-9);
    EXPECT_NEAR(std::abs(glm::dot(normal, half.position - centre)), 0.25 * glm::dot(normal, kJacobian[2]),
                1e-9);
    EXPECT_NEAR(half.weight, 0.5 * glm::determinant(kJacobian), 1e-9);
    EXPECT_NEAR(glm::determinant(half.factor()), 0.5 * glm::determinant(kJacobian), 1e-9);
    EXPECT_EQ(splat.value.mean, other->second.value.mean);
    // Each ends at the face that is nearer, also where it ends at the rim, too.
    const bool is_upper = glm::dot(normal, half.position - centre) > 0;
    const InwardAxes inward = inwardAxes(splat.node.border_code);
    const bool rim_i = i == 0 || i == kAlong - 1, rim_j = j == 0 || j == kAlong - 1;
    EXPECT_EQ(inward.count, 1 + rim_i + rim_j) << number;
    double nearest = 0;
    for (int n = 0; n < inward.count; ++n) {
      ASSERT_TRUE(inward.hasFace(n));
      const glm::dvec3 along = half.factor() * glm::dvec3(inward.axis[static_cast<size_t>(n)]);
      if (std::abs(glm::dot(normal, along)) > std::abs(nearest)) nearest = glm::dot(normal, along);
    }
    EXPECT_NEAR(nearest, (is_upper ? -0.5 : 0.5) * glm::dot(normal, kJacobian[2]), 0.01);
  }
}

TEST_F(SlabCells, OfALinearFieldCarryItAlongTheLayer) {
  ArrayPiece piece = plate(8);
  const glm::dvec3 normal = glm::normalize(glm::cross(kJacobian[0], kJacobian[1]));
  const glm::dvec3 gradient = glm::cross(normal, glm::dvec3(1, 2, 3));
  setValues(piece, [&](const glm::dvec3& x) { return glm::dot(gradient, x); });
  for (const auto& [number, splat] : splatsOf(ArrayMesh({piece}))) {
    const Splat& half = splat.node.splat;
    // Along the layer; across it the values do not change.
    for (const glm::dvec3& step : {kJacobian[0], kJacobian[1]})
      EXPECT_NEAR(glm::dot(gradientOf(half, splat.value.slope), step), glm::dot(gradient, step), 2e-5);
  }
}

TEST_F(SlabCells, OfSeveralLayersAreWhole) {
  EXPECT_EQ(splatsOf(ArrayMesh({plate(5, 2)})).size(), 50u);
  EXPECT_EQ(halved_, 0u);
  converted(ArrayMesh({plate(5, 2)}), options());
  EXPECT_EQ(CacheReader(folder_ / "mesh.splats").manifest().blocks[0].nk, 1u);
}

/// Cells with outer faces all around, too; two faces of a rod are as near to one another as the others.
TEST_F(SlabCells, OfARowAreHalvedAcrossTheThinSide) {
  const auto row = [](double thickness) {
    ArrayPiece piece;
    for (uint64_t k = 0; k <= 1; ++k)
      for (uint64_t j = 0; j <= 1; ++j)
        for (uint64_t i = 0; i <= 4; ++i)
          piece.points.emplace_back(static_cast<double>(i), static_cast<double>(j),
                                    thickness * static_cast<double>(k));
    for (uint64_t i = 0; i < 4; ++i)
      piece.cells.append(CellKind::kHexahedron,
                         std::array<uint64_t, 8>{i, i + 1, i + 6, i + 5, i + 10, i + 11, i + 16, i + 15});
    setValues(piece, [](const glm::dvec3& x) { return x.x; });
    return piece;
  };
  EXPECT_EQ(splatsOf(ArrayMesh({row(0.3)})).size(), 8u);
  EXPECT_EQ(splatsOf(ArrayMesh({row(1)})).size(), 4u);
}

TEST_F(SlabCells, AreAsThoseOfTheCacheThatGetsAScalar) {
  const ArrayMesh mesh({plate(5)});
  EXPECT_EQ(splatsOf(mesh, 1).size(), 25u);  // of an older version
  EXPECT_EQ(splatsOf(mesh, 2).size(), 50u);
}

TEST_F(SlabCells, HaveTheSameBytesForAnyThreadsMemoryAndRanks) {
  const ArrayMesh meshes[] = {ArrayMesh({shuffled(plate(70), 3)}),
                              ArrayMesh(split(plate(70), 3, [](size_t cell) { return cell / 50 % 3; }))};
  for (const ArrayMesh& mesh : meshes) {
    const ConvertReport report = converted(mesh, options());
    EXPECT_NEAR(report.volume / (4900 * glm::determinant(kJacobian)), 1, 1e-4);
    const CacheReader cache(folder_ / "mesh.splats");
    EXPECT_EQ(cache.manifest().splats, 9800u);
    EXPECT_EQ(cache.manifest().blocks[0].ni, 4900u);
    EXPECT_EQ(cache.manifest().blocks[0].nk, 2u);
    expectSameCaches(mesh, options(),
                     {{.threads = 1, .mesh_bytes = 400'000},
                      {.threads = 2, .mesh_bytes = 200'000},
                      {.threads = 1, .bucket_splats = 3000, .ranks = 2},
                      {.threads = 1, .bucket_splats = 3000, .ranks = 3}});
  }
}

using CellsOfTwoSizes = SlabCells;

TEST_F(CellsOfTwoSizes, KnowOneAnotherAndTheField) {
  const uint64_t n = 5;
  const ArrayMesh mesh({partedCube(n)});
  double volume = 0;
  size_t inside = 0;
  for (const auto& [number, made] : splatsOf(mesh)) {
    const Splat& splat = made.node.splat;
    volume += splat.weight;
    const glm::dvec3 at = splat.position;
    const double edge = std::min({at.x, at.y, at.z, 2 * n - at.x, 2 * n - at.y, 2 * n - at.z});
    if (edge < 2) continue;
    ++inside;
    EXPECT_EQ(made.node.border_code, kNoBorder) << number;
    // The mean where the splat is, which lies off its cell's middle, and all of the slope.
    EXPECT_NEAR(made.value.mean, 3 + at.x - 2 * at.y + 0.5 * at.z, 1e-5) << number;
    EXPECT_LT(glm::distance(gradientOf(splat, made.value.slope), glm::dvec3(1, -2, 0.5)), 1e-5) << number;
  }
  EXPECT_NEAR(volume, 8 * n * n * n, 1e-9);
  EXPECT_GT(inside, 100u);
}

TEST_F(CellsOfTwoSizes, DoNotKnowThoseThatTheyTouchAtACornerOnly) {
  // In an L, the cell of 2 ends at the edge x = y = 0, and the cells of 1 at y = -1 begin there on the other side.
  std::vector<Box> boxes{{{2, 3, 1}, 2}};
  for (uint64_t y = 2; y < 5; ++y)
    for (uint64_t z = 1; z < 3; ++z) boxes.push_back({{4, y, z}, 1});
  const auto with = splatsOf(ArrayMesh({boxesOf(boxes)}));
  boxes.erase(boxes.begin());
  const auto without = splatsOf(ArrayMesh({boxesOf(boxes)}));
  for (const uint64_t cell : {0u, 1u}) {  // at y = -1
    const NodeSplat& beside = with.at(cell + 1).node;
    const NodeSplat& alone = without.at(cell).node;
    EXPECT_EQ(beside.border_code, alone.border_code) << "ends at all of its outer faces";
    EXPECT_EQ(beside.growth_code, kNoGrowth);
    EXPECT_EQ(beside.splat.position, alone.splat.position);
    EXPECT_EQ(with.at(cell + 1).value.mean, without.at(cell).value.mean);
  }
  EXPECT_NE(with.at(3).node.growth_code, kNoGrowth) << "this one lies against it";
}

TEST_F(CellsOfTwoSizes, HaveTheSameBytesForAnyThreadsMemoryAndRanks) {
  const ArrayPiece cube = partedCube(12);
  for (const ArrayMesh& mesh :
       {ArrayMesh({shuffled(cube, 3)}), ArrayMesh(split(cube, 3, [](size_t cell) { return cell / 50 % 3; }))})
    expectSameCaches(mesh, options(),
                     {{.threads = 1, .mesh_bytes = 1'000'000},
                      {.threads = 2, .mesh_bytes = 300'000},
                      {.threads = 1, .bucket_splats = 3000, .ranks = 2}});
}

/// A cell's splat of length 1, or as `shape` says, beside cells of twice the length in these directions.
NodeSplat besideLarger(std::span<const glm::dvec3> directions, const CellBody& shape) {
  std::vector<CellSide> sides;
  for (const glm::dvec3& direction : directions)
    sides.push_back({direction, shape.centre + 0.5 * direction, shape.centre + 1.5 * direction});
  NodeSplat splat;
  SplatScalar value;
  splatOfCell(0, shape, std::array{1.0f}, {{}, {}, sides}, splat, {&value, 1});
  return splat;
}

TEST(FitToSizes, GrowsPrismsAlongTheirTriangles) {
  // Three directions of one plane are two axes at most.
  const CellBody body{.volume = 1, .centre = glm::dvec3(0), .xx = 1, .yy = 1, .zz = 1};
  for (const double turn : {0.0, 0.3, 1.1, 2.0}) {
    std::vector<glm::dvec3> directions;
    for (int n = 0; n < 3; ++n) {
      const double angle = turn + n * 2 * std::numbers::pi / 3;
      directions.emplace_back(std::cos(angle), std::sin(angle), 0);
    }
    const uint32_t code = besideLarger(directions, body).growth_code;
    ASSERT_TRUE(isPossibleGrowthCode(code));
    const CellGrowth growth = cellGrowth(code);
    double along_prism = 0;
    for (size_t n = 0; n < 3; ++n)
      if (growth.growth[n] != 0) along_prism = std::max(along_prism, std::abs(double{growth.axis[n].z}));
    EXPECT_NE(code, kNoGrowth);
    EXPECT_LT(along_prism, 0.1) << turn;
  }
}

TEST(FitToSizes, GrowsHalvesAcrossTheSameFaces) {
  // A layer whose cells lean over by more than their height: halves have another frame.
  const glm::dmat3 cell(1, 0, 0, 0, 1, 0, 1.2, 0.8, 0.7);
  const glm::dmat3 shape = cell * glm::transpose(cell);
  const CellBody body{.volume = glm::determinant(cell),
                      .centre = glm::dvec3(0),
                      .xx = shape[0][0],
                      .xy = shape[0][1],
                      .yy = shape[1][1],
                      .xz = shape[0][2],
                      .yz = shape[1][2],
                      .zz = shape[2][2]};
  const glm::dvec3 normal = glm::normalize(glm::cross(cell[1], cell[2]));
  const NodeSplat whole = besideLarger(std::array{normal}, body);
  const std::vector<OuterPlane> planes{{{0, 0, 1}, {-0.6, -0.4, -0.35}}, {{0, 0, -1}, {0.6, 0.4, 0.35}}};
  std::array<SlabHalf, 2> halves;
  ASSERT_TRUE(halveSlab(planes, whole, {}, halves));
  for (const SlabHalf& half : halves) {
    const CellGrowth growth = cellGrowth(half.splat.growth_code);
    const size_t most =
        static_cast<size_t>(std::ranges::max_element(growth.growth, {}, [](float g) { return std::abs(g); }) -
                            growth.growth.begin());
    EXPECT_GT(std::abs(growth.growth[most]), 0.3f);
    const glm::dvec3 across = glm::normalize(gradientOf(half.splat.splat, glm::dvec3(growth.axis[most])));
    EXPECT_GT(std::abs(glm::dot(across, normal)), 0.99);
  }
}

TEST(CellSlopes, StayAmongTheNeighbours) {
  // The middles of slivers lie next to the cell's own, which is of length 1.
  const std::array<glm::dvec3, 3> steps{glm::dvec3(1e-4, 0, 0), {0, -1e-4, 0}, {0, 0, 1e-4}};
  const std::array<float, 3> values{3, 7, 5};
  NodeSplat splat;
  SplatScalar of_cell;
  const CellBody body{.volume = 1, .centre = glm::dvec3(1, 2, 3), .xx = 1, .yy = 1, .zz = 1};
  splatOfCell(0, body, std::array{4.0f}, {steps, values}, splat, {&of_cell, 1});
  EXPECT_LE(glm::length(of_cell.slope), 4 * (7 - 3) + 1e-9);
  EXPECT_GT(glm::length(of_cell.slope), 1);
  EXPECT_TRUE(of_cell.mean >= 3 && of_cell.mean <= 7) << of_cell.mean;
}

}  // namespace
}  // namespace curvisplat
