#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <random>
#include <tuple>

#include "render/project/footprint.h"
#include "render/tiles/splat_bins.h"
#include "render/tiles/tile_queues.h"

namespace curvisplat {
namespace {

constexpr ImageSize kTiledPicture{100, 70};

constexpr float kReach = ScreenCut::kReach;

/// Makes between one and three faces, of which the first takes about half of the splat away.
ScreenCut randomCut(std::mt19937& random) {
  std::uniform_real_distribution<float> around(-1, 1);
  ScreenCut cut;
  for (size_t face = 0, faces = 1 + random() % 3; face < faces; ++face)
    cut.faces[face] = {face == 0 ? around(random) : 3 + around(random), 4 * around(random),
                       4 * around(random)};
  cut.far_sides = random() % 8;
  return cut;
}

/// Splats in the order of their first keys; `mean` is the number. Some are cut: their records before them have the number
/// as their key. Some of these have a scalar of their own for their colours.
std::vector<ScreenSplat> leaningSplats(int count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  std::vector<ScreenSplat> splats;
  for (int n = 0; n < count; ++n) {
    ScreenSplat splat{};
    splat.x = 100 * unit(random);
    splat.y = 70 * unit(random);
    splat.l11 = 1 + 6 * unit(random) * unit(random);
    splat.l21 = around(random);
    splat.l22 = 0.5f + 3 * unit(random);
    splat.amplitude = 1;
    splat.key = 20000 + static_cast<uint32_t>(random() % 3000);
    if (n % 3 != 0) {
      splat.key_slope0 = 300 * around(random);
      splat.key_slope1 = 300 * around(random);
    }
    setFirst(splat);
    splats.push_back(splat);
  }
  std::stable_sort(splats.begin(), splats.end(),
                   [](const ScreenSplat& a, const ScreenSplat& b) { return a.first < b.first; });
  std::vector<ScreenSplat> with_records;
  for (size_t n = 0; n < splats.size(); ++n) {
    splats[n].mean = static_cast<float>(n);
    if (n % 5 == 0) {
      splats[n].amplitude = -1;
      ScreenSplat record = randomCut(random).record();
      record.key = static_cast<uint32_t>(n);
      with_records.push_back(record);
      if (n % 2 == 0) with_records.push_back(ScreenColour{}.record());
    }
    with_records.push_back(splats[n]);
  }
  return with_records;
}

/// [tile's number << 8 | order tile] the numbers of the splats that may touch it, in the order of the tile.
using Orders = std::map<size_t, std::vector<int>>;

void note(Orders& orders, size_t place, const ScreenSplat* splat) {
  const int number = static_cast<int>(splat->mean);
  if (number % 5 == 0) {
    const ScreenSplat& cut = splat[number % 2 == 0 ? -2 : -1];
    ASSERT_TRUE(isRecord(splat[-1]));
    ASSERT_EQ(cut.key, static_cast<uint32_t>(number));
  }
  orders[place].push_back(number);
}

bool divide(TileQueues& queues, size_t queue) {
  if (!queues.divide(queue)) return false;
  queues.moveToParts(queue, queues.size() - TileQueues::kParts);
  return true;
}

void divideNone(TileQueues&, size_t) {}

/// `divide_some` is called before each batch, with its number.
Orders ordersOf(TileQueues& queues, std::span<const ScreenSplat> splats, const std::vector<size_t>& batches,
                const std::function<void(TileQueues&, size_t)>& divide_some = divideNone) {
  SplatBins bins(kTiledPicture, 4096, 4 * 4096, 2);
  PaintLoop loop(2, nullptr);
  queues.clear();
  Orders orders;
  Mutex mutex;
  size_t batch = 0;
  const auto paint = [&](bool last) {
    divide_some(queues, batch++);
    bins.sort(loop);
    const uint32_t front = bins.empty() ? 0 : bins.splats().back().first;
    loop.forAll("queues", queues.size(), 1, [&](size_t queue) {
      const size_t number = queues.tileOf(queue);
      const auto entries = bins.tile(static_cast<int>(number));
      if (queues.workOf(queue, entries.size(), last) == 0) return;
      queues.paint(queue, {bins.splats(), entries, front, last}, TileQueues::kAllOpen,
                   [&](const OrderedTile& tile) {
                     const MutexLock lock(mutex);
                     for (size_t of_tile = 0; of_tile < kOrderTiles; ++of_tile) {
                       const size_t place = number << 8 | of_tile;
                       if ((queues.orderTilesIn(queue) >> of_tile & 1) == 0)
                         EXPECT_TRUE(!tile.lists || (*tile.lists)[of_tile].empty());
                       else if (!tile.lists)
                         for (const uint32_t n : tile.order) note(orders, place, &tile.splats[n]);
                       else
                         for (const uint64_t item : (*tile.lists)[of_tile])
                           note(orders, place, &tile.splats[tile.order[numberOf(item)]]);
                     }
                     return TileQueues::kAllOpen;
                   });
    });
    bins.clear();
  };
  size_t begin = 0;
  for (const size_t count : batches) {
    begin += bins.add(splats.subspan(begin, std::min(count, splats.size() - begin)));
    if (!bins.awaitsSplat()) paint(false);
  }
  while (begin < splats.size()) begin += bins.add(splats.subspan(begin));
  paint(true);
  return orders;
}

/// Whether the faces leave an interval of the ray's depths at u.
bool isLeftAt(const ScreenCut& cut, double u0, double u1) {
  double lo = -kReach, hi = kReach;
  for (size_t n = 0; n < ScreenCut::kFaces; ++n) {
    const double a = cut.faces[n][0] + cut.faces[n][1] * u0 + cut.faces[n][2] * u1;
    if (cut.far_sides >> n & 1)
      lo = std::max(lo, -a);
    else
      hi = std::min(hi, a);
  }
  return lo < hi;
}

/// Calls visit(u0, u1) for the centre of each pixel of the order tile with this first pixel.
template <typename Visit>
void forPixels(const ScreenSplat& splat, float x, float y, const Visit& visit) {
  for (int pixel = 0; pixel < kOrderSide * kOrderSide; ++pixel) {
    const double dx = double{x} + pixel % kOrderSide + 0.5 - double{splat.x};
    const double dy = double{y} + pixel / kOrderSide + 0.5 - double{splat.y};
    const double u0 = dx / double{splat.l11};
    visit(u0, (dy - double{splat.l21} * u0) / double{splat.l22});
  }
}

/// Whether a pixel of the order tile with this first pixel has its centre in what is left of the splat's ellipse.
bool touches(const ScreenSplat& splat, float x, float y) {
  const ScreenSplat* const record =
      SplatRecords::beside(&splat, -1, hasCut(splat) && isColour(*(&splat - 1))).cut;
  const ScreenCut cut = record ? ScreenCut::of(*record) : ScreenCut{};
  bool touched = false;
  forPixels(splat, x, y, [&](double u0, double u1) {
    touched |= u0 * u0 + u1 * u1 < double{kKernelSupport} * double{kKernelSupport} && isLeftAt(cut, u0, u1);
  });
  return touched;
}

/// The orders that a tile's list must have.
Orders specifiedFor(std::span<const ScreenSplat> splats) {
  Orders orders;
  const int columns = TileSet::tilesAlong(kTiledPicture.width);
  for (size_t number = 0; number < TileSet::tilesOf(kTiledPicture); ++number)
    for (size_t of_tile = 0; of_tile < kOrderTiles; ++of_tile) {
      const float x = static_cast<float>(static_cast<int>(number) % columns * kTileSide +
                                         static_cast<int>(of_tile) % kOrderTilesAlong * kOrderSide);
      const float y = static_cast<float>(static_cast<int>(number) / columns * kTileSide +
                                         static_cast<int>(of_tile) / kOrderTilesAlong * kOrderSide);
      std::vector<std::tuple<uint32_t, int>> sorted;
      for (const ScreenSplat& splat : splats)
        if (!isRecord(splat) && touches(splat, x, y))
          sorted.emplace_back(keyAt(splat, x + 0.5f * kOrderSide, y + 0.5f * kOrderSide),
                              static_cast<int>(splat.mean));
      std::sort(sorted.begin(), sorted.end());
      for (const auto& [key, splat] : sorted) orders[number << 8 | of_tile].push_back(splat);
    }
  return orders;
}

/// A tile that has splats of one order gives them to all of its order tiles: leaves out what does not touch.
void expectOrders(const Orders& found, const Orders& specified) {
  for (const auto& [place, wanted] : specified) {
    ASSERT_TRUE(found.contains(place)) << place;
    std::vector<int> touching;
    for (const int n : found.at(place))
      if (std::find(wanted.begin(), wanted.end(), n) != wanted.end()) touching.push_back(n);
    EXPECT_EQ(touching, wanted) << place;
  }
}

TEST(TileQueues, GiveEachTileItsOwnOrderHoweverSplatsAreBatched) {
  const auto splats = leaningSplats(1500, 3);
  const Orders specified = specifiedFor(splats);
  TileQueues queues(kTiledPicture, 1 << 16, 2);
  expectOrders(ordersOf(queues, splats, {}), specified);
  expectOrders(ordersOf(queues, splats, std::vector<size_t>(50, 40)), specified);
  expectOrders(ordersOf(queues, splats, {1, 2, 3, 500, 7, 300, 300}), specified);
  EXPECT_FALSE(queues.isFull());
  EXPECT_FALSE(queues.anyWaits());
}

TEST(TileQueues, KeepEachOrderTilesOrderWhenTilesAreDivided) {
  constexpr size_t kSplats = size_t{1} << 18;
  auto splats = leaningSplats(1500, 3);
  for (const bool lean : {true, false}) {
    const Orders specified = specifiedFor(splats);
    for (const auto& batches : {std::vector<size_t>(50, 40), std::vector<size_t>{700, 700}, {}}) {
      TileQueues queues(kTiledPicture, kSplats, 2);
      // At first all tiles; then every third of the parts, and those again.
      const auto divide_some = [&](TileQueues& of, size_t batch) {
        for (size_t queue = 0, count = of.size(); queue < count; ++queue)
          if (batch == 0 || (queue >= TileSet::tilesOf(kTiledPicture) && (queue + batch) % 3 == 0))
            divide(of, queue);
      };
      expectOrders(ordersOf(queues, splats, batches, divide_some), specified);
      EXPECT_FALSE(queues.isFull());
      EXPECT_FALSE(queues.anyWaits());
      EXPECT_GE(queues.size(), TileSet::tilesOf(kTiledPicture) * (1 + TileQueues::kParts));
      expectOrders(ordersOf(queues, splats, batches), specified);
      EXPECT_EQ(queues.size(), TileSet::tilesOf(kTiledPicture)) << "after clear()";
    }
    for (ScreenSplat& splat : splats)
      if (lean && !isRecord(splat)) splat.key_slope0 = splat.key_slope1 = 0, splat.key = splat.first;
  }
}

TEST(TileQueues, DivideTilesDownToTheSmallestParts) {
  TileQueues queues(kTiledPicture, size_t{1} << 18, 2);
  size_t queue = 3;
  OrderTileMask tiles = TileQueues::kAllOpen;
  for (int side = kOrderTilesAlong; side > TileQueues::kMinPart; side /= 2) {
    ASSERT_TRUE(divide(queues, queue));
    EXPECT_EQ(queues.orderTilesIn(queue), 0u);
    EXPECT_EQ(queues.workOf(queue, 100, true), 0u);
    OrderTileMask of_parts = 0;
    for (size_t part = queues.size() - TileQueues::kParts; part < queues.size(); ++part) {
      EXPECT_EQ(queues.tileOf(part), 3u);
      EXPECT_EQ(of_parts & queues.orderTilesIn(part), 0u);
      of_parts |= queues.orderTilesIn(part);
    }
    EXPECT_EQ(of_parts, tiles);
    queue = queues.size() - 2;
    tiles = queues.orderTilesIn(queue);
  }
  EXPECT_FALSE(divide(queues, queue));
}

TEST(TileQueues, DivideNoTileWhereMemoryIsShort) {
  TileQueues few(kTiledPicture, 10000, 2), of_one_thread(kTiledPicture, size_t{1} << 18, 1);
  EXPECT_FALSE(divide(few, 0));
  EXPECT_FALSE(divide(of_one_thread, 0));
}

TEST(TileQueues, DivideNoTileOnceMemoryWasShort) {
  auto splats = leaningSplats(1500, 4);
  std::vector<uint32_t> entries;
  for (uint32_t n = 0; n < splats.size(); ++n) {
    if (isRecord(splats[n])) continue;
    splats[n].x *= 0.3f;  // into the first tile
    splats[n].y *= 0.4f;
    entries.push_back(n);
  }
  TileQueues queues(kTiledPicture, size_t{1} << 18, 2);
  EXPECT_TRUE(divide(queues, 3));
  queues.clear();
  // All lies behind a front of 0, and waits.
  for (int times = 0; times < 1000 && !queues.isFull(); ++times)
    queues.paint(0, {splats, entries, 0}, TileQueues::kAllOpen,
                 [](const OrderedTile&) { return TileQueues::kAllOpen; });
  ASSERT_TRUE(queues.isFull());
  queues.clear();
  EXPECT_FALSE(queues.isFull());
  EXPECT_FALSE(divide(queues, 3));
}

TEST(TileLists, LeaveOutOrderTilesOfWhichAFaceTakesAllPixels) {
  std::mt19937 random(11);
  const TileCorner corner{32, 64};
  size_t left_tiles = 0, taken_tiles = 0;
  for (ScreenSplat splat : leaningSplats(400, 5)) {
    if (isRecord(splat)) continue;
    splat.x = corner.x + static_cast<float>(random() % 32);
    splat.y = corner.y + static_cast<float>(random() % 32);
    const ScreenCut cut = randomCut(random);
    const OrderTileMask touched = orderTilesOf(corner, splat),
                        found = tilesLeftOf(corner, splat, cut, touched);
    EXPECT_EQ(found & ~touched, 0u);
    for (int tile = 0; tile < static_cast<int>(kOrderTiles); ++tile) {
      if ((touched >> tile & 1) == 0) continue;
      double nearest = INFINITY;  // of the pixels, squared, in the ellipse's measure
      forPixels(splat, corner.x + static_cast<float>(tile % kOrderTilesAlong * kOrderSide),
                corner.y + static_cast<float>(tile / kOrderTilesAlong * kOrderSide),
                [&](double u0, double u1) { nearest = std::min(nearest, u0 * u0 + u1 * u1); });
      EXPECT_LT(std::sqrt(nearest), kKernelSupport + 0.03 / std::min(splat.l11, splat.l22));
      bool left = false;
      std::array<bool, ScreenCut::kFaces> takes_all;
      takes_all.fill(true);
      forPixels(
          splat, corner.x + static_cast<float>(tile % kOrderTilesAlong * kOrderSide),
          corner.y + static_cast<float>(tile / kOrderTilesAlong * kOrderSide), [&](double u0, double u1) {
            left |= isLeftAt(cut, u0, u1);
            for (size_t n = 0; n < ScreenCut::kFaces; ++n)
              takes_all[n] &= cut.faces[n][0] + cut.faces[n][1] * u0 + cut.faces[n][2] * u1 < -1.01 * kReach;
          });
      const bool taken = std::find(takes_all.begin(), takes_all.end(), true) != takes_all.end();
      const bool is_found = (found >> tile & 1) != 0;
      EXPECT_TRUE(is_found || !left);
      EXPECT_FALSE(is_found && taken);
      left_tiles += left;
      taken_tiles += taken;
    }
  }
  EXPECT_GT(left_tiles, 1000u);
  EXPECT_GT(taken_tiles, 100u);
}

TEST(TileLists, OfNoSplatAreEmpty) {
  TileLists lists;
  for (int tile = 0; tile < 2; ++tile) {
    lists.begin({0, 0});
    lists.end();
    EXPECT_TRUE(lists.order().empty());
    for (const OrderList& list : lists.lists()) EXPECT_TRUE(list.empty());
  }
}

/// Makes lists of very different lengths, and then of fewer splats: their memory is that of their items.
TEST(TileLists, LieOneBehindTheOther) {
  TileLists lists;
  for (const uint32_t count : {20000u, 100u, 30000u}) {
    lists.begin({0, 0});
    std::array<size_t, kOrderTiles> wanted{};
    for (uint32_t n = 0; n < count; ++n) {
      ScreenSplat splat{};
      splat.x = splat.y = 16;
      splat.key = count - n;
      const size_t tile = n % 50 == 0 ? n / 50 % kOrderTiles : 17;
      // Those behind the front are in no list.
      const bool is_behind = n % 7 == 0;
      const OrderTileMask tiles = OrderTileMask{1} << tile;
      EXPECT_EQ(lists.add(splat, n, tiles, is_behind ? splat.key - 1 : splat.key), is_behind ? tiles : 0);
      wanted[tile] += is_behind ? 0 : 1;
    }
    lists.end();
    const uint64_t* begin = lists.lists()[0].data();
    for (size_t tile = 0; tile < kOrderTiles; ++tile) {
      const OrderList list = lists.lists()[tile];
      EXPECT_EQ(list.size(), wanted[tile]);
      EXPECT_EQ(list.data(), begin);
      EXPECT_TRUE(std::is_sorted(list.begin(), list.end()));
      begin += list.size();
    }
    EXPECT_EQ(lists.order().size(), count - (count + 6) / 7);
  }
}

/// Lists of few and of many splats, which come in the order of their keys, nearly so, or in none.
TEST(TileLists, SortEachListByKeysAndThenByOrder) {
  TileLists lists;
  const TileCorner corner{32, 32};
  for (const uint32_t spread : {0u, 3u, 100000u})
    for (const uint32_t count : {5u, 300u, 5000u}) {
      std::mt19937 random(spread + count);
      lists.begin(corner);
      std::array<std::vector<std::tuple<uint32_t, uint32_t>>, kOrderTiles> wanted;
      for (uint32_t n = 0; n < count; ++n) {
        ScreenSplat splat{};
        splat.x = splat.y = 48;
        splat.key = 1000 + 2 * n + (spread == 0 ? 0 : random() % spread);
        const OrderTileMask tiles = uint64_t{random()} << 32 | random();
        const uint32_t front = 900000;
        EXPECT_EQ(lists.add(splat, 7 * n, tiles, front), 0u);
        for (size_t tile = 0; tile < kOrderTiles; ++tile)
          if (tiles >> tile & 1) wanted[tile].emplace_back(splat.key, 7 * n);
      }
      lists.end();
      for (size_t tile = 0; tile < kOrderTiles; ++tile) {
        std::sort(wanted[tile].begin(), wanted[tile].end());
        std::vector<std::tuple<uint32_t, uint32_t>> found;
        for (const uint64_t item : lists.lists()[tile])
          found.emplace_back(keyOf(item), lists.order()[numberOf(item)]);
        EXPECT_EQ(found, wanted[tile]) << spread << ' ' << count << ' ' << tile;
      }
    }
}

/// Adds one leaning splat with fronts further and further back, as a tile does.
TEST(TileLists, RaiseTheFirstKeyOfASplatToTheLeastThatIsLeft) {
  ScreenSplat splat{};
  splat.x = splat.y = 48;
  splat.key = 20000;
  splat.key_slope0 = 100;
  splat.key_slope1 = -300;
  const TileCorner corner{32, 32};
  const auto keyIn = [&](size_t tile) {  // by the slopes: no key is held by `first`
    const float x = 32 + 2 + 4 * static_cast<float>(tile % kOrderTilesAlong),
                y = 32 + 2 + 4 * static_cast<float>(tile / kOrderTilesAlong);
    return static_cast<uint32_t>(20000 + 100 * (x - 48) - 300 * (y - 48));
  };
  TileLists lists;
  lists.begin(corner);
  OrderTileMask left = 0x00ff3c18007e0501;
  for (const uint32_t front : {0u, 17000u, 18800u, 20100u, 22500u}) {
    OrderTileMask wanted = 0;
    uint32_t least = UINT32_MAX;
    for (size_t tile = 0; tile < kOrderTiles; ++tile)
      if ((left >> tile & 1) != 0 && keyIn(tile) > front) {
        wanted |= OrderTileMask{1} << tile;
        least = std::min(least, keyIn(tile));
      }
    ASSERT_NE(wanted, 0u);
    left = lists.add(splat, 0, left, front);
    EXPECT_EQ(left, wanted) << front;
    EXPECT_EQ(splat.first, least) << front;
  }
  EXPECT_EQ(lists.add(splat, 0, left, 30000), 0u);
  EXPECT_EQ(splat.first, 22800u);
}

TEST(TileQueues, SayWhenMoreWaitThanTheyHold) {
  const auto splats = leaningSplats(1500, 4);
  TileQueues queues(kTiledPicture, 200, 0);
  ordersOf(queues, splats, std::vector<size_t>(50, 40));
  EXPECT_TRUE(queues.isFull());
  queues.clear();
  EXPECT_FALSE(queues.isFull());
}

TEST(TileQueues, SplatsThatDoNotLeanNeverWait) {
  auto splats = leaningSplats(800, 5);
  for (ScreenSplat& splat : splats)
    if (!isRecord(splat)) splat.key_slope0 = splat.key_slope1 = 0, splat.key = splat.first;
  TileQueues queues(kTiledPicture, 32, 0);
  expectOrders(ordersOf(queues, splats, std::vector<size_t>(50, 40)), specifiedFor(splats));
  EXPECT_FALSE(queues.isFull());
}

}  // namespace
}  // namespace curvisplat
