#include "render/project/depth_sort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace curvisplat {
namespace {

std::vector<uint32_t> placesOf(std::span<const DepthItem> items) {
  std::vector<uint32_t> places;
  for (const DepthItem& item : items) places.push_back(item.splat);
  return places;
}

TEST(DepthSorter, SortsByKeyAndKeepsTheOrderOfEquals) {
  DepthSorter sorter;
  std::mt19937 random(1);
  for (const size_t count : {0u, 1u, 2u, 100u, 5000u, 20000u, 131072u, 3u})
    for (const uint32_t span : {0u, 1u, 10u, 2047u, 2048u, 1u << 22, ~0u})
      for (const uint32_t least : {0u, 77u, ~0u - span}) {
        std::vector<uint32_t> keys(count);
        for (uint32_t& key : keys)
          key = static_cast<uint32_t>(std::min<uint64_t>(
              uint64_t{least} + (span == ~0u ? random() : random() % (span + 1)), ~uint32_t{0}));
        std::vector<uint32_t> expected(count);
        std::iota(expected.begin(), expected.end(), 0u);
        std::stable_sort(expected.begin(), expected.end(),
                         [&](uint32_t a, uint32_t b) { return keys[a] < keys[b]; });
        const auto sorted = sorter.sort(keys, DrawingOrder::kFrontToBack);
        EXPECT_EQ(placesOf(sorted), expected) << count << " keys in " << span;
        EXPECT_TRUE(std::all_of(sorted.begin(), sorted.end(),
                                [&](const DepthItem& item) { return item.key == keys[item.splat]; }));
      }
}

TEST(DepthSorter, BackToFrontIsFrontToBackFromItsEnd) {
  DepthSorter sorter;
  std::mt19937 random(2);
  std::vector<uint32_t> keys(3000), complements;
  for (uint32_t& key : keys) key = static_cast<uint32_t>(random() % 100);
  for (const uint32_t key : keys) complements.push_back(~key);
  std::vector<uint32_t> forwards = placesOf(sorter.sort(keys, DrawingOrder::kFrontToBack));
  std::reverse(forwards.begin(), forwards.end());
  EXPECT_EQ(placesOf(sorter.sort(complements, DrawingOrder::kBackToFront)), forwards);
}

}  // namespace
}  // namespace curvisplat
