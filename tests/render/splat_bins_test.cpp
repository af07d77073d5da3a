#include "render/cpu/splat_bins.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <utility>

#include "render/cpu/tile.h"
#include "tests/reference/painted_splats.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{150, 101};
constexpr size_t kManyEntries = 1 << 20;

/// Nearest first, some with records before them.
std::vector<ScreenSplat> someSplats(int count) {
  std::vector<ScreenSplat> splats = cutSome(randomSplats(count, 5, kSize), 6);
  std::reverse(splats.begin(), splats.end());
  return splats;
}

using Lists = std::vector<std::vector<std::array<uint32_t, 11>>>;  // [tile][splat], as bits

void appendLists(const SplatBins& bins, Lists& lists) {
  lists.resize(static_cast<size_t>(bins.columns() * bins.rows()));
  for (size_t tile = 0; tile < lists.size(); ++tile)
    for (const uint32_t n : bins.tile(static_cast<int>(tile))) {
      static_assert(sizeof(ScreenSplat) == sizeof(lists[tile].back()));
      std::memcpy(lists[tile].emplace_back().data(), &bins.splats()[n], sizeof(ScreenSplat));
    }
}

Lists listsByAdding(SplatBins& bins, std::span<const ScreenSplat> splats) {
  PaintLoop loop(2, nullptr);
  EXPECT_EQ(bins.add(splats), splats.size());
  bins.sort(loop);
  Lists lists;
  appendLists(bins, lists);
  bins.clear();
  return lists;
}

TEST(SplatBins, ListsBorrowedSplatsAsThoseThatWereAdded) {
  PaintLoop loop(3, nullptr);
  const auto splats = someSplats(3000);
  SplatBins one(kSize, splats.size(), kManyEntries, 1);
  const Lists expected = listsByAdding(one, splats);
  for (const unsigned pieces : {1u, 2u, 7u}) {
    SplatBins bins(kSize, splats.size(), kManyEntries, pieces);
    EXPECT_EQ(bins.sortBorrowed(splats, loop), splats.size());
    EXPECT_EQ(bins.splats().data(), splats.data()) << "a copy";
    Lists lists;
    appendLists(bins, lists);
    EXPECT_TRUE(lists == expected) << pieces;
    EXPECT_EQ(bins.hidden(), one.hidden()) << pieces;  // outside of the image
    bins.clear();
    EXPECT_TRUE(bins.empty());
    EXPECT_TRUE(listsByAdding(bins, splats) == expected) << "after a borrowed batch";
  }
}

TEST(SplatBins, BorrowsNoMoreThanThereIsSpaceFor) {
  PaintLoop loop(3, nullptr);
  const auto splats = someSplats(3000);
  SplatBins all(kSize, splats.size(), kManyEntries, 1);
  const Lists expected = listsByAdding(all, splats);
  for (const auto& [most_splats, most_entries] :
       {std::pair<size_t, size_t>{100, kManyEntries}, {1, kManyEntries}, {5000, 150}}) {
    SplatBins bins(kSize, most_splats, most_entries, 3);
    Lists lists;
    int batches = 0;
    for (std::span<const ScreenSplat> left = splats; !left.empty(); ++batches) {
      const size_t taken = bins.sortBorrowed(left, loop);
      ASSERT_GT(taken, 0u);
      EXPECT_LE(taken, most_splats + 3);
      EXPECT_FALSE(isRecord(left[taken - 1])) << "records without their splat";
      size_t entries = 0;
      for (int tile = 0; tile < bins.columns() * bins.rows(); ++tile) entries += bins.tile(tile).size();
      EXPECT_LE(entries, most_entries);
      appendLists(bins, lists);
      bins.clear();
      left = left.subspan(taken);
    }
    EXPECT_GT(batches, 10);
    EXPECT_TRUE(lists == expected);
  }
}

TEST(SplatBins, LeavesRecordsAtTheEndToBeAddedWithTheirSplat) {
  PaintLoop loop(3, nullptr);
  const auto splats = someSplats(300);
  const auto last = std::find_if(splats.rbegin(), splats.rend(), isRecord);
  ASSERT_NE(last, splats.rend());
  const auto end = static_cast<size_t>(splats.rend() - last);  // behind that record
  SplatBins bins(kSize, splats.size(), kManyEntries, 2);
  const size_t taken = bins.sortBorrowed(std::span(splats).first(end), loop);
  EXPECT_LT(taken, end);
  bins.clear();
  EXPECT_EQ(bins.add(std::span(splats).first(end).subspan(taken)), end - taken);
  EXPECT_TRUE(bins.empty());
  EXPECT_TRUE(bins.awaitsSplat());
  bins.add(std::span(splats).subspan(end));
  EXPECT_FALSE(bins.awaitsSplat());
  EXPECT_EQ(bins.splats().size(), splats.size() - taken);
}

TEST(SplatBins, CountsSplatsOfClosedTilesAsHidden) {
  PaintLoop loop(3, nullptr);
  std::vector<ScreenSplat> splats(50, {16, 16, 1, 0, 1, 1, 0.5f, 0, 0, 0, 0});  // in the first tile
  splats.resize(80, {3 * kTileSide + 5, 16, 1, 0, 1, 1, 0.5f, 0, 0, 0, 0});
  SplatBins bins(kSize, splats.size(), kManyEntries, 2);
  bins.close(0);
  EXPECT_EQ(bins.sortBorrowed(splats, loop), splats.size());
  EXPECT_EQ(bins.hidden(), 50u);
  EXPECT_TRUE(bins.tile(0).empty());
  EXPECT_EQ(bins.tile(3).size(), 30u);
  bins.clear();
  bins.open();
  EXPECT_EQ(bins.hidden(), 0u);
  EXPECT_EQ(bins.sortBorrowed(splats, loop), splats.size());
  EXPECT_EQ(bins.tile(0).size(), 50u);
}

}  // namespace
}  // namespace curvisplat
