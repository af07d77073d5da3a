#include "preprocess/shape/merge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <random>

#include "tests/reference/mapped_block.h"

namespace curvisplat {
namespace {

struct SplatAndValue {
  Splat splat;
  SplatScalar value;
};

SplatAndValue merged(const std::vector<SplatAndValue>& pieces) {
  SplatMerger merger(1);
  for (const SplatAndValue& piece : pieces) merger.add(piece.splat.position, piece.splat, {&piece.value, 1});
  SplatAndValue out;
  merger.finish(out.splat, {&out.value, 1});
  return out;
}

std::vector<SplatAndValue> randomPieces(std::mt19937_64& random, size_t count, const glm::dvec3& origin) {
  std::uniform_real_distribution<double> unit(0, 1), symmetric(-1, 1);
  std::vector<SplatAndValue> pieces(count);
  for (SplatAndValue& piece : pieces) {
    piece.splat.position = origin + glm::dvec3(symmetric(random), symmetric(random), symmetric(random));
    for (double& axis : piece.splat.axis) axis = std::pow(10, -2 * unit(random));
    for (double& shear : piece.splat.shear) shear = 2 * symmetric(random);
    piece.splat.weight = unit(random);
    piece.value = {
        5 + symmetric(random), {symmetric(random), symmetric(random), symmetric(random)}, unit(random)};
  }
  return pieces;
}

/// The weighted moments of (x, y, z, f), brute force: each splat is sixteen points whose covariance is its
/// cell's.
struct Moments {
  double weight = 0;
  std::array<long double, 4> mean{};
  std::array<std::array<long double, 4>, 4> covariance{};
};

Moments momentsOf(const std::vector<SplatAndValue>& pieces) {
  struct Point {
    double weight;
    std::array<long double, 4> at;
  };
  std::vector<Point> points;
  for (const auto& [splat, value] : pieces) {
    const glm::dmat3 factor = splat.factor();
    for (int corner = 0; corner < 16; ++corner) {
      const double half = 1 / std::sqrt(12.0);
      const glm::dvec3 u(corner & 1 ? half : -half, corner & 2 ? half : -half, corner & 4 ? half : -half);
      const glm::dvec3 p = splat.position + factor * u;
      const double f =
          value.mean + glm::dot(value.slope, u) + (corner & 8 ? 1 : -1) * std::sqrt(value.variance);
      points.push_back({splat.weight / 16, {p.x, p.y, p.z, f}});
    }
  }
  Moments moments;
  for (const Point& point : points) {
    moments.weight += point.weight;
    for (int n = 0; n < 4; ++n) moments.mean[n] += point.weight * point.at[n];
  }
  for (auto& mean : moments.mean) mean /= moments.weight;
  for (const Point& point : points)
    for (int r = 0; r < 4; ++r)
      for (int c = 0; c < 4; ++c)
        moments.covariance[r][c] +=
            point.weight / moments.weight * (point.at[r] - moments.mean[r]) * (point.at[c] - moments.mean[c]);
  return moments;
}

void expectMoments(const SplatAndValue& piece, const Moments& expected, double tolerance) {
  const glm::dmat3 a = piece.splat.factor();
  const glm::dmat3 s = a * glm::transpose(a);
  const glm::dvec3 h = a * piece.value.slope;
  EXPECT_NEAR(piece.splat.weight, expected.weight, tolerance);
  EXPECT_NEAR(piece.value.mean, expected.mean[3], tolerance);
  for (int r = 0; r < 3; ++r) {
    EXPECT_NEAR(piece.splat.position[r], expected.mean[r], tolerance);
    EXPECT_NEAR(h[r] / 12, expected.covariance[r][3], tolerance);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(s[c][r] / 12, expected.covariance[r][c], tolerance);
  }
  EXPECT_NEAR(glm::dot(piece.value.slope, piece.value.slope) / 12 + piece.value.variance,
              expected.covariance[3][3], tolerance);
  EXPECT_GE(piece.value.variance, 0);
}

TEST(Merge, UnitCellsMakeTheUnitCellOfACoarserLattice) {
  for (int n = 2; n <= 9; ++n) {
    SplatMerger merger(1);
    for (int cell = 0; cell < n * n * n; ++cell) {
      Splat splat;
      splat.weight = 1;
      const glm::dvec3 at(cell % n, cell / n % n, cell / n / n);
      const SplatScalar value{3 * at.x - at.y, {3, -1, 0}, 0};
      merger.add(at, splat, {&value, 1});
    }
    Splat splat;
    SplatScalar value;
    merger.finish(splat, {&value, 1});
    EXPECT_NEAR(splat.weight, n * n * n, 1e-9);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(splat.axis[axis], n, 1e-12 * n);
      EXPECT_NEAR(splat.shear[axis], 0, 1e-12);
      EXPECT_NEAR(splat.position[axis], 0.5 * (n - 1), 1e-12 * n);
    }
    EXPECT_NEAR(value.mean, n - 1, 1e-12 * n);
    EXPECT_LT(glm::distance(value.slope, glm::dvec3(3 * n, -n, 0)), 1e-11 * n);
    EXPECT_NEAR(value.variance, 0, 1e-12 * n * n);
    EXPECT_NEAR(merger.detail(), std::sqrt(n * n - 1), 1e-7 * n);
  }
}

TEST(Merge, KeepsTheMomentsOfWhatItMerges) {
  std::mt19937_64 random(1);
  for (const size_t count : {2u, 3u, 17u, 200u}) {
    const auto pieces = randomPieces(random, count, {1, -2, 3});
    expectMoments(merged(pieces), momentsOf(pieces), 1e-10);
  }
}

TEST(Merge, LosesNoDigitsFarFromTheOrigin) {
  std::mt19937_64 random(2);
  const glm::dvec3 far(1 << 20, -(1 << 20), 1 << 20);
  auto pieces = randomPieces(random, 100, glm::dvec3(0.0));
  // Positions that both places can hold exactly.
  for (SplatAndValue& piece : pieces)
    piece.splat.position = glm::round(piece.splat.position * 1024.0) / 1024.0;
  const SplatAndValue near = merged(pieces);
  for (SplatAndValue& piece : pieces) piece.splat.position += far;
  const SplatAndValue moved = merged(pieces);
  EXPECT_LT(glm::distance(moved.splat.position - far, near.splat.position), 1e-9);
  EXPECT_EQ(moved.splat.axis, near.splat.axis);
  EXPECT_EQ(moved.splat.shear, near.splat.shear);
  EXPECT_EQ(moved.value.slope, near.value.slope);
}

TEST(Merge, OfMergesIsTheMergeOfAll) {
  std::mt19937_64 random(3);
  const auto pieces = randomPieces(random, 64, {0, 0, 0});
  std::vector<SplatAndValue> groups;
  for (size_t group = 0; group < 8; ++group)
    groups.push_back(merged({pieces.begin() + static_cast<ptrdiff_t>(group * 8),
                             pieces.begin() + static_cast<ptrdiff_t>(group * 8 + 8)}));
  const SplatAndValue all = merged(pieces), twice = merged(groups);
  EXPECT_NEAR(all.splat.weight, twice.splat.weight, 1e-9);
  EXPECT_LT(glm::distance(all.splat.position, twice.splat.position), 1e-9);
  for (int n = 0; n < 3; ++n) {
    EXPECT_NEAR(all.splat.axis[n], twice.splat.axis[n], 1e-9);
    EXPECT_NEAR(all.splat.shear[n], twice.splat.shear[n], 1e-9);
  }
  EXPECT_NEAR(all.value.mean, twice.value.mean, 1e-9);
  EXPECT_LT(glm::distance(all.value.slope, twice.value.slope), 1e-9);
  EXPECT_NEAR(all.value.variance, twice.value.variance, 1e-9);
}

TEST(Merge, TwoHalfCellsAreTheWholeCell) {
  std::vector<SplatAndValue> halves(2);
  for (int side = 0; side < 2; ++side) {
    const double sign = side == 0 ? -1 : 1;
    halves[side].splat.position = {0.25 * sign, 0, 0};
    halves[side].splat.axis = {0.5, 1, 1};
    halves[side].splat.weight = 0.5;
    halves[side].value = {7 + 0.25 * sign * 2, {1, 0.5, -3}, 0};
  }
  const SplatAndValue whole = merged(halves);
  EXPECT_EQ(whole.splat.position, glm::dvec3(0, 0, 0));
  EXPECT_EQ(whole.splat.axis, (std::array{1.0, 1.0, 1.0}));
  EXPECT_EQ(whole.splat.weight, 1);
  EXPECT_EQ(whole.value.mean, 7);
  EXPECT_LT(glm::distance(whole.value.slope, glm::dvec3(2, 0.5, -3)), 1e-14);
  EXPECT_NEAR(whole.value.variance, 0, 1e-14);
}

TEST(Merge, OfOneGivesItBack) {
  std::mt19937_64 random(4);
  const auto pieces = randomPieces(random, 1, {1e6, 1, 0});
  const SplatAndValue out = merged(pieces);
  EXPECT_EQ(out.splat.position, pieces[0].splat.position);
  EXPECT_EQ(out.splat.axis, pieces[0].splat.axis);
  EXPECT_EQ(out.splat.shear, pieces[0].splat.shear);
  EXPECT_EQ(out.splat.weight, pieces[0].splat.weight);
  EXPECT_EQ(out.value.mean, pieces[0].value.mean);
  EXPECT_EQ(out.value.slope, pieces[0].value.slope);
  EXPECT_EQ(out.value.variance, pieces[0].value.variance);
}

TEST(Merge, OfZeroWeightsIsUnweightedUntilAWeightComes) {
  std::mt19937_64 random(5);
  auto pieces = randomPieces(random, 10, {0, 0, 0});
  for (SplatAndValue& piece : pieces) piece.splat.weight = 1;
  Moments expected = momentsOf(pieces);
  for (SplatAndValue& piece : pieces) piece.splat.weight = 0;
  expected.weight = 0;
  expectMoments(merged(pieces), expected, 1e-12);

  // Zero weights count for nothing before, between and after others.
  pieces[3].splat.weight = 0.25;
  pieces[7].splat.weight = 0.5;
  expectMoments(merged(pieces), momentsOf({pieces[3], pieces[7]}), 1e-12);
}

TEST(Merge, OfDegenerateSplatsIsFloored) {
  // A plane's worth of flat pieces, and points on a line: some axis has no extent at all.
  std::vector<SplatAndValue> pieces(5);
  for (size_t n = 0; n < pieces.size(); ++n) {
    pieces[n].splat.position = {0.1 * static_cast<double>(n), 0.2 * static_cast<double>(n), 0};
    pieces[n].splat.axis = {1e-20, 1e-20, 1e-20};
    pieces[n].value.mean = static_cast<double>(n % 2);
  }
  const SplatAndValue line = merged(pieces);
  const auto sigma = singularValues(line.splat.factor());
  EXPECT_NEAR(sigma[0], std::sqrt(12 * 2 * 0.05), 1e-9);
  EXPECT_NEAR(sigma[1] / sigma[0] / kAxisFloor, 1, 1e-3);
  EXPECT_NEAR(sigma[2] / sigma[0] / kAxisFloor, 1, 1e-3);
  EXPECT_LE(glm::dot(line.value.slope, line.value.slope) / 12, 0.24 + 1e-12);
  EXPECT_NEAR(glm::dot(line.value.slope, line.value.slope) / 12 + line.value.variance, 0.24, 1e-9);
}

TEST(Merge, NeverExplainsMoreVarianceThanThereIs) {
  // A nearly weightless splat far away comes first, so that the thickness of the others nearly drowns in the
  // rounding of sums about it; and the field changes along just that.
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 200; ++n) {
    SplatAndValue far, thin;
    far.splat.position = 10.0 * glm::dvec3(normal(random), normal(random), normal(random));
    far.splat.weight = 1e-16;
    thin.splat.axis = {1, 1, 1e-5};
    thin.splat.shear = {0, normal(random), normal(random)};
    thin.splat.weight = 1;
    thin.value.slope = {0, 0, 1};
    const SplatAndValue out = merged({far, thin, thin});
    EXPECT_LE(glm::dot(out.value.slope, out.value.slope), 1 + 1e-12);
    EXPECT_NEAR(glm::dot(out.value.slope, out.value.slope) / 12 + out.value.variance, 1.0 / 12, 1e-12);
  }
}

