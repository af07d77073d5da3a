#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "preprocess/convert/scan.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/survey/position_sample.h"
#include "stream/base/progress.h"
#include "tests/reference/function_grid.h"

namespace curvisplat {
namespace {

FunctionGridSource twoBoxes(Centring centring = Centring::kNode) {
  return FunctionGridSource(
      {gridBlock(40, 30, 25), gridBlock(7, 60, 31)}, 1,
      [](const GridNode& node) {
        const double side = node.block == 0 ? 0 : 100;
        return NodeValues{
            {side + static_cast<double>(node.i), static_cast<double>(node.j), static_cast<double>(node.k)},
            {1.0f},
            node.block == 0 && node.i == 20};
      },
      centring);
}

PositionSample sampleOf(const GridSource& source, uint64_t most, uint64_t slab_bytes) {
  uint64_t nodes = 0;
  for (const GridBlock& block : source.description().blocks) nodes += block.nodes();
  PositionSample sample(nodes, most);
  const NodeReader reader(source, {0}, std::nullopt);
  Progress progress;
  surveyGrid(reader, slab_bytes, {nullptr, &sample}, progress);
  return sample;
}

std::vector<std::tuple<double, double, double>> sorted(const PositionSample& sample) {
  std::vector<std::tuple<double, double, double>> positions;
  for (const glm::dvec3& at : sample.positions()) positions.emplace_back(at.x, at.y, at.z);
  std::sort(positions.begin(), positions.end());
  return positions;
}

TEST(PositionSample, IsTheSameForAnySlabs) {
  const auto whole = sorted(sampleOf(twoBoxes(), 3000, 64 << 20));
  EXPECT_GT(whole.size(), 2500u);
  for (const uint64_t slab_bytes : {200'000, 20'000, 300}) {
    SCOPED_TRACE(slab_bytes);
    EXPECT_TRUE(sorted(sampleOf(twoBoxes(), 3000, slab_bytes)) == whole);
  }
  EXPECT_TRUE(std::adjacent_find(whole.begin(), whole.end()) == whole.end());
}

TEST(PositionSample, HasAllNodesOfASmallGridButBlankedOnes) {
  const PositionSample sample = sampleOf(twoBoxes(), 100'000, 64 << 20);
  EXPECT_EQ(sample.nodesEach(), 1u);
  EXPECT_EQ(sample.positions().size(), 39u * 30 * 25 + 7 * 60 * 31);
}

/// Of a part of the grid, be it a plane, a column or a box, about as many as of the others.
TEST(PositionSample, IsEven) {
  const PositionSample sample = sampleOf(twoBoxes(), 6000, 64 << 20);
  ASSERT_GT(sample.nodesEach(), 5u);
  const auto expectAbout = [&](double nodes, auto is_in) {
    const auto found = std::count_if(sample.positions().begin(), sample.positions().end(), is_in);
    const double expected = nodes / sample.nodesEach();
    EXPECT_NEAR(static_cast<double>(found), expected, 4 * std::sqrt(expected));
  };
  expectAbout(7 * 60 * 31, [](const glm::dvec3& at) { return at.x >= 100; });
  for (int n = 0; n < 5; ++n) {
    SCOPED_TRACE(n);
    expectAbout(30 * 25, [n](const glm::dvec3& at) { return at.x == 3 * n + 1; });
    expectAbout(39 * 25, [n](const glm::dvec3& at) { return at.x < 100 && at.y == 6 * n; });
    expectAbout(39 * 30, [n](const glm::dvec3& at) { return at.x < 100 && at.z == 5 * n; });
    expectAbout(1000, [n](const glm::dvec3& at) {
      return at.x < 10 && at.y >= 5 * n && at.y < 5 * n + 10 && at.z < 10;
    });
  }
}

TEST(PositionSample, OfCellsHasEachNodeOnce) {
  const auto positions = sorted(sampleOf(twoBoxes(Centring::kCell), 3000, 30'000));
  EXPECT_GT(positions.size(), 2000u);
  EXPECT_TRUE(std::adjacent_find(positions.begin(), positions.end()) == positions.end());
}

}  // namespace
}  // namespace curvisplat
