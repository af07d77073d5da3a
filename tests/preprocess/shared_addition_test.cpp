// Several ranks add scalars to a cache together: it has the bytes of one process's.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <limits>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kSeveralBricks = 26;

/// Two abutting blocks with a common face, and one apart; three scalars. One brick holds them, several hold those of
/// kSeveralBricks layers.
FunctionGridSource abuttingBlocks(const std::function<void(const GridNode&, NodeValues&)>& change = {},
                                  Centring centring = Centring::kNode, uint64_t nk = 10) {
  return FunctionGridSource(
      {gridBlock(40, 40, nk), gridBlock(30, 40, nk), gridBlock(9, 8, 7)}, 3,
      [=](const GridNode& node) {
        const auto x = static_cast<double>(node.i) + (node.block == 0 ? 0 : node.block == 1 ? 39 : 200);
        const auto y = static_cast<double>(node.j), z = static_cast<double>(node.k);
        NodeValues values;
        values.position = {x + 0.2 * std::sin(y), y, z};
        values.scalars = {static_cast<float>(std::sin(0.1 * x) + y), static_cast<float>(x * z),
                          static_cast<float>(std::cos(0.3 * y) * z)};
        if (change) change(node, values);
        return values;
      },
      centring);
}

class SharedAddition : public testing::Test {
 protected:
  void convertFirst(const GridSource& source) const {
    ConvertOptions options;
    options.output = folder_ / "first.splats";
    options.memory_bytes = uint64_t{512} << 20;
    options.scalars = {0};
    options.title = "a grid";
    Progress progress;
    convert(source, options, progress);
  }

  AddScalarOptions options() const {
    AddScalarOptions options;
    options.cache = folder_ / "added.splats";
    options.scalars = {1, 2};
    options.memory_bytes = uint64_t{512} << 20;
    options.threads = 1;
    return options;
  }

  void expectSameBytes(const GridSource& source, const std::vector<unsigned>& counts,
                       std::optional<uint64_t> bucket_splats = {},
                       std::optional<uint32_t> most_buckets = {}) {
    convertFirst(source);
    std::vector<Variation> by_ranks;
    for (const unsigned count : counts)
      by_ranks.push_back({.bucket_splats = bucket_splats, .most_buckets = most_buckets, .ranks = count});
    expectSameAdditions(source, folder_ / "first.splats", options(), by_ranks);
    EXPECT_EQ(allFilesOf(options().cache).size(), allFilesOf(folder_ / "first.splats").size() + 3)
        << "two scalars and their faces";
    EXPECT_EQ(entriesOf(folder_.path()), 2u) << "something is left";
  }

  /// Expects that a job fails with these words, and leaves the cache as it was.
  void expectFails(unsigned count, const std::function<void(Ranks& ranks)>& job, const std::string& words) {
    SCOPED_TRACE(words);
    const Files before = allFilesOf(options().cache);
    try {
      runRanks(count, job);
      ADD_FAILURE() << "added";
    } catch (const std::exception& error) {
      expectSays(error.what(), words);
    }
    EXPECT_TRUE(allFilesOf(options().cache) == before);
    EXPECT_EQ(entriesOf(folder_.path()), 2u) << "something is left";
  }

  TemporaryFolder folder_;
};

TEST_F(SharedAddition, HasTheBytesOfOneProcess) {
  const GridBlock block = gridBlock(48, 40, 38);
  expectSameBytes(FunctionGridSource({block}, 3,
                                     [](const GridNode& node) {
                                       const auto x = static_cast<double>(node.i);
                                       const auto y = static_cast<double>(node.j);
                                       const auto z = static_cast<double>(node.k);
                                       return NodeValues{{x + std::sin(0.1 * y), y, z + 0.01 * x * y},
                                                         {static_cast<float>(x * y), static_cast<float>(z),
                                                          static_cast<float>(std::sin(x + z))},
                                                         false};
                                     }),
                  faults::isWholeSweep() ? std::vector<unsigned>{2, 3, 4, 7} : std::vector<unsigned>{7},
                  6000);
}

TEST_F(SharedAddition, HasTheBytesWithSeamsAndBlanks) {
  expectSameBytes(
      abuttingBlocks([](const GridNode& node,
                        NodeValues& values) { values.blank = node.block == 1 && node.i == 20 && node.j < 6; },
                     Centring::kNode, kSeveralBricks),
      faults::isWholeSweep() ? std::vector<unsigned>{2, 3, 4} : std::vector<unsigned>{4}, 5000);
}

TEST_F(SharedAddition, HasTheBytesWithBucketsThatAreDivided) {
  expectSameBytes(abuttingBlocks({}, Centring::kNode, kSeveralBricks), {3}, 500, 3);
}

TEST_F(SharedAddition, HasTheBytesWhereOlderScalarsBlanked) {
  expectSameBytes(abuttingBlocks([](const GridNode& node, NodeValues& values) {
                    // At both nodes of the seam, or at none.
                    if (node.block < 2 && node.j == 13 && node.k % 3 == 0)
                      values.scalars[0] = std::numeric_limits<float>::quiet_NaN();
                  }),
                  {2}, 2000);
}

TEST_F(SharedAddition, HasTheBytesOfCells) {
  expectSameBytes(abuttingBlocks({}, Centring::kCell), {3}, 2000);
}

