// Several ranks convert one grid together: the cache has the bytes of one process's.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <map>
#include <memory>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/convert/shared_passes.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/error.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class SharedConversion : public testing::Test {
 protected:
  ConvertOptions optionsFor(const GridSource& source, const std::string& name) const {
    ConvertOptions options;
    options.output = folder_ / name;
    options.memory_bytes = uint64_t{512} << 20;
    options.threads = 1;
    for (uint32_t n = 0; n < source.description().scalars.size(); ++n) options.scalars.push_back(n);
    return options;
  }

  void expectSameBytes(const GridSource& source, const std::vector<unsigned>& counts,
                       std::optional<uint64_t> bucket_splats = {}) const {
    ConvertOptions options = optionsFor(source, "one.splats");
    options.overwrite = true;
    options.title = "a grid";
    std::vector<Variation> by_ranks;
    for (const unsigned count : counts) by_ranks.push_back({.bucket_splats = bucket_splats, .ranks = count});
    expectSameCaches(source, options, by_ranks);
    EXPECT_EQ(entriesOf(folder_.path()), 1u) << "something is left";
  }

  TemporaryFolder folder_;
};

TEST_F(SharedConversion, HasTheBytesOfOneProcess) {
  const auto counts = faults::isWholeSweep() ? std::vector<unsigned>{2, 3, 4, 7} : std::vector<unsigned>{7};
  expectSameBytes(SceneGridSource(makeScene("half-annulus"), {60, 40, 32}), counts, 5000);
}

TEST_F(SharedConversion, HasTheBytesWithBucketsOfAnySize) {
  const SceneGridSource source(makeScene("half-annulus"), {60, 40, 30});
  if (faults::isWholeSweep()) expectSameBytes(source, {2});
  expectSameBytes(source, {3}, 1000);
}

/// Two abutting blocks with a common face, and one apart; some nodes blanked.
FunctionGridSource blocksWithSeams(Centring centring = Centring::kNode, uint64_t nk = 24) {
  return FunctionGridSource(
      {gridBlock(40, 40, nk), gridBlock(30, 40, nk), gridBlock(9, 8, 7)}, 2,
      [=](const GridNode& node) {
        const auto x = static_cast<double>(node.i) + (node.block == 0 ? 0 : node.block == 1 ? 39 : 200);
        const auto y = static_cast<double>(node.j), z = static_cast<double>(node.k);
        NodeValues values;
        values.position = {x + 0.2 * std::sin(y), y, z};
        values.scalars = {static_cast<float>(std::sin(0.1 * x) + y), static_cast<float>(x * z)};
        values.blank = node.block == 1 && node.i == 20 && node.j < 6;
        return values;
      },
      centring);
}

TEST_F(SharedConversion, HasTheBytesWithSeamsBlanksAndSeveralScalars) {
  expectSameBytes(blocksWithSeams(),
                  faults::isWholeSweep() ? std::vector<unsigned>{2, 4} : std::vector<unsigned>{4}, 4000);
}

TEST_F(SharedConversion, HasTheBytesOfCells) {
  expectSameBytes(blocksWithSeams(Centring::kCell, 10), {3}, 4000);
}

TEST_F(SharedConversion, HasTheBytesWhereRanksHaveNothingToDo) {
  expectSameBytes(FunctionGridSource({gridBlock(4, 3, 3)}, 1,
                                     [](const GridNode& node) {
                                       const auto x = static_cast<float>(node.i);
                                       return NodeValues{{x, node.j, node.k}, {x}, false};
                                     }),
                  {2, 7});
}

TEST_F(SharedConversion, HasTheBytesOfNodesThatCoincide) {
  expectSameBytes(FunctionGridSource({gridBlock(190, 190, 2)}, 1,
                                     [](const GridNode& node) {
                                       const bool far = node.i > 180;
                                       return NodeValues{
                                           {far ? node.i : 1.0, far ? node.j : 1.0, far ? node.k : 1.0},
                                           {static_cast<float>(node.i)},
                                           false};
                                     }),
                  {3}, 16000);
}

