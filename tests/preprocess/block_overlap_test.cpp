// Blocks in one another are found with their volume, and blocks side by side are not. The sample points of
// blocks have their places in the order of the cells, however they are divided.
#include <gtest/gtest.h>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/survey/block_overlap.h"
#include "preprocess/survey/overlap_points.h"
#include "stream/base/error.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"

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

constexpr uint64_t kSlabBytes = 200'000, kPointBytes = uint64_t{1} << 30;

std::vector<BlockOverlap> overlapsIn(const GridSource& source, uint64_t slab_bytes = kSlabBytes,
                                     uint64_t point_bytes = kPointBytes) {
  return findOverlaps(source, {slab_bytes, point_bytes}, Progress());
}

/// Boxes of even nodes: from `lower`, `size` long along each axis.
struct TestBox {
  glm::dvec3 lower, size;
  uint64_t n;
};
FunctionGridSource boxes(const std::vector<TestBox>& all, glm::dmat3 turn = glm::dmat3(1.0)) {
  std::vector<GridBlock> blocks;
  for (const TestBox& box : all) {
    blocks.push_back(gridBlock(box.n, box.n + 1, box.n + 2));
    blocks.back().name = "box " + std::to_string(blocks.size());
  }
  return {blocks, 0, [=](const GridNode& node) {
            const TestBox& box = all[node.block];
            const auto n = static_cast<double>(box.n);
            const glm::dvec3 u(node.i / (n - 1), node.j / n, node.k / (n + 1));
            return NodeValues{turn * (box.lower + u * box.size), {}, false};
          }};
}

