// Measures of what cells have beyond their ellipsoids, and how cells are cut for it.
#include "preprocess/survey/cell_bends.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/grid/grid_views.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/survey/joined_axes.h"
#include "stream/base/error.h"
#include "tests/reference/function_grid.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr uint64_t kAll = 1'000'000;

using Place = std::function<glm::dvec3(glm::dvec3 index, uint32_t block)>;

std::unique_ptr<GridSource> gridOf(const std::vector<GridBlock>& blocks, const Place& place) {
  return std::make_unique<FunctionGridSource>(blocks, 1, [place](const GridNode& node) {
    const glm::dvec3 index(static_cast<double>(node.i), static_cast<double>(node.j),
                           static_cast<double>(node.k));
    const glm::dvec3 at = place(index, node.block);
    return NodeValues{at, {static_cast<float>(at.x)}};  // the same where blocks meet
  });
}

/// A ring of `around` cells, along j.
glm::dvec3 onRing(const glm::dvec3& index, double around, double first_radius = 4) {
  const double turn = 2 * std::numbers::pi * index.y / around, radius = first_radius + index.x;
  return {radius * std::cos(turn), radius * std::sin(turn), index.z};
}

uint64_t nodesOf(const GridSource& grid) {
  uint64_t nodes = 0;
  for (const GridBlock& block : grid.description().blocks) nodes += block.nodes();
  return nodes;
}

uint64_t splatsOf(const GridSource& grid) {
  const TemporaryFolder folder;
  ConvertOptions options;
  options.output = folder / "a.splats";
  options.scalars = {0};
  return converted(grid, options).splats;
}

TEST(CellBends, ParallelepipedsHaveNone) {
  const auto grid = gridOf({gridBlock(5, 6, 7), gridBlock(2, 5, 5)}, [](const glm::dvec3& n, uint32_t) {
    return glm::dvec3(1e3 + n.x + 6 * n.z, 2 * n.y, 0.5 * n.z - n.x);
  });
  for (const BlockBends& bends : measureBends(*grid, kAll)) EXPECT_LT(bends.deviation(), 1e-9);
  EXPECT_FALSE(refinementByNeed(*grid).cutsCells());
  EXPECT_EQ(noteOnCells(*grid), "");
}

TEST(CellBends, LeavesColumnsWhereThreeBlocksMeet) {
  const auto grid = [](double length) {  // of the column's edge from (1, 1) to (0, 1)
    return gridOf({gridBlock(2, 2, 4), gridBlock(4, 2, 2)}, [length](const glm::dvec3& n, uint32_t block) {
      if (block == 1) return glm::dvec3(10 + n.x, n.y, n.z);
      return glm::dvec3(n.y == 0 ? n.x : 1 - length * (1 - n.x), n.y, n.z);
    });
  };
  EXPECT_EQ(measureBends(*grid(0), kAll).at(0).deviation(), 0);
  EXPECT_FALSE(refinementByNeed(*grid(0)).cutsCells());
  EXPECT_GT(measureBends(*grid(0.1), kAll).at(0).deviation(), 1);
}

/// The deviation of cells that are cut, over that of whole ones.
double rest(const Place& place, const CellCuts& cuts) {
  const BlockBends bends = measureBends(*gridOf({gridBlock(6, 6, 6)}, place), kAll).at(0);
  EXPECT_GT(bends.deviation(), 0.01);
  return bends.deviation(cuts) / bends.deviation();
}

TEST(CellBends, EachKindFallsWithTheCutsThatHelp) {
  const Place bend = [](const glm::dvec3& n, uint32_t) {
    return glm::dvec3(n.x, n.y, n.z + 0.05 * n.x * n.x);
  };
  EXPECT_NEAR(rest(bend, {2, 1, 1}), std::pow(2, -1.5), 1e-9);
  EXPECT_NEAR(rest(bend, {1, 2, 1}), 1, 1e-9);
  EXPECT_NEAR(rest(bend, {1, 1, 2}), 2, 1e-9) << "parts bend as far, and are thinner";
  const Place taper = [](const glm::dvec3& n, uint32_t) {
    return glm::dvec3(n.x * (1 + 0.05 * n.y), n.y, n.z);
  };
  EXPECT_LT(rest(taper, {1, 2, 1}), 0.6);
  EXPECT_GT(rest(taper, {2, 1, 1}), 0.9);
  const Place twist = [](const glm::dvec3& n, uint32_t) {
    return glm::dvec3(n.x, n.y, n.z + 0.05 * (n.x - 2.5) * (n.y - 2.5));
  };
  EXPECT_NEAR(rest(twist, {2, 2, 2}), 0.5, 1e-9);
  const Place growth = [](const glm::dvec3& n, uint32_t) { return glm::dvec3(std::pow(1.3, n.x), n.y, n.z); };
  EXPECT_NEAR(rest(growth, {2, 1, 1}), std::sqrt(0.5), 1e-9);
}

