// Parts of the processor's painter: bins of splats, the loop over tiles and its threads, and sums of optical
// depths in a tile, against the compositor of splats in double precision, on every instruction set.
#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "render/cpu/cpu_painter.h"
#include "render/cpu/half_depths.h"
#include "render/cpu/tile.h"
#include "render/tiles/splat_bins.h"
#include "tests/reference/splat_compositor.h"

namespace curvisplat {
namespace {

constexpr ImageSize kBinnedPicture{150, 101};
constexpr size_t kManyEntries = 1 << 20;

/// Nearest first, some with records before them.
std::vector<ScreenSplat> someSplats(int count) {
  std::vector<ScreenSplat> splats = cutSome(randomSplats(count, 5, kBinnedPicture), 6);
  std::reverse(splats.begin(), splats.end());
  return splats;
}

using Lists = std::vector<std::vector<std::array<uint32_t, 16>>>;  // [tile][splat], as bits

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
  SplatBins one(kBinnedPicture, splats.size(), kManyEntries, 1);
  const Lists expected = listsByAdding(one, splats);
  for (const unsigned pieces : {1u, 2u, 7u}) {
    SplatBins bins(kBinnedPicture, splats.size(), kManyEntries, pieces);
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
  SplatBins all(kBinnedPicture, splats.size(), kManyEntries, 1);
  const Lists expected = listsByAdding(all, splats);
  for (const auto& [most_splats, most_entries] :
       {std::pair<size_t, size_t>{100, kManyEntries}, {1, kManyEntries}, {5000, 150}}) {
    SplatBins bins(kBinnedPicture, most_splats, most_entries, 3);
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
  SplatBins bins(kBinnedPicture, splats.size(), kManyEntries, 2);
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
  std::vector<ScreenSplat> splats(
      50, {16, 16, 1, 0, 1, 1, 0.5f, 0, 0, 0, 0, 0, 0, 0, 0, 0});  // in the first tile
  splats.resize(80, {3 * kTileSide + 5, 16, 1, 0, 1, 1, 0.5f, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  SplatBins bins(kBinnedPicture, splats.size(), kManyEntries, 2);
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

TEST(PaintLoop, DoesEachJobOnce) {
  ComputePermits permits(2);
  for (const unsigned threads : {1u, 2u, 5u})
    for (ComputePermits* const bound : {static_cast<ComputePermits*>(nullptr), &permits})
      for (const size_t count : {0, 1, 2, 7, 1000})
        for (const size_t neighbours : {1, 3, 2000}) {
          PaintLoop loop(threads, bound);
          std::vector<std::atomic<int>> times(count);
          loop.forAll("test", count, neighbours, [&](size_t n) { ++times[n]; });
          for (const auto& of_job : times) EXPECT_EQ(of_job, 1);
        }
}

TEST(PaintLoop, DoesNotWaitForThreadsWithoutPermit) {
  ComputePermits permits(2);
  PaintLoop loop(2, &permits);
  std::atomic<bool> holds = false, ended = false;
  std::thread other([&] {
    const Computing computing(&permits);
    holds = true;
    while (!ended) std::this_thread::yield();  // not before the loop has ended
  });
  while (!holds) std::this_thread::yield();
  std::atomic<int> now = 0, most = 0, done = 0;
  {
    const Computing computing(&permits);
    loop.forAll("test", 1000, 1, [&](size_t) {
      most = std::max(most.load(), ++now);
      ++done;
      --now;
    });
  }
  ended = true;
  other.join();
  EXPECT_EQ(done, 1000);
  EXPECT_EQ(most, 1);
}

TEST(PaintLoop, RethrowsWhatAJobThrows) {
  ComputePermits permits(2);
  PaintLoop loop(2, &permits);
  const auto fail = [](size_t n) {
    if (n == 17) throw std::runtime_error("17");
  };
  EXPECT_THROW(loop.forAll("test", 100, 1, fail), std::runtime_error);
  std::atomic<size_t> done = 0;
  loop.forAll("test", 100, 1, [&](size_t) { ++done; });  // no permit was lost
  EXPECT_EQ(done, 100u);
}

constexpr ImageSize kTile{kTileSide, kTileSide};

class HalfDepths : public testing::TestWithParam<int64_t>, public HalfEvents {
 protected:
  void SetUp() override { hwy::SetSupportedTargetsForTest(GetParam()); }
  void TearDown() override { hwy::SetSupportedTargetsForTest(0); }

  void passLayers(size_t pixel, double distance) override {
    EXPECT_GT(distance, tile_.next_layer[pixel]);
    tile_.next_layer[pixel] = INFINITY;
    ++layers_;
  }
  void reach(size_t pixel, double part) override {
    EXPECT_LE(tile_.target[pixel], tile_.depth[pixel]);
    EXPECT_GT(part, 0);
    EXPECT_LE(part, 1);
    tile_.target[pixel] = HalfTile::kFound;
    ++reached_;
  }

  /// All of them, in any order.
  void add(const std::vector<ScreenSplat>& splats, const ClassificationTable& table) {
    const MeanExtinction extinction(table);
    for (const ScreenSplat& of : splats) {
      if (isRecord(of)) continue;
      const SplatRecords records = SplatRecords::beside(&of, 1, false);
      const auto cut = records.cut ? ScreenCut::of(*records.cut) : ScreenCut();
      const FootprintSkew skew = FootprintSkew::unpack(of.skew);
      HalfSplat splat{};
      splat.x = of.x;
      splat.y = of.y;
      splat.per_l11 = 1 / double{of.l11};
      splat.l21 = of.l21;
      splat.per_l22 = 1 / double{of.l22};
      splat.amplitude = std::abs(of.amplitude);
      splat.mean = of.mean;
      splat.slope0 = of.slope0;
      splat.slope1 = of.slope1;
      splat.half_width = of.half_width;
      splat.depth.middle = 2;
      splat.cut = records.cut ? &cut : nullptr;
      splat.skew = of.skew != 0 ? &skew : nullptr;
      addToHalf(splat, {0, 0, 0, 0, kTileSide - 1, kTileSide - 1}, extinction, tile_, *this);
    }
  }
  HalfTile tile_;
  size_t reached_ = 0, layers_ = 0;
};

INSTANTIATE_TEST_SUITE_P(, HalfDepths, testing::ValuesIn(CpuPainter::targets()),
                         [](const testing::TestParamInfo<int64_t>& tested) {
                           return std::string(hwy::TargetName(tested.param));
                         });

TEST_P(HalfDepths, AddUpToWhatThePictureHas) {
  for (const bool log_scale : {false, true})
    for (const auto& table : {lively(log_scale), smooth(log_scale)}) {
      const auto splats = randomSplats(40, 7, kTile, 0.3f, 0.1f);
      const Image specified = compositeSplats(splats, table, {true}, kTile, glm::vec4(0.0f));
      tile_ = {};
      tile_.target.fill(1e300);
      tile_.next_layer.fill(INFINITY);
      add(splats, table);
      double most = 0;
      for (size_t n = 0; n < HalfTile::kPixels; ++n) {
        const auto alpha = static_cast<double>(specified.rgba[4 * n + 3]);
        EXPECT_NEAR(-std::expm1(-tile_.depth[n]), alpha, 1e-3 * alpha + 1e-4) << n;
        most = std::max(most, alpha);
      }
      EXPECT_GT(most, 0.05);
      EXPECT_EQ(reached_ + layers_, 0u);
    }
}

TEST_P(HalfDepths, CutSplatsLeaveTheirShare) {
  const auto table = smooth(false);
  auto splats = cutSome(randomSplats(40, 9, kTile, 0.3f, 0.1f), 3);
  // Where the scalar does not vary along the ray a cut takes its share of the optical depth, and nothing else.
  for (ScreenSplat& splat : splats)
    if (!isRecord(splat)) splat.half_width = 0;
  const Image specified = compositeSplats(splats, table, {true}, kTile, glm::vec4(0.0f));
  tile_.target.fill(1e300);
  tile_.next_layer.fill(INFINITY);
  add(splats, table);
  for (size_t n = 0; n < HalfTile::kPixels; ++n) {
    const auto alpha = static_cast<double>(specified.rgba[4 * n + 3]);
    EXPECT_NEAR(-std::expm1(-tile_.depth[n]), alpha, 1e-3 * alpha + 1e-4) << n;
  }
}

TEST_P(HalfDepths, EveryPixelReachesItsTargetOnce) {
  const auto table = smooth(false);
  const auto splats = randomSplats(40, 7, kTile, 0.3f, 0.1f);
  tile_.target.fill(1e300);
  tile_.next_layer.fill(1);
  add(splats, table);
  size_t touched = 0;
  for (const double depth : tile_.depth) touched += depth > 0;
  EXPECT_GT(touched, HalfTile::kPixels / 2);
  EXPECT_EQ(layers_, touched);  // before all splats
  HalfTile again;
  again.next_layer.fill(INFINITY);
  for (size_t n = 0; n < HalfTile::kPixels; ++n)
    again.target[n] = tile_.depth[n] > 0 ? 0.5 * tile_.depth[n] : HalfTile::kFound;
  tile_ = again;
  add(splats, table);
  EXPECT_EQ(reached_, touched);
}

}  // namespace
}  // namespace curvisplat