TEST_F(SharedAddition, HasTheBytesOfBlocksThatOverlap) {
  // The second block is finer, and covers a part of the first.
  const FunctionGridSource source(
      {gridBlock(20, 20, 20), gridBlock(20, 20, 20)}, 3, [](const GridNode& node) {
        const double spacing = node.block == 0 ? 1 : 0.5, from = node.block == 0 ? 0 : 8.3;
        const glm::dvec3 at(from + spacing * static_cast<double>(node.i),
                            from + spacing * static_cast<double>(node.j),
                            from + spacing * static_cast<double>(node.k));
        return NodeValues{
            at, {static_cast<float>(at.x), static_cast<float>(at.y * at.z), static_cast<float>(at.z)}, false};
      });
  expectSameBytes(source, {3}, 1500);
  EXPECT_EQ(CacheReader(folder_ / "first.splats").manifest().overlap, kOverlapOwner);
}

TEST_F(SharedAddition, HasTheBytesWhereRanksHaveNothingToDo) {
  expectSameBytes(FunctionGridSource({gridBlock(4, 3, 3)}, 3,
                                     [](const GridNode& node) {
                                       const auto x = static_cast<float>(node.i);
                                       return NodeValues{{x, node.j, node.k}, {x, 2 * x, x * x}, false};
                                     }),
                  {2, 7});
}

TEST_F(SharedAddition, TakesTheSmallestMemoryOfItsRanks) {
  const FunctionGridSource source = abuttingBlocks();
  expectSameBytes(source, {});
  const Files expected = allFilesOf(options().cache);
  fs::remove_all(options().cache);
  fs::copy(folder_ / "first.splats", options().cache);
  runRanks(3, [&](Ranks& ranks) {
    AddScalarOptions of_rank = options();
    of_rank.ranks = &ranks;
    if (ranks.rank() == 1) of_rank.memory_bytes = leastMemory(2);
    if (ranks.rank() == 2) of_rank.limits.bucket_splats = 1200;
    Progress progress;
    addScalars(source, of_rank, progress);
  });
  EXPECT_TRUE(allFilesOf(options().cache) == expected);
}

TEST_F(SharedAddition, LeavesTheCacheWhereARankIsStoppedInAnyPass) {
  const FunctionGridSource source = abuttingBlocks();
  convertFirst(source);
  fs::copy(folder_ / "first.splats", options().cache);
  const char* const passes[] = {"scan", "scatter", "seams", "build", "faces"};
  for (int pass = 0; pass < 5; ++pass)
    for (const unsigned victim : {0u, 1u, 2u}) {
      if (victim != static_cast<unsigned>(pass) % 3 && !faults::isWholeSweep()) continue;
      SCOPED_TRACE(fmt::format("rank {} in {}", victim, passes[pass]));
      expectFails(
          3,
          [&](Ranks& ranks) {
            AddScalarOptions of_rank = options();
            of_rank.ranks = &ranks;
            Progress* stopped = nullptr;
            int ended = 0;
            Progress progress([&](const Progress::State* state) {
              if (!state && ++ended == pass && stopped) stopped->stop(SIGTERM);
            });
            if (ranks.rank() == victim) stopped = &progress;
            if (ranks.rank() == victim && pass == 0) progress.stop(SIGTERM);
            ranks.whileWaiting([&] { progress.throwIfStopped(); });
            addScalars(source, of_rank, progress);
          },
          "");
    }
}

TEST_F(SharedAddition, RefusesForAllRanks) {
  const FunctionGridSource source = abuttingBlocks();
  convertFirst(source);
  fs::copy(folder_ / "first.splats", options().cache);
  const auto adding = [&](const GridSource& of_source, const AddScalarOptions& given) {
    return [&, given](Ranks& ranks) {
      AddScalarOptions of_rank = given;
      of_rank.ranks = &ranks;
      Progress progress;
      addScalars(of_source, of_rank, progress);
    };
  };
  AddScalarOptions present = options();
  present.scalars = {0};
  expectFails(2, adding(source, present), "already has a scalar 's0'");
  const FunctionGridSource lacking = abuttingBlocks([](const GridNode& node, NodeValues& values) {
    if (node.block == 1 && node.i == 20) values.scalars[1] = std::numeric_limits<float>::quiet_NaN();
  });
  expectFails(3, adding(lacking, options()), "have no value of s1");
  const FunctionGridSource moved = abuttingBlocks([](const GridNode& node, NodeValues& values) {
    if (node.block == 1 && node.i == 20 && node.j == 20 && node.k == 8) values.position.x += 0.9;
  });
  expectFails(3, adding(moved, options()), "not the one the cache was made from");
  const CacheLock lock(options().cache);
  expectFails(2, adding(source, options()), "another program is changing this cache");
}

TEST_F(SharedAddition, NeedsAFileSystemThatAllRanksSee) {
  const FunctionGridSource source = abuttingBlocks();
  convertFirst(source);
  fs::copy(folder_ / "first.splats", options().cache);
  expectFails(
      2,
      [&](Ranks& ranks) {
        AddScalarOptions of_rank = options();
        of_rank.ranks = &ranks;
        // As if rank 1 saw another cache.
        if (!ranks.isFirst()) of_rank.cache = folder_ / "unseen.splats";
        Progress progress;
        addScalars(source, of_rank, progress);
      },
      "unseen.splats");
}

}  // namespace
}  // namespace curvisplat
