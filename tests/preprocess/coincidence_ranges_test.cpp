#include "preprocess/splats/coincidence_ranges.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <random>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr size_t kSize = 7;  // of a record: its three numbers, the position, the spacing

class CoincidenceRanges : public testing::Test {
 protected:
  /// Ranges of these nodes, which are expected to be all, and to part none that coincide.
  std::vector<SweepRange> rangesOf(const std::vector<SweptNode>& nodes) const {
    RecordSorter sorter(kSize, 1 << 20, folder_.path());
    LargestReach reach;
    for (size_t n = 0; n < nodes.size(); ++n) {
      const auto& [sweep, position, spacing] = nodes[n];
      const std::array<double, kSize> record{sweep.along, sweep.across, std::bit_cast<double>(uint64_t{n}),
                                             position.x,  position.y,   position.z,
                                             spacing};
      sorter.add(record);
      reach.add(position, spacing);
    }
    sorter.sort();
    const auto swept_of = [&](const double* record) { return nodes[RecordSorter::numberOf(record)]; };
    const std::vector<SweepRange> ranges = coincidenceRanges(sorter, 8, swept_of, reach, 8);
    EXPECT_EQ(ranges.front().from, -std::numeric_limits<double>::infinity());
    EXPECT_EQ(ranges.back().to, std::numeric_limits<double>::infinity());
    for (size_t n = 1; n < ranges.size(); ++n) EXPECT_EQ(ranges[n].from, ranges[n - 1].to);
    const auto range_of = [&](const SweptNode& node) {
      return std::ranges::find_if(ranges,
                                  [&](const SweepRange& range) { return node.sweep.along < range.to; }) -
             ranges.begin();
    };
    for (const SweptNode& a : nodes)
      for (const SweptNode& b : nodes)
        if (glm::distance(a.position, b.position) <= 1e-3 * std::min(a.spacing, b.spacing)) {
          EXPECT_EQ(range_of(a), range_of(b));
        }
    return ranges;
  }

  static SweptNode nodeAt(const glm::dvec3& position, double spacing) {
    return {seamPosition(position), position, spacing};
  }

  const TemporaryFolder folder_;
};

/// Points each with `copies` nodes, which are `off` apart at the most along each axis.
std::vector<glm::dvec3> points(size_t count, size_t copies, double off) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  const auto place = [&] { return glm::dvec3(unit(random), unit(random), unit(random)); };
  std::vector<glm::dvec3> points;
  for (size_t n = 0; n < count; ++n) {
    const glm::dvec3 point = place();
    for (size_t copy = 0; copy < copies; ++copy) points.push_back(point + off * place());
  }
  return points;
}

TEST_F(CoincidenceRanges, PartNoNodesThatCoincide) {
  std::vector<SweptNode> nodes;
  for (const glm::dvec3& point : points(500, 4, 1e-5)) nodes.push_back(nodeAt(point, 0.1));
  EXPECT_GE(rangesOf(nodes).size(), 6u);
}

TEST_F(CoincidenceRanges, GoBetweenNodesThatReachPastOneAnother) {
  // Along the sweep a node reaches past some ten others, but none is near it.
  std::vector<SweptNode> nodes;
  for (const glm::dvec3& point : points(1000, 2, 0)) nodes.push_back(nodeAt(point, 10));
  EXPECT_GE(rangesOf(nodes).size(), 6u);
}

TEST_F(CoincidenceRanges, AreOneWhereEachNodeReachesTheNext) {
  std::vector<SweptNode> nodes;
  for (int n = 0; n < 2000; ++n) nodes.push_back(nodeAt(glm::dvec3(1e-4 * n), 0.2));
  EXPECT_EQ(rangesOf(nodes).size(), 1u);
}

TEST_F(CoincidenceRanges, OfFewNodesAreOne) {
  EXPECT_EQ(rangesOf({}).size(), 1u);
  EXPECT_EQ(rangesOf({nodeAt(glm::dvec3(1), 1)}).size(), 1u);
}

}  // namespace
}  // namespace curvisplat
