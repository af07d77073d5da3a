#include "preprocess/survey/grid_statistics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "preprocess/formats/open/open_grid.h"
#include "tests/reference/cell_grid.h"
#include "tests/reference/function_grid.h"

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

}  // namespace
}  // namespace curvisplat
