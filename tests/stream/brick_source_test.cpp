#include "stream/paging/brick_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <random>
#include <thread>

#include "stream/base/error.h"
#include "tests/support/expect_error.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::FaultySystemCalls;

bool same(const SplatGeometry& a, const GeometryArrays<const float>& b) {
  const auto equal = [&](const std::vector<float>& x, const float* y) {
    return std::equal(x.begin(), x.end(), y);
  };
  return a.size() == b.size() && equal(a.x, b.x) && equal(a.y, b.y) && equal(a.z, b.z) &&
         equal(a.axis0, b.axis0) && equal(a.axis1, b.axis1) && equal(a.axis2, b.axis2) &&
         equal(a.shear10, b.shear10) && equal(a.shear20, b.shear20) && equal(a.shear21, b.shear21) &&
         equal(a.weight, b.weight);
}

bool same(const SplatVariable& a, const VariableArrays<const float>& b) {
  const auto equal = [&](const std::vector<float>& x, const float* y) {
    return std::equal(x.begin(), x.end(), y);
  };
  return a.size() == b.size() && equal(a.mean, b.mean) && equal(a.slope0, b.slope0) &&
         equal(a.slope1, b.slope1) && equal(a.slope2, b.slope2) && equal(a.variance, b.variance);
}

class BrickSourceTest : public ::testing::Test {
 protected:
  BrickSourceTest() {
    writeRandomCache(folder_ / "a.splats");
    cache_ = std::make_unique<CacheReader>(folder_ / "a.splats");
    for (uint32_t brick = 0; brick < cache_->bricks().size(); ++brick) {
      cache_->readGeometry(brick, geometry_.emplace_back());
      cache_->readVariable(brick, 0, values_.emplace_back());
      decoded_bytes_ += BrickCache::charge(cache_->bricks()[brick].splats);
      order_.push_back(brick);
    }
  }

  PagerOptions pagerOptions() const {
    PagerOptions options;
    options.buffer_bytes = BrickPager::leastBufferBytes(*cache_, 0) + (64 << 10);
    return options;
  }

  bool isBrick(uint32_t brick, const BrickSource::Splats& splats) const {
    return splats.cell == cache_->bricks()[brick].cell && same(geometry_[brick], splats.geometry) &&
           same(values_[brick], splats.values);
  }

  static std::vector<BrickPart> partsOf(const std::vector<uint32_t>& bricks) {
    std::vector<BrickPart> parts;
    for (const uint32_t brick : bricks) parts.push_back({brick, kAllOctants});
    return parts;
  }

  /// Takes a frame of `order` on some threads. Returns how many bricks were as they should be; an error ends
  /// it, and is thrown.
  size_t takeAll(BrickSource& source, const std::vector<uint32_t>& order, unsigned threads,
                 FetchStatistics& statistics) const {
    source.start(partsOf(order));
    std::atomic<size_t> next = 0, good = 0, errors = 0;
    std::exception_ptr error;
    const auto work = [&] {
      BrickSource::Scratch scratch;
      try {
        for (size_t n; (n = next++) < order.size();) {
          const auto splats = source.fetch(n, scratch);
          if (!splats) return;
          good += isBrick(order[n], *splats);
        }
      } catch (const Error&) {
        if (errors++ == 0) error = std::current_exception();
        source.stop();
      }
    };
    std::vector<std::thread> team;
    for (unsigned n = 0; n < threads; ++n) team.emplace_back(work);
    for (std::thread& thread : team) thread.join();
    source.finish(statistics);
    if (error) std::rethrow_exception(error);
    return good;
  }

  static void overwrite(const fs::path& path, uint64_t offset) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(offset));
    file.put('\x55').put('\x5a').put('\xa5');
  }

  TemporaryFolder folder_;
  std::unique_ptr<CacheReader> cache_;
  std::vector<SplatGeometry> geometry_;  // [brick], as CacheReader reads them
  std::vector<SplatVariable> values_;
  std::vector<uint32_t> order_;
  uint64_t decoded_bytes_ = 0;
};

