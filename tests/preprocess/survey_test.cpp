#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <glm/vec3.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <future>
#include <map>
#include <new>
#include <random>
#include <tuple>
#include <vector>

#include "preprocess/convert/bucket_plan.h"
#include "preprocess/convert/scan.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/survey/grid_statistics.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "tests/reference/function_grid.h"
#include "tests/support/memory_limit.h"

namespace curvisplat {
namespace {

GridStatistics measured(const GridSource& source, const std::vector<uint32_t>& scalars,
                        uint64_t slab_bytes = 50'000) {
  Progress progress;
  return measureGrid(source, scalars, slab_bytes, progress);
}

TEST(GridStatistics, CountWhatIsOdd) {
  // A box; a node pulled through the opposite face of its cells inverts some, one blank node takes eight
  // cells away, and two nodes in one place make degenerate ones.
  const FunctionGridSource nodes({gridBlock(10, 9, 8), gridBlock(2, 2, 2)}, 1, [](const GridNode& node) {
    NodeValues values{glm::dvec3(node.i, node.j, node.k), {static_cast<float>(node.i)}, false};
    if (node.block == 1) return NodeValues{values.position * 0.5 + 20.0, {-7}, false};
    if (node.i == 2 && node.j == 2 && node.k == 2) values.blank = true;
    if (node.i == 9 && node.j == 8 && node.k == 7) values.position.x = 8;
    if (node.i == 0 && node.j == 0 && node.k == 7) values.scalars[0] = NAN;
    return values;
  });
  const CellGridSource source(nodes, {[](const GridCell& cell) { return cell.centre.z; }});
  const GridStatistics statistics = measured(source, {0, 1});
  ASSERT_EQ(statistics.blocks.size(), 2u);
  EXPECT_EQ(statistics.blocks[0].cells, 9u * 8 * 7 - 8);
  EXPECT_EQ(statistics.blocks[0].blank.by_grid, 1u);
  EXPECT_EQ(statistics.blocks[0].blank.not_finite, 1u);
  EXPECT_EQ(statistics.blocks[0].degenerate, 1u);
  EXPECT_EQ(statistics.blocks[0].inverted, 0u);
  EXPECT_EQ(statistics.blocks[1].cells, 1u);
  EXPECT_NEAR(statistics.blocks[1].volume, 0.125, 1e-12);
  EXPECT_EQ(statistics.cells(), 504u - 8 + 1);
  EXPECT_EQ(statistics.scalars[0].min, -7);
  EXPECT_EQ(statistics.scalars[0].max, 9);
  EXPECT_EQ(statistics.scalars[1].min, 0.5);
  EXPECT_EQ(statistics.scalars[1].max, 20.25);
  EXPECT_EQ(statistics.bounds[0].max, 20.5);
}

TEST(GridStatistics, InvertedCellsAreTheFewer) {
  for (const double hand : {1.0, -1.0}) {
    const FunctionGridSource source({gridBlock(6, 6, 6)}, 0, [&](const GridNode& node) {
      // Planes 2 and 3 along i have changed places: the cells between them are turned over.
      const double i = node.i == 2 ? 3 : node.i == 3 ? 2 : static_cast<double>(node.i);
      return NodeValues{{hand * i, static_cast<double>(node.j), static_cast<double>(node.k)}, {}, false};
    });
    EXPECT_EQ(measured(source, {}).inverted(), 25u);
  }
}

TEST(GridStatistics, OfRealGrids) {
  const std::filesystem::path shared = CURVISPLAT_SHARED_DATA;
  if (!std::filesystem::is_directory(shared)) GTEST_SKIP() << "needs " << shared;
  const auto of = [&](const char* grid) {
    OpenGridOptions options;
    options.grid = shared / grid;
    return measured(*openGrid(options), {}, 8 << 20);
  };
  EXPECT_EQ(of("bluntfin/bluntfinxyz.bin").degenerate(), 39u);
  EXPECT_EQ(of("combustor/combxyz.bin").inverted(), 2u);
  // 2,279 by those who count exact zeros in their own precision.
  EXPECT_NEAR(static_cast<double>(of("fortran/sduct.new.x.bin").degenerate()), 2279, 1);
  EXPECT_EQ(of("nek/Combined_PressureSide_Block.xyz").inverted(), 0u);
}

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

/// A part of the grid, be it a plane, a column or a box, has about as many samples as the others.
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

RootPosition randomPosition(std::mt19937_64& random, int bits) {
  RootPosition position;
  for (auto& at : position.at) at = random() >> (64 - bits);
  return position;
}

TEST(CountingGrid, CountsWhatWasAddedAtEveryLevel) {
  std::mt19937_64 random(1);
  const auto counts = makeCountingGrid(6, 64 << 20);
  VoxelRuns runs(counts->level());
  std::vector<RootPosition> positions;
  for (int n = 0; n < 20000; ++n) positions.push_back(randomPosition(random, n % 2 ? 48 : 44));
  for (const RootPosition& position : positions) runs.add(position);
  counts->add(runs.level(), runs.runs());
  counts->close();
  ASSERT_EQ(counts->level(), 6u);
  for (uint32_t level = 0; level <= 6; ++level) {
    std::map<std::array<uint32_t, 3>, uint64_t> expected;
    for (const RootPosition& position : positions) ++expected[Cell::of(position, level).at];
    for (const auto& [at, count] : expected) EXPECT_EQ(counts->count({level, at}), count);
  }
  EXPECT_EQ(counts->count({6, {63, 0, 63}}) + counts->count({6, {0, 63, 0}}) > 20000, false);
}

TEST(CountingGrid, CoarsensWithinItsMemoryAndLosesNothing) {
  std::mt19937_64 random(2);
  const auto counts = makeCountingGrid(14, 16 << 20);
  for (int batch = 0; batch < 20; ++batch) {
    VoxelRuns runs(counts->level());
    for (int n = 0; n < 5000; ++n) runs.add(randomPosition(random, 48));
    counts->add(runs.level(), runs.runs());
  }
  counts->close();
  EXPECT_LT(counts->level(), 14u);
  EXPECT_GT(counts->level(), 2u);
  EXPECT_EQ(counts->count({0, {0, 0, 0}}), 100000u);
  uint64_t sum = 0;
  for (int octant = 0; octant < 8; ++octant) sum += counts->count(Cell{}.child(octant));
  EXPECT_EQ(sum, 100000u);
}

TEST(CountingGrid, TakesRunsThatWereGatheredBeforeItCoarsened) {
  std::mt19937_64 random(3);
  const auto counts = makeCountingGrid(14, 16 << 20);
  VoxelRuns early(14);
  const RootPosition position = randomPosition(random, 48);
  early.add(position);
  VoxelRuns many(14);
  for (int n = 0; n < 50000; ++n) many.add(randomPosition(random, 48));
  counts->add(14, many.runs());
  ASSERT_LT(counts->level(), 14u);
  const uint32_t level = counts->level();
  const auto only_early = makeCountingGrid(level, 16 << 20);
  only_early->add(14, early.runs());
  only_early->close();
  EXPECT_EQ(only_early->count(Cell::of(position, level)), 1u);
}

TEST(CountingGrid, ClustersStayFineWhereTheyFit) {
  const auto counts = makeCountingGrid(20, 32 << 20);
  VoxelRuns runs(20);
  std::mt19937_64 random(4);
  for (int n = 0; n < 100000; ++n) runs.add(randomPosition(random, 30));
  counts->add(20, runs.runs());
  counts->close();
  EXPECT_EQ(counts->level(), 20u);
  EXPECT_EQ(counts->count({18, {0, 0, 0}}), 100000u);
}

TEST(CountingLevel, IsThatOfVoxelsWithANodeEach) {
  const auto voxelsInBox = [](const glm::dvec3& extent, uint32_t level) {
    const double along = std::ldexp(1.0, static_cast<int>(level));
    return extent.x * along * extent.y * along * extent.z * along;
  };
  for (const glm::dvec3& extent : {glm::dvec3(1, 1, 1), glm::dvec3(1, 1, 0.01), glm::dvec3(0.03, 1, 0.02)}) {
    for (const uint64_t nodes : {1000u, 1000000u, 512000000u}) {
      const double voxels = voxelsInBox(extent, countingLevel(nodes, extent));
      EXPECT_GE(voxels, 8.0 * static_cast<double>(nodes));  // so that clusters show
      EXPECT_LE(voxels, 64.1 * static_cast<double>(nodes));
    }
  }
  // In any unit; and of grids without an extent along some axes.
  EXPECT_EQ(countingLevel(1000000, {3e-6, 3e-6, 3e-6}), countingLevel(1000000, {1, 1, 1}));
  EXPECT_GT(countingLevel(1000000, {1, 1, 0}), countingLevel(1000000, {1, 1, 1}));
  EXPECT_EQ(countingLevel(1000000, {0, 0, 0}), countingLevel(1000000, {1, 1, 1}));
  EXPECT_LE(countingLevel(uint64_t{1} << 47, {1, 0, 0}), static_cast<uint32_t>(kMaxLevel));
}

TEST(CountingGrid, IsDestroyedWhereMemoryHasEnded) {
  if (kIsSanitized) GTEST_SKIP() << "sanitizers need the address space themselves";
  const auto destroys = [] {
    std::mt19937_64 random(5);
    auto counts = makeCountingGrid(14, 16 << 20);
    VoxelRuns runs(14);
    for (int n = 0; n < 20000; ++n) runs.add(randomPosition(random, 48));
    counts->add(14, runs.runs());
    const test::MemoryLimit limit(0);
    for (size_t bytes = 1 << 20; bytes > 0; bytes /= 2)  // what the allocator holds, too
      while (std::malloc(bytes) != nullptr) {
      }
    counts.reset();
    std::_Exit(0);
  };
  EXPECT_EXIT(destroys(), testing::ExitedWithCode(0), "");
}

/// The library is loaded in other processes, as ctest runs this suite alone.
TEST(VdbLibrary, IsRefusedWhereItFindsNoMemory) {
  if (kIsSanitized) GTEST_SKIP() << "sanitizers need the address space themselves";
  for (uint64_t quarters = 4 * 64; quarters < 4 * 144; ++quarters) {
    const pid_t child = ::fork();
    if (child == 0) {
      const test::MemoryLimit limit(quarters << 18);
      try {
        std::async(std::launch::async, [] { makeCountingGrid(1, 16 << 20); }).get();
      } catch (const std::exception&) {
      }
      ::_exit(0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status)) << quarters / 4.0 << " MiB: signal " << WTERMSIG(status);
  }
}

TEST(CountingGrid, SaturatesInsteadOfOverflowing) {
  const auto counts = makeCountingGrid(3, 16 << 20);
  const VoxelRun run{{1, 2, 3}, UINT32_MAX};
  counts->add(3, std::vector<VoxelRun>(3, run));
  counts->close();
  EXPECT_EQ(counts->count({3, {1, 2, 3}}), 0x7fffffffu);
}

}  // namespace
}  // namespace curvisplat
