// Columns and rows of a closed grid, for every box, against the same read node by node.
#include <gtest/gtest.h>

#include "preprocess/formats/netcdf/closed_grid.h"
#include "tests/support/parts_of_rows.h"

namespace curvisplat {
namespace {

constexpr uint64_t kNi = 10, kNj = 5, kNk = 3;

double numberOf(uint64_t i, uint64_t j, uint64_t k) {
  return static_cast<double>(i + 100 * j + 10000 * k);
}

/// Its coordinates and its scalar are the indices.
class Numbered final : public GridSource {
 public:
  Numbered() {
    description_.blocks.push_back({"numbered", kNi, kNj, kNk, true});
    description_.scalars.push_back({"number", "", {}, 0, Centring::kNode});
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t, const NodeBox& box, std::span<const uint32_t> scalars, NodeArrays& out) const override {
    EXPECT_LT(box.j0, box.j1);
    EXPECT_LE(box.j1, kNj);
    std::vector<double> numbers;
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = box.i0; i < box.endOfRow(kNi); ++i) numbers.push_back(numberOf(i, j, k));
    out.x = out.y = out.z = numbers;
    out.blank.assign(numbers.size(), 0);
    out.scalars.assign(scalars.size(), std::vector<float>(numbers.begin(), numbers.end()));
  }
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    EXPECT_LT(box.i0, box.i1);
    EXPECT_LE(box.i1, kNi);
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t>) const override { return 0; }

 private:
  GridDescription description_;
};

void expectEveryBox(const GridClosure& closure) {
  using North = GridClosure::North;
  const ClosedGrid grid(std::make_unique<Numbered>(), closure);
  const GridBlock& block = grid.description().blocks.at(0);
  const uint64_t distinct = closure.columns - (closure.repeat_first ? 0 : 1);
  ASSERT_EQ(block.ni, distinct + 1);
  ASSERT_EQ(block.nj, kNj + (closure.north == North::kAddRow) - (closure.north == North::kDropRow));
  const bool half = closure.north == North::kAddRow || closure.north == North::kHalfRow;
  EXPECT_EQ(grid.rowsInMemory({}), 0u);
  expectPartsOfRows(grid);
  const std::vector<uint32_t> scalars{0};
  for (uint64_t j0 = 0; j0 < block.nj; ++j0)
    for (uint64_t j1 = j0 + 1; j1 <= block.nj; ++j1)
      for (const auto& [k0, k1] : {std::pair<uint64_t, uint64_t>{0, kNk}, {1, 2}, {1, 3}}) {
        SCOPED_TRACE(testing::Message()
                     << "rows " << j0 << " to " << j1 << ", planes " << k0 << " to " << k1);
        NodeArrays nodes;
        grid.read(0, {j0, j1, k0, k1}, scalars, nodes);
        ASSERT_EQ(nodes.x.size(), block.ni * (j1 - j0) * (k1 - k0));
        ASSERT_EQ(nodes.blank.size(), nodes.x.size());
        size_t n = 0;
        for (uint64_t k = k0; k < k1; ++k)
          for (uint64_t j = j0; j < j1; ++j) {
            uint64_t hidden = 0;
            for (uint64_t i = 0; i < block.ni; ++i, ++n) {
              // The source's last column repeats its first only where `columns` says so; else a column is added.
              const bool mirrored = j == kNj;
              const uint64_t column = mirrored ? (closure.mirror + distinct - i % distinct) % distinct
                                      : closure.repeat_first ? i % distinct
                                                             : i;
              const double expected = numberOf(column, mirrored ? kNj - 1 : j, k);
              ASSERT_EQ(nodes.x[n], expected);
              ASSERT_EQ(nodes.z[n], expected);
              ASSERT_EQ(nodes.scalars[0][n], static_cast<float>(expected));
              hidden += nodes.blank[n];
            }
            if (half && j + 1 == block.nj) {
              ASSERT_GE(hidden, distinct - distinct / 2);
              ASSERT_LE(hidden, distinct - distinct / 2 + 1);
            } else {
              ASSERT_EQ(hidden, 0u);
            }
          }
      }
}

TEST(ClosedGrid, EveryBoxHasTheNodesOfTheWhole) {
  using North = GridClosure::North;
  for (const North north : {North::kOpen, North::kDropRow, North::kHalfRow, North::kAddRow})
    for (const bool repeat_first : {true, false})
      for (const uint64_t columns : {kNi, kNi - 1, kNi - 2})
        for (const uint64_t mirror : {kNi - 3, uint64_t{2}}) {
          SCOPED_TRACE(testing::Message() << "north " << static_cast<int>(north) << ", " << columns
                                          << " columns, " << repeat_first << ", mirror " << mirror);
          expectEveryBox({columns, repeat_first, north, mirror});
        }
}

}  // namespace
}  // namespace curvisplat