TEST(CellBends, LooksPastNodesThatAreMissing) {
  const auto grid =
      std::make_unique<FunctionGridSource>(std::vector{gridBlock(7, 7, 7)}, 0, [](const GridNode& node) {
        const glm::dvec3 at(static_cast<double>(node.i), static_cast<double>(node.j),
                            static_cast<double>(node.k));
        if (node.i == 1 && node.j == 3)
          return NodeValues{glm::dvec3(std::numeric_limits<double>::quiet_NaN()), {}};
        return NodeValues{node.i == 1 && node.j == 2 ? -99.0 * at : at, {}, node.i == 1 && node.j == 2};
      });
  const BlockBends bends = measureBends(*grid, kAll).at(0);
  EXPECT_EQ(bends.volume, 5 * 5 * 5 - 2 * 4 * 5) << "at nodes with all their neighbours";
  EXPECT_LT(bends.deviation(), 1e-9);
}

TEST(CellBends, AreTheSameForAnyThreads) {
  const auto grid = gridOf({gridBlock(41, 43, 90)}, [](const glm::dvec3& n, uint32_t) {
    return onRing(n, 60) + glm::dvec3(0, 0, std::sin(n.x + 3 * n.y));
  });
  const auto measured = [&](unsigned threads, uint64_t nodes) {
    const ConversionThreads bound(threads);
    return measureBends(*grid, nodes).at(0);
  };
  for (const uint64_t nodes : {uint64_t{10'000}, kAll}) {
    const BlockBends one = measured(1, nodes), two = measured(2, nodes);
    EXPECT_EQ(one.squares, two.squares);
    EXPECT_EQ(one.volume, two.volume);
  }
}

TEST(RefinementByNeed, CutsAlongTheRowsThatBend) {
  const auto ring =
      gridOf({gridBlock(9, 13, 9)}, [](const glm::dvec3& n, uint32_t) { return onRing(n, 12); });
  const Refinement refinement = refinementByNeed(*ring);
  const CellCuts& cuts = refinement.ofBlock(0);
  EXPECT_EQ(cuts[0], 1u);
  EXPECT_GE(cuts[1], 2u);
  EXPECT_EQ(cuts[2], 1u);
  EXPECT_NE(noteOnCells(*ring).find("--refine auto"), std::string::npos);
  const auto fine =
      gridOf({gridBlock(9, 201, 9)}, [](const glm::dvec3& n, uint32_t) { return onRing(n, 200); });
  EXPECT_FALSE(refinementByNeed(*fine).cutsCells());
  EXPECT_EQ(noteOnCells(*fine), "");
}

/// A ring of 12 cells, a straight block that goes on from its last j with the axes (k, i, j), and one apart.
std::unique_ptr<GridSource> ringAndBlocks() {
  return gridOf({gridBlock(5, 7, 6), gridBlock(6, 5, 4), gridBlock(4, 4, 4)},
                [](const glm::dvec3& n, uint32_t block) {
                  if (block == 0) return onRing(n, 12);
                  if (block == 2) return n + glm::dvec3(50, 50, 0);
                  return onRing({n.y, 6, n.x}, 12) + glm::dvec3(0, -n.z, 0);
                });
}

TEST(RefinementByNeed, JoinedRowsAreCutAlike) {
  const auto axes = joinedAxes(*ringAndBlocks());
  EXPECT_EQ(axes[0][0], axes[1][1]);
  EXPECT_EQ(axes[0][2], axes[1][0]);
  EXPECT_NE(axes[0][1], axes[1][2]);
  for (const uint32_t of_other : axes[2])
    for (size_t block = 0; block < 2; ++block)
      for (const uint32_t of_class : axes[block]) EXPECT_NE(of_class, of_other);

  const auto whole = ringAndBlocks();
  const Refinement cut({{2, 4, 8}, {8, 2, 1}, {1, 1, 2}});
  const TemporaryFolder folder;
  ConvertOptions options;
  options.output = folder / "a.splats";
  options.scalars = {0};
  EXPECT_EQ(converted(*refined(ringAndBlocks(), cut), options).merged_nodes, (2u * 4 + 1) * (8 * 5 + 1));
  const Refinement found = refinementByNeed(*whole);
  EXPECT_EQ(found.ofBlock(0)[0], found.ofBlock(1)[1]);
  EXPECT_EQ(found.ofBlock(0)[2], found.ofBlock(1)[0]);
  EXPECT_GE(found.ofBlock(0)[1], 2u);
  EXPECT_EQ(found.ofBlock(1)[2], 1u);
  EXPECT_EQ(found.ofBlock(2), kWholeCells);
}

TEST(RefinementByNeed, HalvesAllCellsOfFewThatMeetAtAnAngle) {
  // A herringbone of blocks that taper, and a straight one: what joints add is not measured.
  const auto grid = [](uint64_t along) {
    return gridOf({gridBlock(along, 8, 7), gridBlock(along, 8, 7), gridBlock(6, 6, 6)},
                  [](const glm::dvec3& n, uint32_t block) {
                    if (block == 2) return n + glm::dvec3(0, 100, 0);
                    const double side = block == 0 ? 1 : -1;
                    return glm::dvec3(side * n.x, n.y + 0.8 * n.x, n.z * (1 + 0.3 * n.y));
                  });
  };
  const auto few = grid(6), many = grid(200);
  const double deviation = measureBends(*few, kAll).at(0).deviation();
  EXPECT_GT(deviation, 0.3);
  EXPECT_LT(deviation, 0.6);
  const Refinement found = refinementByNeed(*few);
  EXPECT_EQ(found.ofBlock(0), (CellCuts{2, 2, 2}));
  EXPECT_EQ(found.ofBlock(1), (CellCuts{2, 2, 2}));
  EXPECT_EQ(found.ofBlock(2), kWholeCells);
  EXPECT_FALSE(refinementByNeed(*many).cutsCells());
}

/// Two even blocks of `count` nodes along each axis, whose rows turn where they meet by twice the arc tangent of `lean`.
std::unique_ptr<GridSource> herringbone(uint64_t count, double lean) {
  return gridOf(std::vector(2, gridBlock(count, count, count)), [lean](const glm::dvec3& n, uint32_t block) {
    return glm::dvec3(block == 0 ? n.x : -n.x, n.y + lean * n.x, n.z);
  });
}

TEST(RefinementByNeed, HalvesFewCellsWhoseRowsTurnAtAJoint) {
  for (const double of_block : deviationAtKinks(*herringbone(7, 2)))
    EXPECT_NEAR(of_block, 45.0 * 4 / 36, 1e-9);
  const auto ring = gridOf({gridBlock(5, 13, 5)}, [](const glm::dvec3& n, uint32_t) {
    return onRing({n.x, std::fmod(n.y, 12), n.z}, 12);
  });
  const double turn = std::tan(std::numbers::pi / 12);
  EXPECT_NEAR(deviationAtKinks(*ring).at(0), 2 * 45 * turn * turn / (12 * 12), 1e-9) << "at both ends";
  EXPECT_EQ(
      deviationAtKinks(*gridOf({gridBlock(4, 4, 4)}, [](const glm::dvec3& n, uint32_t) { return n; })).at(0),
      0);

  for (uint32_t block = 0; block < 2; ++block) {
    EXPECT_EQ(refinementByNeed(*herringbone(7, 1.5)).ofBlock(block), (CellCuts{2, 2, 2}));
    EXPECT_EQ(refinementByNeed(*herringbone(17, 0.7)).ofBlock(block), kWholeCells);
  }
}

// Optical depths of the same grids deviate by 2.7 and 0.8 % with whole and with halved cells, and by 10 and 2.5 %.
TEST(NoteOnCells, IsForThoseThatShowAfterTheCut) {
  const auto note = [](double lean, const Refinement& refinement) {
    return noteOnCells(*refined(herringbone(7, lean), refinement), true);
  };
  const Refinement by_need = refinementByNeed(*herringbone(7, 3));
  EXPECT_NE(note(1.5, Refinement(1)), "");
  EXPECT_EQ(note(1.5, by_need), "");
  EXPECT_NE(note(3, Refinement(1)), "");
  EXPECT_NE(note(3, by_need).find("--refine N with a larger N"), std::string::npos);
  EXPECT_EQ(note(3, Refinement(4)), "");
}

TEST(RefinementByNeed, HalvesCellsOfSmallBlocksThatEndInStairs) {
  enum class Land { kStairs, kCliff, kOneHole };
  const auto sea = [](Land land, uint64_t n, bool by_value, float value) {
    GridBlock block = gridBlock(n, n, n);
    block.has_blanking = true;
    return FunctionGridSource({block}, 1, [=](const GridNode& node) {
      const glm::dvec3 at(static_cast<double>(node.i), static_cast<double>(node.j),
                          static_cast<double>(node.k));
      const bool is_land = land == Land::kStairs  ? 3 * node.k < node.i + node.j
                           : land == Land::kCliff ? node.i < n / 2
                                                  : node.i == 5 && node.j == 5 && node.k == 5;
      return NodeValues{at, {is_land && by_value ? value : 1.0f}, is_land && !by_value};
    });
  };
  const CellCuts halves{2, 2, 2};
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  for (const bool by_value : {false, true}) {
    EXPECT_EQ(refinementByNeed(sea(Land::kStairs, 16, by_value, kNone), {0}).ofBlock(0), halves);
    EXPECT_EQ(refinementByNeed(sea(Land::kCliff, 16, by_value, kNone), {0}).ofBlock(0), kWholeCells);
    EXPECT_EQ(refinementByNeed(sea(Land::kOneHole, 24, by_value, kNone), {0}).ofBlock(0), kWholeCells);
    EXPECT_EQ(refinementByNeed(sea(Land::kStairs, 50, by_value, kNone), {0}).ofBlock(0), kWholeCells);
  }
  EXPECT_EQ(refinementByNeed(sea(Land::kStairs, 16, true, -99), {0}).ofBlock(0), kWholeCells);
  EXPECT_EQ(refinementByNeed(sea(Land::kStairs, 16, true, -99), {0}, -99).ofBlock(0), halves);
}

/// Nodes that a block blanks may be drawn by another one, as coarser cells are by finer ones.
TEST(RefinementByNeed, LeavesStairsThatAnotherBlockMayFill) {
  const auto two_blocks = [](double second_from) {
    GridBlock block = gridBlock(16, 16, 16);
    block.has_blanking = true;
    return FunctionGridSource({block, gridBlock(9, 9, 9)}, 1, [=](const GridNode& node) {
      const glm::dvec3 at(static_cast<double>(node.i), static_cast<double>(node.j),
                          static_cast<double>(node.k));
      if (node.block == 1) return NodeValues{second_from + 0.5 * at, {1.0f}, false};
      return NodeValues{at, {1.0f}, 3 * node.k < node.i + node.j};
    });
  };
  EXPECT_EQ(refinementByNeed(two_blocks(0), {0}).ofBlock(0), kWholeCells);
  EXPECT_EQ(refinementByNeed(two_blocks(15), {0}).ofBlock(0),
            (CellCuts{2, 2, 2}));  // touches the first one's corner
}

/// A scalar of one value everywhere, and one that is 0 here and there.
std::unique_ptr<FunctionGridSource> withScatteredZeros() {
  return std::make_unique<FunctionGridSource>(
      std::vector{gridBlock(16, 16, 16)}, 2, [](const GridNode& node) {
        const bool is_zero = (node.i * 7 + node.j * 5 + node.k * 3) % 11 == 0;
        return NodeValues{
            glm::dvec3(static_cast<double>(node.i), static_cast<double>(node.j), static_cast<double>(node.k)),
            {1.0f, is_zero ? 0.0f : 1.0f}};
      });
}

TEST(RefinementByNeed, LooksForStairsWhereNoScalarHasAValue) {
  const auto grid = withScatteredZeros();
  EXPECT_EQ(refinementByNeed(*grid, {0}, 0).ofBlock(0), kWholeCells);
  EXPECT_EQ(refinementByNeed(*grid, {0, 1}, 0).ofBlock(0), kWholeCells);
  EXPECT_EQ(refinementByNeed(*grid, {1}, 0).ofBlock(0), (CellCuts{2, 2, 2}));
  EXPECT_EQ(refinementByNeed(*grid, {1}).ofBlock(0), kWholeCells);
}

/// A grid whose second scalar cannot be read.
class DamagedGrid : public GridSource {
 public:
  const GridDescription& description() const override { return grid_->description(); }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    if (std::ranges::count(scalars, 1u) > 0) throw Error("damaged");
    grid_->read(block, box, scalars, out);
  }

 private:
  std::unique_ptr<FunctionGridSource> grid_ = withScatteredZeros();
};

TEST(RefinementByNeed, LeavesDamagedScalarsToTheConversion) {
  for (const std::vector<uint32_t>& scalars : {std::vector<uint32_t>{0}, {1}, {0, 1}})
    EXPECT_FALSE(refinementByNeed(DamagedGrid(), scalars).cutsCells());
}

TEST(RefinementByNeed, KeepsToItsBounds) {
  // Cells that no cut makes even.
  const auto wild =
      gridOf({gridBlock(9, 9, 9), gridBlock(12, 5, 7)}, [](const glm::dvec3& n, uint32_t block) {
        return n + glm::dvec3(0.6 * std::sin(3 * n.y + n.z), 0.6 * std::sin(2 * n.x),
                              40.0 * block + 0.5 * std::sin(4 * n.x * n.y));
      });
  const auto fine =
      refined(gridOf(wild->description().blocks, [](const glm::dvec3& n, uint32_t) { return n; }),
              refinementByNeed(*wild));
  EXPECT_LE(nodesOf(*fine), 8 * nodesOf(*wild));
  EXPECT_GT(nodesOf(*fine), nodesOf(*wild));

  // Blocks of one cell share nearly all of their nodes, and each node is one splat.
  const auto cubes = [] {
    return gridOf(std::vector(64, gridBlock(2, 2, 2)), [](const glm::dvec3& n, uint32_t block) {
      const glm::dvec3 at = n + glm::dvec3(block % 4, block / 4 % 4, block / 16);
      return at + glm::dvec3(0.3 * std::sin(3 * at.y + at.z), 0.3 * std::sin(2 * at.x),
                             0.25 * std::sin(4 * at.x * at.y));
    });
  };
  const Refinement of_cubes = refinementByNeed(*cubes());
  EXPECT_TRUE(of_cubes.cutsCells());
  EXPECT_LE(splatsOf(*refined(cubes(), of_cubes)), 8 * splatsOf(*cubes()));

  // More than a million nodes: only blocks of less than half of them can be cut.
  const auto large =
      gridOf({gridBlock(17, 25, 400), gridBlock(10, 100, 1000)}, [](const glm::dvec3& n, uint32_t block) {
        return block == 0 ? onRing(n, 24) : n + glm::dvec3(100, 0, 0);
      });
  const Refinement found = refinementByNeed(*large);
  EXPECT_EQ(found.ofBlock(0), (CellCuts{1, 2, 1}));
  EXPECT_EQ(found.ofBlock(1), kWholeCells);
  const auto too_large =
      gridOf({gridBlock(9, 25, 6000)}, [](const glm::dvec3& n, uint32_t) { return onRing(n, 24); });
  EXPECT_FALSE(refinementByNeed(*too_large).cutsCells());
}

TEST(RefinementByNeed, HasTheSameBytesForAnyThreadsMemoryAndRanks) {
  const auto grid = refined(ringAndBlocks(), refinementByNeed(*ringAndBlocks()));
  const TemporaryFolder folder;
  ConvertOptions options;
  options.output = folder / "one.splats";
  options.scalars = {0};
  options.threads = 1;
  options.overwrite = true;
  expectSameCaches(*grid, options,
                   {{.threads = 2, .bucket_splats = 500, .slab_bytes = 40'000},
                    {.bucket_splats = 500, .slab_bytes = 40'000, .ranks = 2},
                    {.bucket_splats = 500, .slab_bytes = 40'000, .ranks = 3}});
}

}  // namespace
}  // namespace curvisplat