TEST(VoxelMerger, KeepsVoxelsApartAndForgetsThemOnClear) {
  std::mt19937_64 random(6);
  VoxelMerger voxels(2, 5);
  for (int round = 0; round < 2; ++round) {
    const auto pieces = randomPieces(random, 40, {0, 0, 0});
    std::vector<SplatMerger> apart(4, SplatMerger(2));
    voxels.clear();
    for (size_t n = 0; n < pieces.size(); ++n) {
      const SplatScalar values[2] = {pieces[n].value, pieces[(n + 1) % 40].value};
      voxels.add(n % 4, pieces[n].splat.position, pieces[n].splat, values);
      apart[n % 4].add(pieces[n].splat.position, pieces[n].splat, values);
    }
    EXPECT_EQ(voxels.count(4), 0u);
    for (size_t voxel = 0; voxel < 4; ++voxel) {
      Splat one, other;
      SplatScalar one_values[2], other_values[2];
      voxels.finish(voxel, one, one_values);
      apart[voxel].finish(other, other_values);
      EXPECT_EQ(voxels.count(voxel), 10u);
      EXPECT_EQ(one.position, other.position);
      EXPECT_EQ(one.axis, other.axis);
      EXPECT_EQ(one_values[1].slope, other_values[1].slope);
      EXPECT_EQ(voxels.detail(voxel), apart[voxel].detail());
    }
  }
}