TEST(BlockOverlap, IsFoundWithItsVolume) {
  const glm::dmat3 turn(0.8, 0.6, 0, -0.6, 0.8, 0, 0, 0, 1);
  const auto source =
      boxes({{{0, 0, 0}, {2, 2, 2}, 24}, {{1.5, 0.5, 0}, {2, 2, 2}, 31}, {{9, 9, 9}, {1, 1, 1}, 5}}, turn);
  const auto overlaps = overlapsIn(source);
  ASSERT_EQ(overlaps.size(), 1u);
  EXPECT_EQ(overlaps[0].first, 0u);
  EXPECT_EQ(overlaps[0].second, 1u);
  EXPECT_NEAR(overlaps[0].volume, 0.5 * 1.5 * 2, 0.15);
  EXPECT_NEAR(overlaps[0].share, overlaps[0].volume / 8, 0.01);
  const std::string warning = overlapWarning(source.description(), overlaps);
  expectSays(warning, "box 1 and box 2");
  EXPECT_EQ(warning.find("box 3"), std::string::npos) << warning;
  // However it is read.
  EXPECT_EQ(overlapsIn(source, 20'000)[0].volume, overlaps[0].volume);
}

void expectSameOverlaps(const std::vector<BlockOverlap>& a, const std::vector<BlockOverlap>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t n = 0; n < a.size(); ++n) {
    EXPECT_EQ(a[n].first, b[n].first);
    EXPECT_EQ(a[n].second, b[n].second);
    EXPECT_EQ(a[n].volume, b[n].volume);
    EXPECT_EQ(a[n].share, b[n].share);
  }
}

// Points are located as many at a time as fit, and those of a block may not fit at once.
TEST(BlockOverlap, IsTheSameWithLittleMemory) {
  const glm::dmat3 turn(0.8, 0.6, 0, -0.6, 0.8, 0, 0, 0, 1);
  std::vector<TestBox> many{{{0.3, 0.3, 0.3}, {3.1, 3.2, 3.3}, 20}};
  for (int n = 0; n < 60; ++n)
    many.push_back(
        {{0.9 * (n % 4), 0.8 * (n / 4 % 4), 0.95 * (n / 16)}, {1, 1, 1}, 3 + static_cast<uint64_t>(n % 5)});
  many.push_back(many[7]);
  const auto source = boxes(many, turn);
  const auto all = overlapsIn(source);
  EXPECT_GT(all.size(), 100u);
  for (const auto& [slab_bytes, point_bytes] : {std::pair<uint64_t, uint64_t>{kSlabBytes, 0},
                                                {20'000, 200'000},
                                                {kSlabBytes, 2'000'000},
                                                {30'000, 8'000'000}}) {
    if (point_bytes >= 2'000'000 && !faults::isWholeSweep()) continue;
    SCOPED_TRACE(point_bytes);
    expectSameOverlaps(overlapsIn(source, slab_bytes, point_bytes), all);
  }
  // Rows of which not all points fit.
  const FunctionGridSource rows({gridBlock(4'001, 2, 2), gridBlock(3, 3, 3)}, 0, [](const GridNode& node) {
    const double size = node.block == 0 ? 5e-3 : 0.5, shift = node.block == 0 ? 0 : 19.5;
    return NodeValues{{shift + size * node.i, 0.7 * node.j, 0.6 * node.k}, {}, false};
  });
  const auto of_rows = overlapsIn(rows);
  ASSERT_EQ(of_rows.size(), 1u);
  EXPECT_NEAR(of_rows[0].volume, 0.5 * 0.7 * 0.6, 0.02);
  expectSameOverlaps(overlapsIn(rows, kSlabBytes, 0), of_rows);
}

TEST(BlockOverlap, InMorePairsThanFitIsRefusedWithASufficientSize) {
  const auto source = boxes(std::vector<TestBox>(500, {{0, 0, 0}, {1, 1, 1}, 3}));
  const auto find = [&](uint64_t point_bytes) {
    return findOverlaps(source, {kSlabBytes, point_bytes, [](uint64_t bytes) { return bytes; }}, Progress());
  };
  const auto all = overlapsIn(source);
  // More pairs than fit.
  const std::string error = errorOf([&] { find(1 << 20); }), before = "give at least ";
  const size_t at = error.find(before);
  ASSERT_NE(at, std::string::npos) << error;
  expectSameOverlaps(find(std::stoull(error.substr(at + before.size())) << 20), all);
}

TEST(BlockOverlap, OfASmallBlockWithinACellIsItsOwnVolume) {
  const auto overlaps = overlapsIn(boxes({{{0, 0, 0}, {100, 100, 100}, 4}, {{40, 40, 40}, {1, 1, 1}, 9}}));
  ASSERT_EQ(overlaps.size(), 1u);
  EXPECT_NEAR(overlaps[0].volume, 1, 0.05);
  EXPECT_NEAR(overlaps[0].share, 1, 0.05);
}

// A set may name one file thousands of times. All pairs of them would be the square of that.
TEST(BlockOverlap, OfOneBlockManyTimesIsFoundInFewPairs) {
  constexpr size_t kBlocks = 400;
  const auto source = boxes(std::vector<TestBox>(kBlocks, {{0, 0, 0}, {1, 1, 1}, 3}));
  const auto overlaps = overlapsIn(source);
  EXPECT_GE(overlaps.size(), kBlocks);
  EXPECT_LE(overlaps.size(), 16 * kBlocks);
  for (const BlockOverlap& overlap : overlaps) ASSERT_NEAR(overlap.share, 1, 1e-9);
  const std::string note = overlapNote(source.description(), overlaps);
  expectSays(note, ", 100 % of the smaller; ");
  EXPECT_EQ(overlapsIn(source, 2'000).size(), overlaps.size());  // however it is read
}

// The time grows as n log n, not as the square: every pair of 100,000 would take minutes.
TEST(BlockOverlap, IsFoundAmongManyBlocks) {
  std::vector<TestBox> many;
  const int count = faults::isWholeSweep() ? 100'000 : 30'000;
  for (int n = 0; n < count - 1; ++n)
    many.push_back({{2.0 * (n % 50), 2.0 * (n / 50 % 50), 2.0 * (n / 2500)}, {1, 1, 1}, 3});
  many.push_back(many[1234]);
  const auto overlaps = overlapsIn(boxes(many));
  ASSERT_EQ(overlaps.size(), 1u);
  EXPECT_EQ(overlaps[0].first, 1234u);
  EXPECT_EQ(overlaps[0].second, static_cast<uint32_t>(count - 1));
  EXPECT_NEAR(overlaps[0].share, 1, 1e-9);
}

// The axis-parallel boxes of blocks that are turned overlap, also where the blocks abut. No point lies in another block's slanted
// box, so no cell is read again for points in it.
TEST(BlockOverlap, OfTurnedBlocksThatAbutReadsThemOnce) {
  const glm::dmat3 turn(glm::dvec3(1, 1, 1) / std::sqrt(3.0), glm::dvec3(1, -1, 0) / std::sqrt(2.0),
                        glm::dvec3(1, 1, -2) / std::sqrt(6.0));
  std::vector<GridBlock> blocks(1000, gridBlock(4, 4, 4));
  std::atomic<uint64_t> nodes_read = 0;
  const FunctionGridSource source(blocks, 0, [&](const GridNode& node) {
    ++nodes_read;
    const glm::dvec3 lower(node.block % 10, node.block / 10 % 10, node.block / 100);
    return NodeValues{turn * (lower + glm::dvec3(node.i, node.j, node.k) / 3.0), {}, false};
  });
  EXPECT_TRUE(overlapsIn(source).empty());
  EXPECT_EQ(nodes_read, 1000u * 64);
}

// Needles and plates across all of the grid, slanted to all axes: their boxes hold nearly every point, and locating each point in
// each cell would take many minutes.
TEST(BlockOverlap, IsFoundAmongSlenderCellsThatAreSlanted) {
  const glm::dmat3 turn(glm::dvec3(1, 1, 1) / std::sqrt(3.0), glm::dvec3(1, -1, 0) / std::sqrt(2.0),
                        glm::dvec3(1, 1, -2) / std::sqrt(6.0));
  const auto overlapsOf = [&](const GridBlock& block, const glm::dvec3& spacing) {
    const double shift = 0.25 * static_cast<double>(block.ni - 1);
    return overlapsIn(FunctionGridSource({block, block}, 0,
                                         [=](const GridNode& node) {
                                           const glm::dvec3 at(node.i + (node.block == 1 ? shift : 0.0),
                                                               node.j, node.k);
                                           return NodeValues{turn * (at * spacing), {}, false};
                                         }),
                      4 << 20);
  };
  for (const auto& [name, overlaps] :
       {std::pair("needles", overlapsOf(gridBlock(61, 61, 4), {1, 1, 1e4})),
        std::pair("plates", overlapsOf(gridBlock(4'001, 3, 3), {2.5e-3, 50, 50}))}) {
    ASSERT_EQ(overlaps.size(), 1u) << name;
    EXPECT_NEAR(overlaps[0].share, 0.75, 0.01) << name;
  }
}

// Nearly every cell passes through nearly every other one, and meets most points of both blocks: 10,000 times each if those that are
// found, and the block's own, are not sorted out.
TEST(BlockOverlap, IsFoundAmongRandomCoordinatesByFewMeetings) {
  constexpr uint64_t kNodes = 20;
  constexpr uint64_t kPoints =
      2 * 23 * 23 * 23;  // 17 cells inside along an axis, and 3 points in either last cell
  std::vector<glm::dvec3> nodes(2 * kNodes * kNodes * kNodes);
  std::mt19937 random(1);
  for (glm::dvec3& node : nodes)
    for (glm::length_t axis = 0; axis < 3; ++axis) node[axis] = static_cast<double>(random()) / 0x1p32;
  const GridBlock block = gridBlock(kNodes, kNodes, kNodes);
  const FunctionGridSource source({block, block}, 0, [&](const GridNode& node) {
    return NodeValues{nodes[((node.block * kNodes + node.k) * kNodes + node.j) * kNodes + node.i], {}, false};
  });
  uint64_t met_in_vain = 0;
  const auto overlaps = findOverlaps(source, {4 << 20, kPointBytes}, Progress(), &met_in_vain);
  EXPECT_LT(met_in_vain, 500 * kPoints);
  ASSERT_EQ(overlaps.size(), 1u);
  EXPECT_EQ(overlaps[0].share, 1);
  // However it is read.
  EXPECT_EQ(overlapsIn(source, 20'000)[0].volume, overlaps[0].volume);
}

// Each point of such a block is near a few cells.
TEST(BlockOverlap, OfOrdinaryBlocksMeetsFewPointsInVain) {
  uint64_t met_in_vain = 0;
  findOverlaps(boxes({{{0, 0, 0}, {2, 2, 2}, 24}, {{1.5, 0.5, 0}, {2, 2, 2}, 31}}), {kSlabBytes, kPointBytes},
               Progress(), &met_in_vain);
  EXPECT_LT(met_in_vain, 100'000u);
}

TEST(BlockOverlap, IsNoneOfBlocksThatAbut) {
  EXPECT_TRUE(
      overlapsIn(boxes({{{0, 0, 0}, {1, 1, 1}, 9}, {{1, 0, 0}, {1, 1, 1}, 14}, {{0, 1, 0}, {2, 1, 1}, 6}}))
          .empty());
  // A curved face that two blocks cut differently: rings around an axis, wall cells a thousand times thinner.
  const FunctionGridSource rings({gridBlock(20, 15, 4), gridBlock(47, 10, 5)}, 0, [](const GridNode& node) {
    const bool outer = node.block == 1;
    const double turn = node.i / (outer ? 46.0 : 19.0) * 1.5;
    const double v = node.j / (outer ? 9.0 : 14.0);
    const double r = outer ? 2 + std::expm1(5 * v) / std::expm1(5.0) : 1 + v;
    const double z = node.k / (outer ? 4.0 : 3.0);
    return NodeValues{{r * std::cos(turn), r * std::sin(turn), z}, {}, false};
  });
  EXPECT_TRUE(overlapsIn(rings).empty());
  EXPECT_TRUE(overlapsIn(boxes({{{0, 0, 0}, {1, 1, 1}, 9}})).empty());
}

TEST(BlockOverlap, IsNoneWhereOneIsBlanked) {
  const FunctionGridSource source(
      {gridBlock(11, 11, 11), gridBlock(11, 11, 11)}, 0, [](const GridNode& node) {
        const double shift = node.block == 1 ? 5.0 : 0.0;
        const bool blank = node.block == 0 && node.i > 5;
        return NodeValues{
            {static_cast<double>(node.i) + shift, static_cast<double>(node.j), static_cast<double>(node.k)},
            {},
            blank};
      });
  EXPECT_TRUE(overlapsIn(source).empty());
}

TEST(BlockOverlap, OfRealOversetGrids) {
  const std::filesystem::path folder = std::filesystem::path(CURVISPLAT_SHARED_DATA) / "overset";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "needs " << folder;
  const auto of = [&](const char* name) {
    OpenGridOptions options;
    options.grid = folder / name;
    const auto source = openGrid(options);
    const auto overlaps = overlapsIn(*source, 1 << 20);
    for (const BlockOverlap& o : overlaps)
      std::printf("%s: blocks %u and %u: %g, %g of the smaller\n", name, o.first, o.second, o.volume,
                  o.share);
    return overlaps;
  };
  EXPECT_TRUE(of("cylinder_chimera_abutting.x").empty());
  EXPECT_FALSE(of("cylinder_chimera_overlapping_singledonor.x").empty());
}

}  // namespace
}  // namespace curvisplat
