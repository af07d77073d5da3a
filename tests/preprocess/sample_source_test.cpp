#include "preprocess/grid/sample_source.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "tests/support/parts_of_rows.h"

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

}  // namespace
}  // namespace curvisplat