/// Unit cells with their middles at `middles`, merged in a voxel of the size `voxel_size`.
SplatAndValue mergedInVoxel(double voxel_size, const std::vector<glm::dvec3>& middles) {
  VoxelMerger voxels(1, 1);
  voxels.clear(voxel_size);
  SplatAndValue out;
  for (const glm::dvec3& at : middles) {
    Splat splat;
    splat.weight = 1;
    const SplatScalar value{0.25 * at.x, {0.25, 0, 0}, 0};
    voxels.add(0, at, splat, {&value, 1});
  }
  voxels.finish(0, out.splat, {&out.value, 1});
  return out;
}

TEST(VoxelMerger, SplatsOfALatticeHaveItsBlur) {
  const std::vector<glm::dvec3> two{{0, 0, 0}, {1, 0, 0}};
  const SplatAndValue own = mergedInVoxel(0, two), even = mergedInVoxel(3, two);
  EXPECT_NEAR(own.splat.axis[0], 2, 1e-12);
  EXPECT_NEAR(even.splat.axis[0], std::sqrt(0.418 * 4 + 0.582 * 9), 1e-12);
  EXPECT_NEAR(even.splat.axis[1], std::sqrt(0.418 + 0.582 * 9), 1e-12);
  EXPECT_EQ(even.splat.weight, own.splat.weight);
  EXPECT_EQ(even.splat.position, own.splat.position);
  EXPECT_EQ(even.value.mean, own.value.mean);
  EXPECT_EQ(even.value.variance, own.value.variance);
  EXPECT_NEAR(gradientOf(even.splat, even.value.slope).x, 0.25, 1e-12);
  // Cells that are longer than a voxel keep their own.
  const SplatAndValue longer = mergedInVoxel(0.5, {{0, 0, 0}, {0, 0.1, 0}});
  EXPECT_NEAR(longer.splat.axis[0], 1, 1e-12);
}