TEST_F(BrickSourceTest, GivesWhatTheReaderReadsColdAndWarmWithAnyCache) {
  std::mt19937 random(1);
  const uint64_t room = decoded_bytes_ + (1 << 20);
  for (const uint64_t cache_bytes : {uint64_t{0}, room / 3, room}) {
    BrickSource source(*cache_, 0, pagerOptions(), cache_bytes);
    std::vector<uint32_t> order = order_;
    for (int round = 0; round < 4; ++round) {
      FetchStatistics statistics;
      EXPECT_EQ(takeAll(source, order, 1 + static_cast<unsigned>(round), statistics), order.size());
      EXPECT_EQ(statistics.bricks_cached + statistics.bricks_read, order.size());
      EXPECT_LE(statistics.cache_peak_bytes, cache_bytes);
      if (round == 0 || cache_bytes == 0) {
        EXPECT_EQ(statistics.bricks_cached, 0u);
        EXPECT_GT(statistics.bytes_read, 0u);
      } else if (cache_bytes == room) {
        EXPECT_EQ(statistics.bricks_cached, order.size());
        EXPECT_EQ(statistics.bytes_read, 0u);
        EXPECT_EQ(statistics.read_requests, 0u);
      } else {
        EXPECT_GT(statistics.bricks_cached, 0u);
        EXPECT_GT(statistics.bricks_read, 0u);
      }
      std::shuffle(order.begin(), order.end(), random);
    }
  }
}

TEST_F(BrickSourceTest, APartHasTheSplatsOfItsOctants) {
  BrickSource source(*cache_, 0, pagerOptions(), decoded_bytes_);
  const uint32_t inner = 3;
  ASSERT_FALSE(cache_->bricks()[inner].isLeaf());
  BrickSource::Scratch scratch;
  uint32_t splats = 0;
  for (const uint8_t octants : {0x0f, 0xf0}) {
    source.start(std::vector<BrickPart>{{inner, octants}});
    splats += source.fetch(0, scratch)->ranges.splats();
  }
  EXPECT_EQ(splats, cache_->bricks()[inner].splats);
}

TEST_F(BrickSourceTest, PrefetchingFillsTheCache) {
  BrickSource source(*cache_, 0, pagerOptions(), decoded_bytes_ + (1 << 20));
  source.startPrefetch(partsOf(order_));
  BrickSource::Scratch scratch;
  while (source.prefetchNext(scratch)) {
  }
  FetchStatistics statistics;
  EXPECT_EQ(takeAll(source, order_, 2, statistics), order_.size());
  EXPECT_EQ(statistics.bricks_cached, order_.size());

  // What does not fit is left to the frame, and a prefetch can be broken off.
  BrickSource little(*cache_, 0, pagerOptions(), decoded_bytes_ / 4);
  little.startPrefetch(partsOf(order_));
  EXPECT_TRUE(little.prefetchNext(scratch));
  little.stop();
  EXPECT_FALSE(little.prefetchNext(scratch));
  EXPECT_EQ(takeAll(little, order_, 2, statistics), order_.size());
  EXPECT_GT(statistics.bricks_cached, 0u);
}

TEST_F(BrickSourceTest, AFailingDiskSurfacesOnceAndNamesABrick) {
  for (const int64_t at : {0, 2, 5}) {
    FaultySystemCalls faulty;
    const ScopedSystemCalls scope(faulty);
    BrickSource source(*cache_, 0, pagerOptions(), 0);
    faulty.fail_read_at = at;
    faulty.error = EIO;
    FetchStatistics statistics;
    expectError([&] { takeAll(source, order_, 3, statistics); }, {"brick ", "Input/output error"});
    faulty.fail_read_at = -1;
    EXPECT_EQ(takeAll(source, order_, 3, statistics), order_.size());
  }
}

TEST_F(BrickSourceTest, AReadThatFailsOnceIsTriedAgain) {
  FaultySystemCalls faulty;
  const ScopedSystemCalls scope(faulty);
  BrickSource source(*cache_, 0, pagerOptions(), 0);
  faulty.fail_only_read_at = 3;
  faulty.error = EIO;
  FetchStatistics statistics;
  EXPECT_EQ(takeAll(source, order_, 3, statistics), order_.size());
}

