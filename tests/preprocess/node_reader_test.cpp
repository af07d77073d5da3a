#include "preprocess/grid/node_reader.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace curvisplat {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// One block whose nodes are given.
class GivenNodes : public GridSource {
 public:
  explicit GivenNodes(NodeArrays nodes) : nodes_(std::move(nodes)) {
    description_.blocks = {{"block 1", nodes_.x.size(), 1, 1}};
    for (size_t s = 0; s < nodes_.scalars.size(); ++s)
      description_.scalars.push_back({std::to_string(s), "", {}, 0});
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t, const NodeBox&, std::span<const uint32_t> scalars, NodeArrays& out) const override {
    out = nodes_;
    out.scalars.clear();
    for (const uint32_t s : scalars) out.scalars.push_back(nodes_.scalars[s]);
  }

 private:
  NodeArrays nodes_;
  GridDescription description_;
};

NodeArrays ordinaryNodes(size_t count, size_t scalars) {
  NodeArrays nodes;
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> any(-1e30, 1e30);
  for (auto* axis : {&nodes.x, &nodes.y, &nodes.z}) {
    axis->resize(count);
    for (double& value : *axis) value = any(random);
  }
  nodes.blank.assign(count, 0);
  nodes.scalars.assign(scalars, std::vector<float>(count));
  for (auto& scalar : nodes.scalars)
    for (float& value : scalar) value = static_cast<float>(any(random));
  return nodes;
}

const NodeBox kAll{0, 1, 0, 1};

TEST(NodeReader, LeavesOrdinaryNodesThere) {
  const GivenNodes source(ordinaryNodes(10'001, 2));
  NodeArrays out;
  const BlankCounts counts = NodeReader(source, {0, 1}, 7.0).read(0, kAll, out);
  EXPECT_EQ(counts.total(), 0u);
  EXPECT_EQ(std::count(out.blank.begin(), out.blank.end(), 0), 10'001);
}

/// Each reason at every place modulo the vector width and at the ends of the pieces; each node counts once.
TEST(NodeReader, BlanksEveryNodeThatIsNotThere) {
  constexpr size_t kCount = 9'003;  // no multiple of a vector
  NodeArrays nodes = ordinaryNodes(kCount, 2);
  std::mt19937_64 random(5);
  BlankCounts expected;
  std::vector<uint8_t> blank(kCount);
  for (const size_t n : {0ul, 1ul, 4095ul, 4096ul, 4097ul, 8191ul, 8192ul, 8999ul, 9000ul, 9001ul, 9002ul})
    blank[n] = 1;
  for (int n = 0; n < 60; ++n) blank[random() % kCount] = 1;
  for (size_t n = 0; n < kCount; ++n) {
    if (!blank[n]) continue;
    const uint64_t reasons = 1 + random() % 7;
    const bool grid = reasons & 1, value = reasons & 2, not_finite = reasons & 4;
    if (grid) nodes.blank[n] = 1;
    if (value) nodes.scalars[random() % 2][n] = -9999.0f;
    if (not_finite) {
      const double bad = random() % 3 == 0 ? kNan : random() % 2 ? kInfinity : -kInfinity;
      std::vector<double>* const axes[] = {&nodes.x, &nodes.y, &nodes.z};
      (*axes[random() % 3])[n] = bad;
    }
    expected.by_grid += grid;
    expected.by_value += !grid && value;
    expected.not_finite += !grid && !value && not_finite;
  }
  const GivenNodes source(nodes);
  NodeArrays out;
  const BlankCounts counts = NodeReader(source, {0, 1}, -9999.0).read(0, kAll, out);
  EXPECT_EQ(out.blank, blank);
  EXPECT_EQ(counts.by_grid, expected.by_grid);
  EXPECT_EQ(counts.by_value, expected.by_value);
  EXPECT_EQ(counts.not_finite, expected.not_finite);
}

/// A single bad node has no other one near it that makes the reader look closer.
TEST(NodeReader, FindsASingleBadNodeAnywhere) {
  for (const size_t count : {1, 3, 16, 37, 4101}) {
    const NodeArrays ordinary = ordinaryNodes(count, 1);
    for (size_t bad = count > 100 ? count - 40 : 0; bad < count; ++bad)
      for (int where = 0; where < 5; ++where) {
        NodeArrays nodes = ordinary;
        std::vector<double>* const axes[] = {&nodes.x, &nodes.y, &nodes.z};
        if (where < 3) (*axes[where])[bad] = kInfinity;
        if (where == 3) nodes.scalars[0][bad] = std::numeric_limits<float>::quiet_NaN();
        if (where == 4) nodes.scalars[0][bad] = 5.5f;
        const GivenNodes source(nodes);
        NodeArrays out;
        const BlankCounts counts = NodeReader(source, {0}, 5.5).read(0, kAll, out);
        ASSERT_EQ(counts.by_value, where == 4);
        ASSERT_EQ(counts.not_finite, where != 4);
        ASSERT_EQ(out.blank[bad], 1) << bad << " of " << count;
        ASSERT_EQ(std::count(out.blank.begin(), out.blank.end(), 1), 1);
      }
  }
}

TEST(NodeReader, LooksOnlyAtTheScalarsAskedFor) {
  NodeArrays nodes = ordinaryNodes(100, 2);
  nodes.scalars[1][7] = std::numeric_limits<float>::infinity();
  nodes.scalars[1][8] = 5.5f;
  const GivenNodes source(nodes);
  NodeArrays out;
  EXPECT_EQ(NodeReader(source, {0}, 5.5).read(0, kAll, out).total(), 0u);
  const BlankCounts counts = NodeReader(source, {1}, 5.5).read(0, kAll, out);
  EXPECT_EQ(counts.not_finite, 1u);
  EXPECT_EQ(counts.by_value, 1u);
  EXPECT_TRUE(out.blank[7] && out.blank[8]);
  EXPECT_EQ(NodeReader(source, {}, 5.5).read(0, kAll, out).total(), 0u);
}

/// A value to blank is compared as the scalars are stored: -999.9 is no float.
TEST(NodeReader, ComparesInSinglePrecision) {
  NodeArrays nodes = ordinaryNodes(10, 1);
  nodes.scalars[0][3] = -999.9f;
  const GivenNodes source(nodes);
  NodeArrays out;
  EXPECT_EQ(NodeReader(source, {0}, -999.9).read(0, kAll, out).by_value, 1u);
}

}  // namespace
}  // namespace curvisplat