struct CellBox {
  glm::dvec3 middle, size;
  uint32_t border_code;
};

/// The code of cells that are boxes.
InwardAxes borderInVoxel(double voxel_size, const std::vector<CellBox>& cells) {
  VoxelMerger voxels(0, 1);
  voxels.clear(voxel_size);
  for (const auto& [middle, size, border_code] : cells) {
    const Splat splat{{}, {size.x, size.y, size.z}, {}, size.x * size.y * size.z};
    voxels.add(0, middle, splat, {}, {border_code, kNoGrowth});
  }
  Splat out;
  return inwardAxes(voxels.finish(0, out, {}).border);
}

TEST(VoxelMerger, SplatsOfALatticeEndAtTheirFaces) {
  const glm::dvec3 up(0, 0, 1), half(1, 1, 0.5), whole(1, 1, 1), right(1, 0, 0);
  const uint32_t face = packBorderCode({&up, 1}, 1), behind = packLayerCode(up, 1);
  // A half cell and the whole one behind it: 1.5 long, in a voxel of 2.
  const InwardAxes found = borderInVoxel(2, {{{0, 0, 0.25}, half, face}, {{0, 0, 1}, whole, behind}});
  ASSERT_EQ(found.count, 1);
  EXPECT_LT(glm::distance(glm::dvec3(found.axis[0]), up), 0.02);
  EXPECT_NEAR(found.distance, 0.5, 0.01);
  EXPECT_NEAR(found.ratio, 2 / 1.5, 0.08);
  EXPECT_FALSE(found.behind);
  // Only what lies behind the border's cells.
  const InwardAxes next = borderInVoxel(2, {{{0, 0, 1}, whole, behind}, {{0, 0, 2}, whole, kNoBorder}});
  EXPECT_TRUE(next.behind);
  EXPECT_NEAR(next.distance, 0.75, 0.01);
  // An edge.
  const glm::dvec3 both[] = {up, right};
  const uint32_t edge = packBorderCode({both, 2}, 3);
  EXPECT_EQ(borderInVoxel(1, {{{0.25, 0, 0.25}, {0.5, 1, 0.5}, edge}, {{0.25, 1, 0.25}, {0.5, 1, 0.5}, edge}})
                .count,
            2);
  // Borders that are no faces, and cells on both sides of the plane.
  const uint32_t parts = packBorderCode({&up, 1}, 0);
  EXPECT_EQ(borderInVoxel(2, {{{0, 0, 0.25}, half, parts}, {{0, 0, 1}, whole, kNoBorder}}).count, 0);
  EXPECT_EQ(borderInVoxel(2, {{{0, 0, 0.25}, half, face}, {{1, 0, -0.5}, whole, kNoBorder}}).count, 0);
  // One comes back with its own.
  EXPECT_EQ(borderInVoxel(2, {{{0, 0, 0.25}, half, edge}}).count, 2);
}