TEST_F(BrickSourceTest, AReadThatGivesWrongBytesOnceIsTriedAgain) {
  for (const uint64_t cache_bytes : {uint64_t{0}, decoded_bytes_}) {
    FaultySystemCalls faulty;
    const ScopedSystemCalls scope(faulty);
    BrickSource source(*cache_, 0, pagerOptions(), cache_bytes);
    faulty.wrong_only_read_at = 3;
    FetchStatistics statistics;
    EXPECT_EQ(takeAll(source, order_, 3, statistics), order_.size());
    EXPECT_GT(faulty.reads, 3);
  }
}

TEST_F(BrickSourceTest, DamageIsFoundAndReplacedByAnAncestor) {
  const auto bricks = cache_->bricks();
  // A leaf in the middle, one of a cell's two bricks, and an inner brick.
  uint32_t leaf = kNoBrick, twin = kNoBrick;
  for (uint32_t brick = 0; brick + 1 < bricks.size(); ++brick) {
    if (!bricks[brick].isLeaf()) continue;
    if (bricks[brick].cell == bricks[brick + 1].cell)
      twin = brick;
    else if (twin != kNoBrick && twin + 2 < brick && leaf == kNoBrick)
      leaf = brick;
  }
  ASSERT_NE(leaf, kNoBrick);
  for (const uint32_t damaged : {leaf, twin, bricks[leaf].parent}) {
    const bool inner = damaged == bricks[leaf].parent;
    overwrite(inner ? cache_->valuesPath(0) : cache_->geometryPath(),
              inner ? cache_->brickVariables(0)[damaged].values.offset : bricks[damaged].geometry.offset);
    BrickSource source(*cache_, 0, pagerOptions(), decoded_bytes_);
    FetchStatistics statistics;
    expectError([&] { takeAll(source, {damaged}, 1, statistics); },
                {"brick " + std::to_string(damaged) + " "});
    EXPECT_EQ(source.cached().statistics().bricks, 0u);

    BrickSource::Scratch scratch;
    const auto stand_in = source.standIn({damaged, kAllOctants}, scratch);
    // The parent of a leaf is whole at first; when it is not, the root stands in.
    const Brick& parent = bricks[bricks[damaged].parent];
    EXPECT_EQ(stand_in.cell, parent.cell);
    const int octant = bricks[damaged].cell.octantInParent();
    EXPECT_EQ(stand_in.geometry.size(), parent.octant_splats[static_cast<size_t>(octant)]);
    double weight = 0, expected = 0;
    const uint32_t id = bricks[damaged].parent;
    const double half = cache_->manifest().root.cellSize(parent.cell.level + 1);
    for (size_t n = 0; n < geometry_[id].size(); ++n) {
      const int at = (geometry_[id].x[n] >= half) | (geometry_[id].y[n] >= half) << 1 |
                     (geometry_[id].z[n] >= half) << 2;
      if (at == octant) expected += geometry_[id].weight[n];
    }
    for (size_t n = 0; n < stand_in.geometry.size(); ++n) weight += stand_in.geometry.weight[n];
    if (damaged == twin)
      expected *= double(bricks[twin].splats) / (bricks[twin].splats + bricks[twin + 1].splats);
    EXPECT_NEAR(weight, expected, 1e-5 * expected);
  }

  // The leaf and its parent are damaged now: the root stands in, where the leaf is and nowhere else.
  BrickSource source(*cache_, 0, pagerOptions(), 0);
  BrickSource::Scratch scratch;
  const auto stand_in = source.standIn({leaf, kAllOctants}, scratch);
  EXPECT_EQ(stand_in.cell, Cell{});
  const RootCube& root = cache_->manifest().root;
  const glm::dvec3 lower = root.cellMin(bricks[leaf].cell) - root.min;
  const double size = root.cellSize(bricks[leaf].cell.level);
  const auto inside = [&](float x, float y, float z) {
    return x >= lower.x && x < lower.x + size && y >= lower.y && y < lower.y + size && z >= lower.z &&
           z < lower.z + size;
  };
  size_t expected = 0;
  for (size_t n = 0; n < geometry_[0].size(); ++n)
    expected += inside(geometry_[0].x[n], geometry_[0].y[n], geometry_[0].z[n]);
  EXPECT_GT(expected, 0u);
  EXPECT_EQ(stand_in.geometry.size(), expected);
  for (size_t n = 0; n < stand_in.geometry.size(); ++n)
    EXPECT_TRUE(inside(stand_in.geometry.x[n], stand_in.geometry.y[n], stand_in.geometry.z[n]));

  // Parts of the leaf's parent, which is damaged as well, are stood in for by what the root has there.
  const uint32_t parent = bricks[leaf].parent;
  const uint32_t whole = source.standIn({parent, kAllOctants}, scratch).ranges.splats();
  uint32_t parts = 0;
  for (const int octants : {0x01, 0x16, 0xe8}) {
    const auto part = source.standIn({parent, static_cast<uint8_t>(octants)}, scratch);
    for (size_t n = 0; n < part.geometry.size(); ++n) {
      const glm::dvec3 at(part.geometry.x[n], part.geometry.y[n], part.geometry.z[n]);
      const glm::dvec3 in_cell = at - (root.cellMin(bricks[parent].cell) - root.min);
      const int octant = (in_cell.x >= size) | (in_cell.y >= size) << 1 | (in_cell.z >= size) << 2;
      EXPECT_TRUE(octants >> octant & 1) << octant;
    }
    parts += part.ranges.splats();
  }
  EXPECT_EQ(parts, whole);
  EXPECT_EQ(whole,
            cache_->bricks()[0].octant_splats[static_cast<size_t>(bricks[parent].cell.octantInParent())]);

  // Without the root there is nothing left.
  overwrite(cache_->geometryPath(), bricks[0].geometry.offset);
  EXPECT_EQ(source.standIn({leaf, kAllOctants}, scratch).ranges.splats(), 0u);
  EXPECT_EQ(source.standIn({0, kAllOctants}, scratch).ranges.splats(), 0u);
}

