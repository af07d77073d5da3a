// The exchange of projected splats among ranks holds no more than its buffers.
#include "render/ranks/splat_exchange.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

#include "render/ranks/picture_shares.h"
#include "stream/base/memory.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

constexpr size_t kSplats = 65536;
constexpr uint32_t kExchangedParts = 40, kRanks = 2;

/// A picture of 64x64 pixels, whose left half is rank 0's.
SharedParts twoHalves() {
  SharedParts shared;
  shared.size = {64, 64};
  shared.elements = kSplats;
  const int side = TileSet::tilesAlong(64, kSharedTileSide);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) shared.owners.push_back(x < side / 2 ? 0 : 1);
  for (uint32_t n = 0; n < kExchangedParts; ++n) {
    shared.parts.push_back({{n}, {n, n}});
    shared.preparers.push_back(n % kRanks);
  }
  return shared;
}

/// Small splats all over the picture.
std::vector<ScreenSplat> splatsOfAPart() {
  std::vector<ScreenSplat> splats(kSplats);
  for (size_t n = 0; n < kSplats; ++n) {
    splats[n] = {};
    splats[n].x = static_cast<float>(n % 64) + 0.5f;
    splats[n].y = static_cast<float>(n / 64 % 64) + 0.5f;
    splats[n].l11 = splats[n].l22 = 0.25f;
    splats[n].amplitude = 1;
  }
  return splats;
}

// A part that was sent gives its memory back, though the slab goes on. Blocks of 1 MiB and more, which are all that count
// here, are the system's again when they are freed, and mallinfo2 knows them of all threads.
TEST(SplatExchange, HoldsNoMoreThanItsBuffers) {
  returnFreedMemory(size_t{1} << 20);
  const SharedParts shared = twoHalves();
  const std::vector<ScreenSplat> splats = splatsOfAPart();
  std::vector<uint32_t> keys(kSplats);
  std::iota(keys.begin(), keys.end(), 0u);
  const uint64_t buffer = SplatExchange::leastBytes(kSplats);
  const uint64_t before = mallinfo2().hblkhd;
  std::array<uint64_t, kRanks> most{}, received{};
  runRanks(kRanks, [&](Ranks& ranks) {
    SplatExchange exchange(ranks, shared, buffer);
    const int half = TileSet::tilesAlong(64, kSharedTileSide) / 2, first = ranks.rank() == 0 ? 0 : half;
    SplatExchange::Request request{{first, 0, first + half, 2 * half}, {}};
    for (uint32_t n = 0; n < kExchangedParts; ++n) request.parts.push_back(n);
    ASSERT_TRUE(exchange.beginSlab(request));
    while (exchange.step([](uint64_t) { return false; })) {
      while (const auto sequence = exchange.nextReceived())
        received[ranks.rank()] += exchange.received(*sequence).value().splats.size();
      while (const auto index = exchange.nextToPrepare()) exchange.submit(*index, splats, keys);
      most[ranks.rank()] = std::max<uint64_t>(most[ranks.rank()], mallinfo2().hblkhd);
    }
  });
  for (uint32_t rank = 0; rank < kRanks; ++rank) {
    EXPECT_GT(received[rank], kExchangedParts * kSplats / 2);
    EXPECT_LT(most[rank] - before, kRanks * 3 * buffer);
  }
}

// No rank is ahead of the others by more than a round: what they all wait for comes first.
TEST(SplatExchange, PreparesInRounds) {
  SharedParts shared = twoHalves();
  shared.elements = 4;
  const std::vector<size_t> ends = roundEnds(kExchangedParts, kRanks);
  ASSERT_GT(ends.size(), 2u);
  const std::vector<ScreenSplat> splats = {splatsOfAPart()[0]};
  const std::vector<uint32_t> keys = {0};
  std::array<std::vector<std::vector<size_t>>, kRanks> prepared;
  runRanks(kRanks, [&](Ranks& ranks) {
    SplatExchange exchange(ranks, shared, 1 << 20);
    const int half = TileSet::tilesAlong(64, kSharedTileSide) / 2, first = ranks.rank() == 0 ? 0 : half;
    SplatExchange::Request request{{first, 0, first + half, 2 * half}, {}};
    for (uint32_t n = 0; n < kExchangedParts; ++n) request.parts.push_back(n);
    ASSERT_TRUE(exchange.beginSlab(request));
    while (exchange.step([](uint64_t) { return false; })) {
      while (const auto sequence = exchange.nextReceived()) exchange.received(*sequence);
      std::vector<size_t>& round = prepared[ranks.rank()].emplace_back();
      while (const auto index = exchange.nextToPrepare()) {
        round.push_back(exchange.toPrepare()[*index]);
        exchange.submit(*index, splats, keys);
      }
    }
  });
  for (const auto& rounds : prepared) {
    ASSERT_GE(rounds.size(), ends.size());
    for (size_t n = 0; n < rounds.size(); ++n)
      for (const size_t part : rounds[n]) {
        ASSERT_LT(n, ends.size());
        EXPECT_GE(part, n == 0 ? 0 : ends[n - 1]);
        EXPECT_LT(part, ends[n]);
      }
  }
}

}  // namespace
}  // namespace curvisplat
