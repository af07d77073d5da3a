#include "preprocess/grid/thinned_source.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

namespace curvisplat {
namespace {

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

}  // namespace
}  // namespace curvisplat