TEST(VoxelMerger, SplatsOfALatticeBetweenTwoFacesArePlates) {
  const glm::dvec3 up(0, 0, 1), down(0, 0, -1), half(1, 1, 0.5);
  const uint32_t bottom = packBorderCode({&up, 1}, 1), top = packBorderCode({&down, 1}, 1);
  const InwardAxes found = borderInVoxel(4, {{{0, 0, 0.25}, half, bottom}, {{0, 0, 0.75}, half, top}});
  EXPECT_TRUE(found.plate);
  EXPECT_EQ(found.count, 1);
  EXPECT_EQ(found.faces, 0u);
  EXPECT_GT(std::abs(found.axis[0].z), 0.9999f);
  // Not where most of the voxel ends at one of them only, nor where they are not parallel.
  const glm::dvec3 long_half(6, 1, 0.5), slanted = glm::normalize(glm::dvec3(1, 0, -1));
  EXPECT_FALSE(borderInVoxel(4, {{{0, 0, 0.25}, half, bottom}, {{2.5, 0, 0.75}, long_half, top}}).plate);
  const uint32_t roof = packBorderCode({&slanted, 1}, 1);
  EXPECT_FALSE(borderInVoxel(4, {{{0, 0, 0.25}, half, bottom}, {{0, 0, 0.75}, half, roof}}).plate);

  // Those of a plate are as thick as it is, on each level.
  VoxelMerger voxels(1, 1);
  voxels.clear(8);
  const uint32_t plate = packPlateCode(up);
  for (const double x : {-1.0, 1.0}) {
    const Splat splat{{}, {2, 2, 0.5}, {}, 2};
    const SplatScalar value{3, {0, 0, 0.25}, 0};
    voxels.add(0, {x, 0, 0}, splat, {&value, 1}, {plate, kNoGrowth});
  }
  Splat merged;
  SplatScalar value;
  EXPECT_TRUE(inwardAxes(voxels.finish(0, merged, {&value, 1}).border).plate);
  EXPECT_NEAR(merged.axis[2], 0.5, 1e-4);  // as well as the code has the direction
  EXPECT_NEAR(merged.axis[1], std::sqrt(0.418 * 4 + 0.582 * 64), 1e-4);
  EXPECT_NEAR(value.slope.z, 0.25, 1e-4);
}

TEST(VoxelMerger, DetailIsTheSpreadOfTheCentres) {
  SplatMerger merger(0);
  Splat splat;
  splat.weight = 1;
  std::mt19937_64 random(7);
  const glm::dmat3 turn = randomRotation(random);
  merger.add({0, 0, 0}, splat, {});
  EXPECT_EQ(merger.detail(), 0);
  for (const glm::dvec3& at : {glm::dvec3(4, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(4, 1, 0)})
    merger.add(turn * at, splat, {});
  EXPECT_NEAR(merger.detail(), std::sqrt(12 * 4.0), 1e-9);
}

TEST(VoxelMerger, DetailIsTheLeastGivenWhereThatIsMore) {
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> coordinate(-1, 1);
  Splat splat;
  splat.weight = 1;
  for (int repetition = 0; repetition < 200; ++repetition) {
    VoxelMerger merger(0, 1);
    for (int n = 0; n < 4; ++n)
      merger.add(0, {coordinate(random), coordinate(random), coordinate(random)}, splat, {});
    const double detail = merger.detail(0);
    for (const double factor : {0.0, 0.5, 0.99, 1 - 1e-13, 1.0, 1 + 1e-13, 1.01, 2.0})
      EXPECT_EQ(merger.detail(0, factor * detail), std::max(detail, factor * detail)) << factor;
  }
}

}  // namespace
}  // namespace curvisplat
