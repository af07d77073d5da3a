// Sample points of blocks have their places in the order of the cells, however they are divided.
#include "preprocess/survey/overlap_points.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "preprocess/grid/node_reader.h"
#include "tests/reference/function_grid.h"

namespace curvisplat {
namespace {

TEST(AxisSampling, StandsForAllCellsInOrder) {
  for (const uint64_t cells : {1, 2, 3, 4, 7, 100, 1001})
    for (const uint64_t wanted : {0, 1, 2, 5, 30, 2000})
      for (const bool few : {false, true}) {
        const AxisSampling axis(cells, wanted, few);
        uint64_t points = 0, sampled = 0;
        double represented = 0;
        for (uint64_t cell = 0; cell < cells; ++cell) {
          const AxisSampling::Cell at = axis.at(cell);
          ASSERT_EQ(at.before, points) << cells << " " << wanted << " " << cell;
          points += at.points.size();
          sampled += !at.points.empty();
          for (const AxisSampling::Point& point : at.points) {
            represented += point.cells;
            EXPECT_TRUE(point.t > 0 && point.t < 1);
          }
        }
        EXPECT_EQ(axis.points(), points);
        EXPECT_EQ(axis.at(cells).before, points);
        EXPECT_NEAR(represented, static_cast<double>(cells), 1e-9 * static_cast<double>(cells));
        EXPECT_EQ(sampled, std::min(cells, 2 + std::max<uint64_t>(1, wanted)));
      }
}

TEST(BlockSampling, IsCutIntoPartsThatFit) {
  for (const GridBlock& block : {gridBlock(40, 30, 20), gridBlock(3000, 2, 2), gridBlock(2, 3, 900)})
    for (const uint64_t most : {216u, 500u, 5000u}) {
      const BlockSampling sampling(block, 1e6, 2);
      uint64_t begin = 0, points = 0, parts = 0;
      while (begin < sampling.endOfCells()) {
        const uint64_t end = sampling.endOfPart(begin, most);
        ASSERT_GT(end, begin);
        const uint64_t count = sampling.pointsBefore(end) - sampling.pointsBefore(begin);
        EXPECT_LE(count, most);
        points += count;
        begin = end;
        ++parts;
      }
      EXPECT_EQ(points, sampling.points());
      EXPECT_LE(parts, 2 + 2 * points / (most - 215));  // nearly as many as fit
    }
}

TEST(PointPicker, GivesTheSamePointsOfPartsAndSlabs) {
  const GridBlock block = gridBlock(14, 9, 11);
  const FunctionGridSource source({block}, 0, [](const GridNode& node) {
    return NodeValues{
        {node.i + 0.1 * node.j, 1.0 * node.j, node.k + 0.2 * node.i}, {}, node.i == 0 && node.j < 3};
  });
  const NodeReader reader(source, {}, std::nullopt);
  const BlockSampling sampling(block, 3e7, 2);
  const auto pick = [&](uint64_t most, uint64_t slab_bytes, double& volume) {
    std::vector<BlockPoint> points;
    for (uint64_t begin = 0; begin < sampling.endOfCells();) {
      const CellPart part{0, begin, sampling.endOfPart(begin, most)};
      PointPicker picker(block, sampling, part, points);
      SlabStream slabs(reader, slab_bytes, kCornerHalo);
      while (const LoadedSlab* loaded = slabs.next()) picker.add(*loaded);
      picker.finish(volume, nullptr);
      begin = part.end;
    }
    return points;
  };
  double volume = 0;
  const std::vector<BlockPoint> all = pick(1'000'000, 1 << 20, volume);
  EXPECT_LT(all.size(), sampling.points());  // some are blanked
  EXPECT_GT(all.size(), sampling.points() / 2);
  for (const auto& [most, slab_bytes] :
       {std::pair(300u, 1u << 20), std::pair(1'000'000u, 2000u), std::pair(777u, 5000u)}) {
    double other_volume = 0;
    const std::vector<BlockPoint> others = pick(most, slab_bytes, other_volume);
    EXPECT_EQ(other_volume, volume);
    ASSERT_EQ(others.size(), all.size());
    for (size_t n = 0; n < all.size(); ++n) {
      ASSERT_EQ(others[n].position, all[n].position) << n;
      ASSERT_EQ(others[n].volume, all[n].volume) << n;
    }
  }
}

}  // namespace
}  // namespace curvisplat
