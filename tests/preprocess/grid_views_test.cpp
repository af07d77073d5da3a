// Sources that stand before another source: boxes of it as samples, every n-th plane of it, and closed
// grids, whose columns and rows are compared, for every box, with the same read node by node.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <vector>

#include "preprocess/formats/netcdf/closed_grid.h"
#include "preprocess/grid/grid_views.h"
#include "tests/support/grid_nodes.h"

namespace curvisplat {
namespace {

/// Blocks whose nodes have their own numbers as x, j as y and k as z; and a scalar in cells, 1 in all.
class NumberedBlocks : public GridSource {
 public:
  explicit NumberedBlocks(std::vector<std::array<uint64_t, 3>> sizes) {
    for (const auto& [ni, nj, nk] : sizes) {
      first_.push_back(nodes_);
      description_.blocks.push_back({"block", ni, nj, nk, false});
      nodes_ += ni * nj * nk;
    }
    description_.scalars.push_back({"cells", "", {}, 0, Centring::kCell, 0, false});
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    const GridBlock& of = description_.blocks[block];
    out = {};
    out.scalars.resize(scalars.size());
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = 0; i < of.ni; ++i) {
          out.x.push_back(static_cast<double>(first_[block] + i + of.ni * (j + of.nj * k)));
          out.y.push_back(static_cast<double>(j));
          out.z.push_back(static_cast<double>(k));
          out.blank.push_back(0);
          const bool is_cell = i + 1 < of.ni && j + 1 < of.nj && k + 1 < of.nk;
          for (auto& values : out.scalars) values.push_back(is_cell ? 1.0f : std::nanf(""));
        }
  }
  uint64_t nodes() const { return nodes_; }

