#include "render/project/depth_sort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace curvisplat {
namespace {

std::vector<uint32_t> expected(const std::vector<float>& depths) {
  std::vector<uint32_t> order(depths.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return depths[a] > depths[b]; });
  return order;
}

TEST(DepthSorter, PutsTheFarthestFirstAndKeepsTheOrderOfEquals) {
  DepthSorter sorter;
  std::mt19937 random(1);
  for (const size_t count : {0u, 1u, 2u, 100u, 5000u, 20000u, 131072u, 3u})
    for (const float span : {1e-30f, 1.0f, 1e30f})
      for (const bool ties : {false, true}) {
        std::uniform_real_distribution<float> unit(-1, 1);
        std::vector<float> depths(count);
        for (float& depth : depths) depth = span * (ties ? std::round(10 * unit(random)) : unit(random));
        const auto order = sorter.farthestFirst(depths);
        EXPECT_EQ(std::vector<uint32_t>(order.begin(), order.end()), expected(depths))
            << count << " depths in " << span << ", ties " << ties;
        const auto reverse = sorter.sort(depths, DrawingOrder::kFrontToBack);
        EXPECT_EQ(std::vector<uint32_t>(reverse.rbegin(), reverse.rend()), expected(depths));
      }
}

TEST(DepthSorter, TakesBothZerosAsEqual) {
  const std::vector<float> depths{0.0f, -0.0f, 0.0f, -1.0f, -0.0f};
  DepthSorter sorter;
  const auto order = sorter.farthestFirst(depths);
  EXPECT_EQ(std::vector<uint32_t>(order.begin(), order.end()), (std::vector<uint32_t>{0, 1, 2, 4, 3}));
}

}  // namespace
}  // namespace curvisplat