TEST_F(SharedConversion, IsResumedByAnyNumberOfRanks) {
  const SceneGridSource source(makeScene("half-annulus"), {60, 40, 32});
  ConvertOptions options = optionsFor(source, "one.splats");
  options.title = "a grid";
  converted(source, options);
  const Files expected = allFilesOf(options.output);
  fs::remove_all(options.output);
  for (const auto& [first, second] : {std::pair{3u, 1u}, {3u, 2u}, {1u, 3u}, {2u, 4u}}) {
    if ((first != 3 || second != 2) && !faults::isWholeSweep()) continue;
    SCOPED_TRACE(fmt::format("{}, then {}", first, second));
    options.output = folder_ / "again.splats";
    options.limits.bucket_splats = 3000;
    options.resume = false;
    // Stopped when the first bricks have been built.
    std::atomic<bool> building = false;
    const auto interrupted = [&, count = first](Ranks& ranks) {
      ConvertOptions of_rank = options;
      if (count > 1) of_rank.ranks = &ranks;
      Progress* stopped = nullptr;
      Progress progress([&](const Progress::State* state) {
        if (state && state->phase == "build") {
          building = true;
          if (stopped) stopped->stop(SIGTERM);
        }
      });
      stopped = &progress;
      ranks.whileWaiting([&] {
        if (building) progress.stop(SIGTERM);
        progress.throwIfStopped();
      });
      convert(source, of_rank, progress);
    };
    EXPECT_THROW(runRanks(first, interrupted), Interrupted);
    ASSERT_TRUE(fs::exists(folder_ / "again.splats.partial"));
    options.resume = true;
    const ConvertReport report =
        second > 1 ? convertedByRanks(second, source, options) : converted(source, options);
    EXPECT_TRUE(report.resumed);
    expectSameFiles(allFilesOf(options.output), expected);
    EXPECT_EQ(entriesOf(folder_.path()), 1u) << "something is left";
    fs::remove_all(options.output);
  }
}

TEST_F(SharedConversion, NeedsAFileSystemThatAllRanksSee) {
  const SceneGridSource source(makeScene("half-annulus"), {16, 16, 16});
  ConvertOptions options = optionsFor(source, "one.splats");
  expectError(
      [&] {
        runRanks(2, [&](Ranks& ranks) {
          ConvertOptions of_rank = options;
          of_rank.ranks = &ranks;
          // As if what rank 0 makes were not seen by rank 1.
          Progress progress;
          if (ranks.isFirst()) {
            convert(source, of_rank, progress);
          } else {
            ranks.broadcast({});
            throw Error("rank 1 sees no such folder");
          }
        });
      },
      {"rank 1 sees"});
  EXPECT_EQ(entriesOf(folder_.path()), 0u) << "something is left";
}

// ------------------------------------------------------------------------------------------------ buckets

TEST(DealBuckets, GivesEachBucketToOneRankAndCutsNoUnit) {
  // A tree of 64 leaves of which each is a bucket, with splats in some of them only.
  BucketTree tree;
  tree.split(
      0, [](const Cell& cell) { return cell.level < 2 ? 2u : 1u; }, 1, 2);
  const std::vector<uint32_t> leaves = tree.leavesBelow(0);
  const uint32_t buckets = tree.assignBuckets(
      leaves, [](uint32_t) { return 1; }, 1);
  ASSERT_EQ(buckets, 64u);
  std::vector<CellContents> contents(tree.size());
  for (size_t n = 0; n < leaves.size(); ++n) {
    contents[leaves[n]].splats = n % 8 < 5 ? 0 : n < 16 ? 30000 : 40000;
    contents[leaves[n]].lower = {{n, n, n}};
    contents[leaves[n]].upper = {{n + 1, n, n}};
  }
  tree.setContents(leaves, contents);
  for (const unsigned ranks : {1u, 2u, 3u, 8u, 100u}) {
    const std::vector<BucketRange> ranges = dealBuckets(tree, buckets, ranks);
    ASSERT_EQ(ranges.size(), ranks);
    uint32_t next = 0;
    std::map<uint32_t, unsigned> rank_of_unit;
    for (unsigned rank = 0; rank < ranks; ++rank) {
      EXPECT_EQ(ranges[rank].first, next);
      next = ranges[rank].end;
      for (uint32_t bucket = ranges[rank].first; bucket < ranges[rank].end; ++bucket)
        if (tree[leaves[bucket]].contents.splats > 0) {
          const auto [at, is_new] = rank_of_unit.emplace(buildUnitOf(tree, leaves[bucket]), rank);
          EXPECT_EQ(at->second, rank);
        }
    }
    EXPECT_EQ(next, buckets);
  }
}

}  // namespace
}  // namespace curvisplat
