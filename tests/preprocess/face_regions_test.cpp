// Regions of faces are found as a search through all of them finds them, and by row without one.
#include "preprocess/faces/face_regions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace curvisplat {
namespace {

FaceRegion region(uint32_t face, std::array<uint64_t, 2> first, std::array<uint64_t, 2> last) {
  return {face, first, last, "", ""};
}

TEST(FaceRegions, AreThoseOfAFaceInTheirOrder) {
  std::mt19937 random(1);
  std::vector<FaceRegion> all;
  for (int n = 0; n < 500; ++n)
    all.push_back({static_cast<uint32_t>(random() % 40), {}, {1, 1}, std::to_string(n), ""});
  const FaceRegions regions(all);
  for (uint32_t face = 0; face < 41; ++face) {
    std::vector<std::string> expected, found;
    for (const FaceRegion& other : all)
      if (other.face == face) expected.push_back(other.name);
    for (const FaceRegion& other : regions.of(face)) found.push_back(other.name);
    EXPECT_EQ(found, expected) << face;
  }
  EXPECT_TRUE(regions.of(UINT32_MAX).empty());
}

TEST(RegionRows, HoldTheQuadsOfAllRegions) {
  std::mt19937 random(2);
  constexpr uint64_t kColumns = 23, kRows = 17;
  for (int round = 0; round < 50; ++round) {
    std::vector<FaceRegion> regions;
    for (int n = 0; n < round % 7; ++n) {
      const uint64_t u = random() % kColumns, v = random() % kRows;
      regions.push_back(
          region(0, {u, v}, {u + 1 + random() % (kColumns - u), v + 1 + random() % (kRows - v)}));
    }
    const uint64_t begin = random() % kColumns, end = begin + 1 + random() % (kColumns - begin);
    RegionRows rows(regions, {begin, end});
    for (uint64_t v = 0; v < kRows; v += 1 + random() % 2) {
      const std::span<const uint8_t> row = rows.row(v);
      ASSERT_EQ(row.size(), end - begin);
      for (uint64_t u = begin; u < end; ++u) {
        const bool expected = std::any_of(regions.begin(), regions.end(), [&](const FaceRegion& r) {
          return u >= r.first[0] && u < r.last[0] && v >= r.first[1] && v < r.last[1];
        });
        ASSERT_EQ(row[u - begin] != 0, expected) << round << ": " << u << ", " << v;
      }
    }
  }
}

// A search of all regions for every quad would take 2 * 10^11 comparisons.
TEST(RegionRows, TakeHundredsOfThousandsOfRegions) {
  constexpr uint64_t kSide = 1000;
  std::vector<FaceRegion> regions;
  for (uint64_t v = 0; v < kSide; ++v)
    for (uint64_t u = v % 2; u < kSide; u += 2) regions.push_back(region(0, {u, v}, {u + 1, v + 1}));
  RegionRows rows(regions, {0, kSide});
  for (uint64_t v = 0; v < kSide; ++v) {
    const std::span<const uint8_t> row = rows.row(v);
    for (uint64_t u = 0; u < kSide; ++u) ASSERT_EQ(row[u] != 0, (u + v) % 2 == 0) << u << ", " << v;
  }
}

}  // namespace
}  // namespace curvisplat
