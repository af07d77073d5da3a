#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>

#include "preprocess/convert/memory_plan.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// One block whose nodes are given.
class GivenNodes : public GridSource {
 public:
  explicit GivenNodes(NodeArrays nodes) : nodes_(std::move(nodes)) {
    description_.blocks = {{"block 1", nodes_.x.size(), 1, 1}};
    for (size_t s = 0; s < nodes_.scalars.size(); ++s)
      description_.scalars.push_back({std::to_string(s), "", {}, 0});
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t, const NodeBox&, std::span<const uint32_t> scalars, NodeArrays& out) const override {
    out = nodes_;
    out.scalars.clear();
    for (const uint32_t s : scalars) out.scalars.push_back(nodes_.scalars[s]);
  }

 private:
  NodeArrays nodes_;
  GridDescription description_;
};

NodeArrays ordinaryNodes(size_t count, size_t scalars) {
  NodeArrays nodes;
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> any(-1e30, 1e30);
  for (auto* axis : {&nodes.x, &nodes.y, &nodes.z}) {
    axis->resize(count);
    for (double& value : *axis) value = any(random);
  }
  nodes.blank.assign(count, 0);
  nodes.scalars.assign(scalars, std::vector<float>(count));
  for (auto& scalar : nodes.scalars)
    for (float& value : scalar) value = static_cast<float>(any(random));
  return nodes;
}

const NodeBox kAllNodes{0, 1, 0, 1};