TEST_F(BrickSourceTest, CanBeStoppedAtAnyMoment) {
  std::mt19937 random(11);
  BrickSource source(*cache_, 0, pagerOptions(), decoded_bytes_ / 3);
  for (int round = 0; round < 1000; ++round) {
    std::vector<uint32_t> order = order_;
    std::shuffle(order.begin(), order.end(), random);
    order.resize(1 + random() % order.size());
    source.start(partsOf(order));
    // Some worker stops all when it comes to this brick; others may be anywhere.
    const size_t stop_at = random() % order.size();
    std::atomic<size_t> next = 0, wrong = 0;
    const auto work = [&] {
      BrickSource::Scratch scratch;
      for (size_t n; (n = next++) < order.size();) {
        if (n == stop_at) source.stop();
        const auto splats = source.fetch(n, scratch);
        if (!splats) return;
        wrong += splats->geometry.size() != geometry_[order[n]].size();
      }
    };
    std::thread other(work);
    work();
    other.join();
    FetchStatistics statistics;
    source.finish(statistics);
    ASSERT_EQ(wrong, 0u);
  }
  FetchStatistics statistics;
  EXPECT_EQ(takeAll(source, order_, 2, statistics), order_.size());
}

TEST_F(BrickSourceTest, PassesOverWhatIsNotNeeded) {
  const std::vector<BrickPart> parts = partsOf(order_);
  for (const uint64_t cache_bytes : {uint64_t{0}, 2 * decoded_bytes_}) {
    BrickSource source(*cache_, 0, pagerOptions(), cache_bytes);
    BrickSource::Scratch scratch;
    for (int frame = 0; frame < 4; ++frame) {
      FetchStatistics statistics;
      source.start(parts, [](uint32_t brick) { return brick % 4 == 3; });
      for (uint64_t n = 0; n < parts.size(); ++n) {
        const uint32_t brick = parts[n].brick;
        const bool unneeded = brick % 4 == 3;
        if (unneeded && (n + static_cast<uint64_t>(frame)) % 2 == 0) {
          source.pass(n);
          continue;
        }
        const auto splats = source.fetch(n, scratch);
        ASSERT_TRUE(splats);
        if (splats->geometry.size() == 0) {
          EXPECT_TRUE(unneeded);
          EXPECT_EQ(splats->ranges.splats(), 0u);
        } else {
          EXPECT_TRUE(same(geometry_[brick], splats->geometry)) << brick;
          EXPECT_TRUE(same(values_[brick], splats->values)) << brick;
        }
      }
      source.finish(statistics);
      EXPECT_GT(statistics.bricks_left_out, 0u);
      EXPECT_EQ(statistics.bricks_read == 0, cache_bytes > 0 && frame > 0);
    }
  }
}

}  // namespace
}  // namespace curvisplat
