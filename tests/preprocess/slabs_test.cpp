#include "preprocess/grid/slabs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>

#include "preprocess/convert/memory_plan.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

template <typename Run>
std::string errorOf(const Run& run) {
  try {
    run();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

bool says(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

GridBlock block(uint64_t ni, uint64_t nj, uint64_t nk) {
  return {"block", ni, nj, nk, false};
}

uint64_t nodesIn(const GridBlock& block, const NodeBox& box) {
  return rowsOf(box) * block.ni;
}

/// Each row in exactly one box, windows within the limit, halos there where the block goes on.
void checkSlabs(const std::vector<GridBlock>& blocks, uint64_t window_nodes, Halo halo) {
  std::vector<std::map<std::pair<uint64_t, uint64_t>, int>> seen(blocks.size());
  for (const Slab& slab : cutIntoSlabs(blocks, window_nodes, halo)) {
    const GridBlock& of = blocks[slab.block];
    EXPECT_LE(nodesIn(of, slab.window), window_nodes);
    EXPECT_EQ(slab.window.j0, std::max(slab.box.j0, halo.before) - halo.before);
    EXPECT_EQ(slab.window.k0, std::max(slab.box.k0, halo.before) - halo.before);
    EXPECT_EQ(slab.window.j1, std::min(slab.box.j1 + halo.after, of.nj));
    EXPECT_EQ(slab.window.k1, std::min(slab.box.k1 + halo.after, of.nk));
    for (uint64_t k = slab.box.k0; k < slab.box.k1; ++k)
      for (uint64_t j = slab.box.j0; j < slab.box.j1; ++j) ++seen[slab.block][{j, k}];
  }
  for (size_t n = 0; n < blocks.size(); ++n) {
    EXPECT_EQ(seen[n].size(), blocks[n].nj * blocks[n].nk);
    for (const auto& [row, times] : seen[n]) EXPECT_EQ(times, 1);
  }
}

TEST(Slabs, CoverEveryNodeOnceWithinTheLimit) {
  const std::vector<GridBlock> blocks{block(7, 11, 13), block(1, 1, 1), block(30, 1, 40), block(2, 50, 1)};
  for (const Halo halo : {kNoHalo, kNodeHalo, Halo{0, 1}, Halo{1, 2}})
    for (const uint64_t limit : {halo.after < 2 ? 270u : 480u, 500u, 1000u, 5000u, 100000u})
      checkSlabs(blocks, limit, halo);
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

TEST(Slabs, RefuseARowThatDoesNotFit) {
  EXPECT_THROW(cutIntoSlabs({block(1000, 5, 5)}, 8999, kNodeHalo), Error);
  EXPECT_NO_THROW(cutIntoSlabs({block(1000, 5, 5)}, 9000, kNodeHalo));
}

TEST(Slabs, TasksCoverTheBox) {
  const GridBlock of = block(10, 20, 30);
  for (const uint64_t nodes : {1u, 10u, 95u, 200u, 1000u, 100000u}) {
    std::map<std::pair<uint64_t, uint64_t>, int> seen;
    for (const NodeBox& task : cutForTasks(of, {3, 17, 5, 29}, nodes))
      for (uint64_t k = task.k0; k < task.k1; ++k)
        for (uint64_t j = task.j0; j < task.j1; ++j) ++seen[{j, k}];
    EXPECT_EQ(seen.size(), 14u * 24u);
    for (const auto& [row, times] : seen) EXPECT_EQ(times, 1);
  }
}

TEST(Slabs, OfLongRowsNameTheMemoryThatTheyNeed) {
  const std::vector<GridBlock> blocks{block(10, 10, 10), block(1'000'000, 2, 2)};
  const uint64_t bytes = leastSlabBytes(blocks, 1, kNodeHalo);
  EXPECT_EQ(bytes, 4'000'000 * slabBytesPerNode(1));  // all four rows
  EXPECT_EQ(leastSlabBytes({block(1000, 50, 50)}, 1, kNodeHalo), 9'000 * slabBytesPerNode(1));
  EXPECT_EQ(cutIntoSlabs(blocks, 4'000'000, kNodeHalo).size(), 2u);
  EXPECT_PRED2(says, errorOf([&] { cutIntoSlabs(blocks, 3'999'999, kNodeHalo); }), "4 rows of 1000000 nodes");

  constexpr uint64_t kMiB = 1 << 20;
  const std::string error = errorOf([&] { MemoryPlan::of(256 * kMiB, 1, 2).requireSlabs(bytes); });
  const std::string before = "at least ";
  ASSERT_NE(error.find(before), std::string::npos) << error;
  const uint64_t least = std::stoull(error.substr(error.find(before) + before.size()));
  EXPECT_GT(least, 256u);
  EXPECT_LT(least, 512u);
  MemoryPlan enough = MemoryPlan::of(least * kMiB, 1, 2);
  enough.requireSlabs(bytes);
  EXPECT_GE(kSlabsOfLongRows * enough.slab_bytes, bytes);  // it is alone in memory
  EXPECT_THROW(MemoryPlan::of((least - 2) * kMiB, 1, 2).requireSlabs(bytes), Error);
  MemoryPlan large = MemoryPlan::of(16'384 * kMiB, 1, 2);  // more than it would take of itself
  large.requireSlabs(3072 * kMiB);
  EXPECT_EQ(large.slab_bytes, 1024 * kMiB);
}

TEST(ReadAhead, GivesAllInOrderAndThenNothing) {
  for (const size_t values : {1u, 2u}) {
    int made = 0;
    ReadAhead<int> ahead([&](int& value) { return (value = made++) < 100; }, values);
    for (int n = 0; n < 100; ++n) ASSERT_EQ(*ahead.next(), n);
    EXPECT_EQ(ahead.next(), nullptr);
    EXPECT_EQ(ahead.next(), nullptr);
  }
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
  for (int taken = 0; taken < 4; ++taken) {
    ReadAhead<int> ahead([](int& value) { return ++value > 0; });
    for (int n = 0; n < taken; ++n) ahead.next();
  }
}

}  // namespace
}  // namespace curvisplat