 private:
  GridDescription description_;
  std::vector<uint64_t> first_;
  uint64_t nodes_ = 0;
};

struct Sample {
  std::set<double> numbers;
  uint64_t nodes = 0, cells = 0, expected_cells = 0;
};

Sample read(const GridSource& source) {
  Sample sample;
  const auto& blocks = source.description().blocks;
  for (uint32_t block = 0; block < blocks.size(); ++block) {
    NodeArrays arrays;
    const std::array<uint32_t, 1> scalars{0};
    source.read(block, {0, blocks[block].nj, 0, blocks[block].nk}, scalars, arrays);
    EXPECT_EQ(arrays.x.size(), blocks[block].nodes());
    sample.nodes += arrays.x.size();
    sample.numbers.insert(arrays.x.begin(), arrays.x.end());
    for (const float value : arrays.scalars[0]) sample.cells += value == 1;
    sample.expected_cells += (blocks[block].ni - 1) * (blocks[block].nj - 1) * (blocks[block].nk - 1);
  }
  return sample;
}

TEST(SampleSource, HasBoxesThatDoNotOverlap) {
  for (const std::vector<std::array<uint64_t, 3>>& sizes :
       {std::vector<std::array<uint64_t, 3>>{{100, 90, 80}},
        {{1000, 30, 2}},
        {{10, 5, 4000}},
        {{2, 3000, 40}}}) {
    const auto sample = sampleOf(std::make_unique<NumberedBlocks>(sizes), 20'000);
    const Sample found = read(*sample);
    EXPECT_EQ(found.numbers.size(), found.nodes);
    EXPECT_GT(found.nodes, 10'000u);
    EXPECT_LT(found.nodes, 40'000u);
    EXPECT_EQ(found.cells, found.expected_cells);  // none begins at a box's last row or plane
    expectPartsOfRows(*sample);
  }
}

TEST(SampleSource, TakesSmallBlocksWholeAndSmallGridsWithAllBlocks) {
  const std::vector<std::array<uint64_t, 3>> many(500, {5, 6, 7});
  const auto part = read(*sampleOf(std::make_unique<NumberedBlocks>(many), 20'000));
  EXPECT_EQ(part.numbers.size(), part.nodes);
  EXPECT_NEAR(static_cast<double>(part.nodes), 20'000, 210);
  EXPECT_EQ(part.nodes % 210, 0u);

  auto whole = std::make_unique<NumberedBlocks>(many);
  const uint64_t nodes = whole->nodes();
  EXPECT_EQ(read(*sampleOf(std::move(whole), nodes)).nodes, nodes);
}

/// A block whose nodes have their indices as coordinates; a scalar of nodes, i + 100 j + 10000 k, and the same of cells.
class IndexedBlocks : public GridSource {
 public:
  explicit IndexedBlocks(const std::vector<std::array<uint64_t, 3>>& sizes) {
    for (const auto& [ni, nj, nk] : sizes) description_.blocks.push_back({"block", ni, nj, nk, true});
    description_.scalars.push_back({"nodes", "", {}, 0, Centring::kNode, 0, false});
    description_.scalars.push_back({"cells", "", {}, 0, Centring::kCell, 0, false});
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    const GridBlock& of = description_.blocks[block];
    out = {};
    out.scalars.resize(scalars.size());
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = 0; i < of.ni; ++i) {
          out.x.push_back(static_cast<double>(i));
          out.y.push_back(static_cast<double>(j));
          out.z.push_back(static_cast<double>(k));
          out.blank.push_back(i % 3 == 0);
          for (size_t n = 0; n < scalars.size(); ++n)
            out.scalars[n].push_back(static_cast<float>(i + 100 * j + 10'000 * k));
        }
  }
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    out.clear();
    for (uint64_t n = 0; n < (box.j1 - box.j0) * (box.k1 - box.k0); ++n)
      for (uint64_t i = 0; i < description_.blocks[block].ni; ++i) out.push_back(i % 2);
    return true;
  }

 private:
  GridDescription description_;
};

TEST(ThinnedSource, KeepsEveryNthPlaneAndTheLastOnes) {
  const IndexedBlocks grid({{8, 5, 2}});
  const auto thin = thinned(grid, 3);
  const GridBlock& block = thin->description().blocks[0];
  EXPECT_EQ((std::array{block.ni, block.nj, block.nk}), (std::array<uint64_t, 3>{4, 3, 2}));
  NodeArrays nodes;
  const std::array<uint32_t, 2> scalars{0, 1};
  thin->read(0, {1, 3, 0, 2}, scalars, nodes);
  const std::vector<double> i{0, 3, 6, 7}, j{3, 4}, k{0, 1};
  ASSERT_EQ(nodes.x.size(), i.size() * j.size() * k.size());
  for (size_t n = 0; n < nodes.x.size(); ++n) {
    EXPECT_EQ(nodes.x[n], i[n % 4]);
    EXPECT_EQ(nodes.y[n], j[n / 4 % 2]);
    EXPECT_EQ(nodes.z[n], k[n / 8]);
    const double value = nodes.x[n] + 100 * nodes.y[n] + 10'000 * nodes.z[n];
    EXPECT_EQ(nodes.scalars[0][n], static_cast<float>(value));
    EXPECT_EQ(nodes.blank[n], static_cast<int>(nodes.x[n]) % 3 == 0);
    // No cell begins at the last planes.
    const bool is_cell = nodes.x[n] < 7 && nodes.y[n] < 4 && nodes.z[n] < 1;
    EXPECT_EQ(std::isnan(nodes.scalars[1][n]), !is_cell) << n;
    if (is_cell) {
      EXPECT_EQ(nodes.scalars[1][n], static_cast<float>(value));
    }
  }
  std::vector<uint8_t> fringe;
  ASSERT_TRUE(thin->readFringe(0, {0, 1, 0, 1}, fringe));
  EXPECT_EQ(fringe, (std::vector<uint8_t>{0, 1, 0, 1}));
}

TEST(ThinnedSource, TheStrideIsTheSmallestThatFits) {
  const IndexedBlocks grid({{101, 101, 101}, {2, 2, 2}});
  const auto nodes = [&](uint64_t stride) {
    uint64_t sum = 0;
    const auto thin = thinned(grid, stride);
    for (const GridBlock& block : thin->description().blocks) sum += block.nodes();
    return sum;
  };
  EXPECT_EQ(strideFor(grid.description(), 2'000'000), 1u);
  EXPECT_EQ(nodes(1), 101u * 101 * 101 + 8);
  EXPECT_EQ(nodes(2), 51u * 51 * 51 + 8);
  for (const uint64_t most : {300'000u, 50'000u, 1'000u, 100u}) {
    const uint64_t stride = strideFor(grid.description(), most);
    EXPECT_LE(nodes(stride), most);
    EXPECT_GT(nodes(stride - 1), most);
  }
  EXPECT_EQ(strideFor(grid.description(), 1), 101u);  // two planes in each direction stay
}

constexpr uint64_t kNumberedNi = 10, kNumberedNj = 5, kNumberedNk = 3;

double numberOf(uint64_t i, uint64_t j, uint64_t k) {
  return static_cast<double>(i + 100 * j + 10000 * k);
}

/// A grid whose coordinates and scalar are the indices.
class Numbered final : public GridSource {
 public:
  Numbered() {
    description_.blocks.push_back({"numbered", kNumberedNi, kNumberedNj, kNumberedNk, true});
    description_.scalars.push_back({"number", "", {}, 0, Centring::kNode});
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t, const NodeBox& box, std::span<const uint32_t> scalars, NodeArrays& out) const override {
    EXPECT_LT(box.j0, box.j1);
    EXPECT_LE(box.j1, kNumberedNj);
    std::vector<double> numbers;
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = box.i0; i < box.endOfRow(kNumberedNi); ++i) numbers.push_back(numberOf(i, j, k));
    out.x = out.y = out.z = numbers;
    out.blank.assign(numbers.size(), 0);
    out.scalars.assign(scalars.size(), std::vector<float>(numbers.begin(), numbers.end()));
  }
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    EXPECT_LT(box.i0, box.i1);
    EXPECT_LE(box.i1, kNumberedNi);
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
  ASSERT_EQ(block.nj, kNumberedNj + (closure.north == North::kAddRow) - (closure.north == North::kDropRow));
  const bool half = closure.north == North::kAddRow || closure.north == North::kHalfRow;
  EXPECT_EQ(grid.rowsInMemory({}), 0u);
  expectPartsOfRows(grid);
  const std::vector<uint32_t> scalars{0};
  for (uint64_t j0 = 0; j0 < block.nj; ++j0)
    for (uint64_t j1 = j0 + 1; j1 <= block.nj; ++j1)
      for (const auto& [k0, k1] : {std::pair<uint64_t, uint64_t>{0, kNumberedNk}, {1, 2}, {1, 3}}) {
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
              const bool mirrored = j == kNumberedNj;
              const uint64_t column = mirrored ? (closure.mirror + distinct - i % distinct) % distinct
                                      : closure.repeat_first ? i % distinct
                                                             : i;
              const double expected = numberOf(column, mirrored ? kNumberedNj - 1 : j, k);
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
      for (const uint64_t columns : {kNumberedNi, kNumberedNi - 1, kNumberedNi - 2})
        for (const uint64_t mirror : {kNumberedNi - 3, uint64_t{2}}) {
          SCOPED_TRACE(testing::Message() << "north " << static_cast<int>(north) << ", " << columns
                                          << " columns, " << repeat_first << ", mirror " << mirror);
          expectEveryBox({columns, repeat_first, north, mirror});
        }
}

}  // namespace
}  // namespace curvisplat