TEST(NodeReader, LeavesOrdinaryNodesThere) {
  const GivenNodes source(ordinaryNodes(10'001, 2));
  NodeArrays out;
  const BlankCounts counts = NodeReader(source, {0, 1}, 7.0).read(0, kAllNodes, out);
  EXPECT_EQ(counts.total(), 0u);
  EXPECT_EQ(std::count(out.blank.begin(), out.blank.end(), 0), 10'001);
}

/// Each reason at every place modulo the vector width and at the ends of the pieces; each node counts once.
TEST(NodeReader, BlanksEveryNodeThatIsNotThere) {
  constexpr size_t kCount = 9'003;  // no multiple of a vector
  NodeArrays nodes = ordinaryNodes(kCount, 2);
  std::mt19937_64 random(5);
  BlankCounts expected;
  std::vector<uint8_t> blank(kCount);
  for (const size_t n : {0ul, 1ul, 4095ul, 4096ul, 4097ul, 8191ul, 8192ul, 8999ul, 9000ul, 9001ul, 9002ul})
    blank[n] = 1;
  for (int n = 0; n < 60; ++n) blank[random() % kCount] = 1;
  for (size_t n = 0; n < kCount; ++n) {
    if (!blank[n]) continue;
    const uint64_t reasons = 1 + random() % 7;
    const bool grid = reasons & 1, value = reasons & 2, not_finite = reasons & 4;
    if (grid) nodes.blank[n] = 1;
    if (value) nodes.scalars[random() % 2][n] = -9999.0f;
    if (not_finite) {
      const double bad = random() % 3 == 0 ? kNan : random() % 2 ? kInfinity : -kInfinity;
      std::vector<double>* const axes[] = {&nodes.x, &nodes.y, &nodes.z};
      (*axes[random() % 3])[n] = bad;
    }
    expected.by_grid += grid;
    expected.by_value += !grid && value;
    expected.not_finite += !grid && !value && not_finite;
  }
  const GivenNodes source(nodes);
  NodeArrays out;
  const BlankCounts counts = NodeReader(source, {0, 1}, -9999.0).read(0, kAllNodes, out);
  EXPECT_EQ(out.blank, blank);
  EXPECT_EQ(counts.by_grid, expected.by_grid);
  EXPECT_EQ(counts.by_value, expected.by_value);
  EXPECT_EQ(counts.not_finite, expected.not_finite);
}

/// A single bad node has no other one near it that makes the reader look closer.
TEST(NodeReader, FindsASingleBadNodeAnywhere) {
  for (const size_t count : {1, 3, 16, 37, 4101}) {
    const NodeArrays ordinary = ordinaryNodes(count, 1);
    for (size_t bad = count > 100 ? count - 40 : 0; bad < count; ++bad)
      for (int where = 0; where < 5; ++where) {
        NodeArrays nodes = ordinary;
        std::vector<double>* const axes[] = {&nodes.x, &nodes.y, &nodes.z};
        if (where < 3) (*axes[where])[bad] = kInfinity;
        if (where == 3) nodes.scalars[0][bad] = std::numeric_limits<float>::quiet_NaN();
        if (where == 4) nodes.scalars[0][bad] = 5.5f;
        const GivenNodes source(nodes);
        NodeArrays out;
        const BlankCounts counts = NodeReader(source, {0}, 5.5).read(0, kAllNodes, out);
        ASSERT_EQ(counts.by_value, where == 4);
        ASSERT_EQ(counts.not_finite, where != 4);
        ASSERT_EQ(out.blank[bad], 1) << bad << " of " << count;
        ASSERT_EQ(std::count(out.blank.begin(), out.blank.end(), 1), 1);
      }
  }
}

TEST(NodeReader, LooksOnlyAtTheScalarsAskedFor) {
  NodeArrays nodes = ordinaryNodes(100, 2);
  nodes.scalars[1][7] = std::numeric_limits<float>::infinity();
  nodes.scalars[1][8] = 5.5f;
  const GivenNodes source(nodes);
  NodeArrays out;
  EXPECT_EQ(NodeReader(source, {0}, 5.5).read(0, kAllNodes, out).total(), 0u);
  const BlankCounts counts = NodeReader(source, {1}, 5.5).read(0, kAllNodes, out);
  EXPECT_EQ(counts.not_finite, 1u);
  EXPECT_EQ(counts.by_value, 1u);
  EXPECT_TRUE(out.blank[7] && out.blank[8]);
  EXPECT_EQ(NodeReader(source, {}, 5.5).read(0, kAllNodes, out).total(), 0u);
}

/// A value to blank is compared as the scalars are stored: -999.9 is no float.
TEST(NodeReader, ComparesInSinglePrecision) {
  NodeArrays nodes = ordinaryNodes(10, 1);
  nodes.scalars[0][3] = -999.9f;
  const GivenNodes source(nodes);
  NodeArrays out;
  EXPECT_EQ(NodeReader(source, {0}, -999.9).read(0, kAllNodes, out).by_value, 1u);
}

bool says(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

GridBlock block(uint64_t ni, uint64_t nj, uint64_t nk) {
  return {"block", ni, nj, nk, false};
}

uint64_t nodesIn(const GridBlock& block, const NodeBox& box) {
  return rowsOf(box) * box.rowNodes(block.ni);
}

/// Each node in exactly one box, windows within the limit, halos there where the block goes on.
void checkSlabs(const std::vector<GridBlock>& blocks, uint64_t window_nodes, Halo halo) {
  std::vector<std::map<std::array<uint64_t, 3>, int>> seen(blocks.size());
  for (const Slab& slab : cutIntoSlabs(blocks, window_nodes, halo)) {
    const GridBlock& of = blocks[slab.block];
    EXPECT_LE(nodesIn(of, slab.window), window_nodes);
    EXPECT_EQ(slab.window.j0, std::max(slab.box.j0, halo.before) - halo.before);
    EXPECT_EQ(slab.window.k0, std::max(slab.box.k0, halo.before) - halo.before);
    EXPECT_EQ(slab.window.j1, std::min(slab.box.j1 + halo.after, of.nj));
    EXPECT_EQ(slab.window.k1, std::min(slab.box.k1 + halo.after, of.nk));
    EXPECT_EQ(slab.window.i0, std::max(slab.box.i0, halo.before) - halo.before);
    EXPECT_EQ(slab.window.i1, std::min(slab.box.i1 + halo.after, of.ni));
    for (uint64_t k = slab.box.k0; k < slab.box.k1; ++k)
      for (uint64_t j = slab.box.j0; j < slab.box.j1; ++j)
        for (uint64_t i = slab.box.i0; i < slab.box.i1; ++i) ++seen[slab.block][{i, j, k}];
  }
  for (size_t n = 0; n < blocks.size(); ++n) {
    EXPECT_EQ(seen[n].size(), blocks[n].nodes());
    for (const auto& [node, times] : seen[n]) EXPECT_EQ(times, 1);
  }
}

TEST(Slabs, CoverEveryNodeOnceWithinTheLimit) {
  const std::vector<GridBlock> blocks{block(7, 11, 13), block(1, 1, 1), block(30, 1, 40), block(2, 50, 1)};
  for (const Halo halo : {kNoHalo, kNodeHalo, Halo{0, 1}, Halo{1, 2}})
    for (const uint64_t limit : {64u, 100u, 270u, 480u, 500u, 1000u, 5000u, 100000u})
      checkSlabs(blocks, limit, halo);
  checkSlabs(blocks, 1, kNoHalo);
}

TEST(Slabs, ReadPlanesWholeWhereTheyFit) {
  const auto slabs = cutIntoSlabs({block(10, 10, 100)}, 1000, kNodeHalo);
  for (const Slab& slab : slabs) EXPECT_EQ(slab.box.j1 - slab.box.j0, 10u);
  EXPECT_EQ(slabs.front().box.k1, 8u);
}

TEST(Slabs, ReadLittleTwiceWherePlanesDoNotFit) {
  uint64_t read = 0;
  const GridBlock wide = block(100, 1000, 1000);
  for (const Slab& slab : cutIntoSlabs({wide}, 100 * 1000, kNodeHalo)) read += nodesIn(wide, slab.window);
  EXPECT_LT(static_cast<double>(read), 1.2 * static_cast<double>(wide.nodes()));
}

TEST(Slabs, CutRowsThatDoNotFitWithTheirNeighbours) {
  const auto whole = [](const std::vector<Slab>& slabs) {
    return std::all_of(slabs.begin(), slabs.end(),
                       [](const Slab& slab) { return slab.window.hasWholeRows(1000); });
  };
  EXPECT_TRUE(whole(cutIntoSlabs({block(1000, 5, 5)}, 9000, kNodeHalo)));
  EXPECT_FALSE(whole(cutIntoSlabs({block(1000, 5, 5)}, 8999, kNodeHalo)));
  EXPECT_TRUE(whole(cutIntoSlabs({block(1000, 5, 5)}, 1000, kNoHalo)));
  // A thin grid is cut along i alone, and little of it is read twice.
  uint64_t read = 0;
  const GridBlock thin = block(1'000'000, 9, 9);
  for (const Slab& slab : cutIntoSlabs({thin}, 1'000'000, Halo{3, 3})) {
    EXPECT_EQ(rowsOf(slab.box), 81u);
    read += nodesIn(thin, slab.window);
  }
  EXPECT_LT(static_cast<double>(read), 1.01 * static_cast<double>(thin.nodes()));
  EXPECT_PRED2(says, errorOf([] { cutIntoSlabs({block(1000, 5, 5)}, 26, kNodeHalo); }),
               "not even a node and its neighbours fit");
}

TEST(Slabs, KeepThePartsOfARowTogether) {
  const auto slabs = cutIntoSlabs({block(100, 9, 9), block(3, 3, 3)}, 800, kNodeHalo);
  EXPECT_GT(slabs.size(), 10u);
  for (size_t n = 1; n < slabs.size(); ++n) {
    const NodeBox &before = slabs[n - 1].box, &box = slabs[n].box;
    if (box.i0 == 0) {
      EXPECT_EQ(before.i1, 100u);
      continue;
    }
    EXPECT_EQ(box.i0, before.i1);
    EXPECT_EQ(box.j0, before.j0);
    EXPECT_EQ(box.k0, before.k0);
  }
}

TEST(Slabs, TasksCoverTheBox) {
  const GridBlock of = block(10, 20, 30);
  for (const uint64_t nodes : {1u, 10u, 95u, 200u, 1000u, 100000u}) {
    std::map<std::pair<uint64_t, uint64_t>, int> seen;
    for (const NodeBox& task : cutForTasks(of.ni, {3, 17, 5, 29}, nodes))
      for (uint64_t k = task.k0; k < task.k1; ++k)
        for (uint64_t j = task.j0; j < task.j1; ++j) ++seen[{j, k}];
    EXPECT_EQ(seen.size(), 14u * 24u);
    for (const auto& [row, times] : seen) EXPECT_EQ(times, 1);
  }
}

TEST(Slabs, OfRowsThatAreReadAsAWholeNameTheMemoryThatTheyNeed) {
  constexpr uint64_t kMiB = 1 << 20;
  const uint64_t bytes = 2'000'000 * slabBytesPerNode(1);
  const std::string error =
      errorOf([&] { MemoryPlan::of(256 * kMiB, 1, 2).requireRow("block 7", 2'000'000, bytes); });
  EXPECT_PRED2(says, error, "block 7: a row of 2000000 nodes along i");
  const std::string before = "at least ";
  ASSERT_NE(error.find(before), std::string::npos) << error;
  const uint64_t least = std::stoull(error.substr(error.find(before) + before.size()));
  EXPECT_GT(least, 512u);
  EXPECT_LT(least, 640u);
  EXPECT_NO_THROW(MemoryPlan::of(least * kMiB, 1, 2).requireRow("block 7", 2'000'000, bytes));
  EXPECT_GE(MemoryPlan::of(least * kMiB, 1, 2).slab_bytes, bytes);
  EXPECT_THROW(MemoryPlan::of((least - 2) * kMiB, 1, 2).requireRow("block 7", 2'000'000, bytes), Error);
  // Slabs grow no further than to 256 MiB, rows may.
  EXPECT_NO_THROW(MemoryPlan::of(16'384 * kMiB, 1, 2).requireRow("block 7", 1, 1024 * kMiB));
}

TEST(ReadAhead, GivesAllInOrderAndThenNothing) {
  int made = 0;
  ReadAhead<int> ahead([&](int& value) { return (value = made++) < 100; });
  for (int n = 0; n < 100; ++n) ASSERT_EQ(*ahead.next(), n);
  EXPECT_EQ(ahead.next(), nullptr);
  EXPECT_EQ(ahead.next(), nullptr);
}

TEST(ReadAhead, HandsOnWhatWentWrong) {
  int made = 0;
  ReadAhead<int> ahead([&](int& value) {
    if ((value = made++) == 3) throw std::runtime_error("disk");
    return true;
  });
  for (int n = 0; n < 3; ++n) ASSERT_EQ(*ahead.next(), n);
  EXPECT_THROW(ahead.next(), std::runtime_error);
}

TEST(ReadAhead, CanBeLeftAtAnyTime) {
  for (int taken = 0; taken < 4; ++taken)
    for (const unsigned readers : {1u, 3u}) {
      ReadAhead<int> ahead([](int& value, uint64_t) { return ++value > 0; }, readers);
      for (int n = 0; n < taken; ++n) ahead.next();
    }
}

TEST(ReadAhead, ReadsInOrderByManyThreads) {
  constexpr unsigned kReaders = 4;
  constexpr uint64_t kValues = 1000;
  std::atomic<unsigned> reading = 0, most = 0;
  ReadAhead<uint64_t> ahead(
      [&](uint64_t& value, uint64_t number) {
        const unsigned now = ++reading;
        for (unsigned before = most; before < now && !most.compare_exchange_weak(before, now);) {
        }
        if (number % 3 == 0) std::this_thread::yield();
        value = number * number;
        --reading;
        return number < kValues;
      },
      kReaders);
  for (uint64_t n = 0; n < kValues; ++n) ASSERT_EQ(*ahead.next(), n * n);
  EXPECT_EQ(ahead.next(), nullptr);
  EXPECT_LE(most, kReaders);
}

TEST(ReadAhead, HandsOnTheFirstThatWentWrongByManyThreads) {
  for (int round = 0; round < 100; ++round) {
    ReadAhead<uint64_t> ahead(
        [](uint64_t& value, uint64_t number) {
          if (number >= 5) throw std::runtime_error(std::to_string(number));
          value = number;
          return true;
        },
        4);
    for (uint64_t n = 0; n < 5; ++n) ASSERT_EQ(*ahead.next(), n);
    try {
      ahead.next();
      FAIL() << "nothing went wrong";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "5");
    }
  }
}

// Readers and the threads of loops together, by the permits of the thread that makes both.
TEST(ReadAhead, ComputesWithinTheBoundOfItsLoops) {
  for (const int bound : {1, 2, 3}) {
    ComputePermits permits(static_cast<unsigned>(bound));
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(bound));
    std::atomic<int> computing_now = 0, most = 0, used = 0;
    const auto compute = [&] {
      const int now = ++computing_now;
      for (int before = most; before < now && !most.compare_exchange_weak(before, now);) {
      }
      std::this_thread::yield();
      --computing_now;
    };
    {
      const Computing computing(&permits);
      ReadAhead<uint64_t> ahead(
          [&](uint64_t& value, uint64_t number) {
            for (int n = 0; n < 10; ++n) compute();
            value = number;
            return number < 200;
          },
          3);
      while (const uint64_t* value = ahead.next()) {
        parallelFor(0, 20, [&](int) { parallelInvoke(compute, compute); });
        used += *value < 200;
      }
    }
    EXPECT_EQ(used, 200);
    EXPECT_LE(most, bound);
  }
}

TEST(ReadAhead, CanBeLeftWithTheOnlyPermit) {
  ComputePermits permits(1);
  const Computing computing(&permits);
  for (int taken = 0; taken < 4; ++taken) {
    ReadAhead<int> ahead([](int& value, uint64_t) { return ++value > 0; }, 3);
    for (int n = 0; n < taken; ++n) ahead.next();
  }
}

// Small ones are read several at a time.
TEST(Slabs, OfBlocksSmallAndLargeComeInOrder) {
  std::vector<GridBlock> blocks;
  for (uint64_t n = 0; n < 300; ++n)
    blocks.push_back(n % 97 == 5 ? gridBlock(20, 20, 20 + n % 7) : gridBlock(2 + n % 3, 2 + n % 5, 4));
  const FunctionGridSource source(blocks, 0, [](const GridNode& node) {
    return NodeValues{{1.0 * node.block, 1.0 * node.j, 1.0 * node.k}, {}, false};
  });
  const NodeReader reader(source, {}, std::nullopt);
  for (const unsigned readers : {1u, 3u})
    for (const uint64_t nodes : {uint64_t{500}, uint64_t{100'000}}) {
      const std::vector<Slab> all = cutIntoSlabs(blocks, nodes, kCornerHalo);
      SlabStream slabs(reader, {nodes * slabBytesPerNode(0), readers}, kCornerHalo);
      size_t count = 0;
      while (const LoadedSlab* loaded = slabs.next()) {
        ASSERT_LT(count, all.size());
        const Slab& expected = all[count++];
        ASSERT_EQ(loaded->slab.block, expected.block);
        ASSERT_EQ(loaded->slab.box.k0, expected.box.k0);
        ASSERT_EQ(loaded->slab.box.j0, expected.box.j0);
        ASSERT_EQ(loaded->nodes.x.size(),
                  rowsOf(expected.window) * expected.window.rowNodes(blocks[expected.block].ni));
        ASSERT_EQ(loaded->nodes.x.back(), expected.block);
        ASSERT_EQ(loaded->nodes.z.back(), static_cast<double>(expected.window.k1 - 1));
      }
      EXPECT_EQ(count, all.size());
    }
  // Streams only some of the slabs.
  std::vector<Slab> some = cutIntoSlabs(blocks, 100'000, kNoHalo);
  std::erase_if(some, [](const Slab& slab) { return slab.block % 3 != 1; });
  SlabStream slabs(reader, 1 << 20, some);
  for (const Slab& expected : some) ASSERT_EQ(slabs.next()->slab.block, expected.block);
  EXPECT_EQ(slabs.next(), nullptr);
}

}  // namespace
}  // namespace curvisplat
