#include "render/frame/segment_ring.h"

#include <gtest/gtest.h>

#include <atomic>
#include <random>
#include <thread>
#include <vector>

namespace curvisplat {
namespace {

ScreenSplat numbered(size_t number) {
  ScreenSplat splat{};
  splat.x = static_cast<float>(number);
  return splat;
}

TEST(SegmentRing, HandsOverEverythingInSequence) {
  constexpr size_t kSegments = 3000, kCapacity = 100;
  for (const int workers : {1, 2, 5}) {
    std::mt19937 random(4);
    std::vector<size_t> counts(kSegments);
    for (size_t& count : counts) count = random() % 7 == 0 ? 0 : random() % (kCapacity + 1);
    std::vector<ScreenSplat> memory(kCapacity);
    SegmentRing ring(memory);
    std::atomic<size_t> next = 0;
    std::vector<std::thread> threads;
    for (int n = 0; n < workers; ++n)
      threads.emplace_back([&] {
        for (size_t sequence; (sequence = next++) < kSegments;) {
          const auto segment = ring.acquire(sequence, counts[sequence]);
          ASSERT_TRUE(segment);
          ASSERT_EQ(segment->size(), counts[sequence]);
          for (ScreenSplat& splat : *segment) splat = numbered(sequence);
          ring.commit(sequence);
        }
      });
    for (size_t sequence = 0; sequence < kSegments; ++sequence) {
      const auto segment = ring.next();
      ASSERT_TRUE(segment);
      ASSERT_EQ(segment->size(), counts[sequence]);
      for (const ScreenSplat& splat : *segment) ASSERT_EQ(splat.x, static_cast<float>(sequence));
      ring.release();
    }
    for (auto& thread : threads) thread.join();
  }
}

TEST(SegmentRing, KeepsWhatIsHandedOutUntilItIsReleased) {
  std::vector<ScreenSplat> memory(10);
  SegmentRing ring(memory);
  const auto fill = [&](uint64_t sequence, size_t count) {
    const auto segment = ring.acquire(sequence, count);
    ASSERT_TRUE(segment);
    for (ScreenSplat& splat : *segment) splat = numbered(sequence);
    ring.commit(sequence);
  };
  EXPECT_FALSE(ring.nextIfReady());
  fill(0, 4);
  fill(1, 4);
  const auto first = ring.nextIfReady();
  const auto second = ring.nextIfReady();
  ASSERT_TRUE(first && second);
  EXPECT_FALSE(ring.nextIfReady());
  fill(2, 2);
  std::thread worker([&] { fill(3, 4); });  // waits for the first's place
  const auto third = ring.nextIfReady();
  ASSERT_TRUE(third);
  for (size_t n = 0; n < 4; ++n) {
    EXPECT_EQ((*first)[n].x, 0);
    EXPECT_EQ((*second)[n].x, 1);
  }
  ring.release();
  const auto fourth = ring.next();
  ASSERT_TRUE(fourth);
  EXPECT_EQ(fourth->data(), first->data());
  EXPECT_EQ((*fourth)[0].x, 3);
  EXPECT_EQ((*second)[0].x, 1);
  worker.join();
}

TEST(SegmentRing, PausesWhereItIsTold) {
  std::vector<ScreenSplat> memory(10);
  SegmentRing ring(memory);
  const auto fill = [&](uint64_t sequence) {
    ASSERT_TRUE(ring.acquire(sequence, 4));
    ring.commit(sequence);
  };
  fill(0);
  std::thread painter([&] {
    EXPECT_TRUE(ring.next());
    ring.release();
    EXPECT_TRUE(ring.next());
    ring.release();
    EXPECT_FALSE(ring.next());
    EXPECT_FALSE(ring.isClosed());
  });
  fill(1);
  ring.pauseAfter(2);
  ring.pauseAfter(2);
  painter.join();
  ring.resume();
  fill(2);
  EXPECT_TRUE(ring.next());
}

TEST(SegmentRing, ClosingWakesAllWhoWait) {
  std::vector<ScreenSplat> memory(10);
  SegmentRing ring(memory);
  ASSERT_TRUE(ring.acquire(0, 10));
  std::thread full([&] { EXPECT_FALSE(ring.acquire(1, 1)); });
  std::thread early([&] { EXPECT_FALSE(ring.acquire(7, 1)); });
  std::thread painter([&] { EXPECT_FALSE(ring.next()); });
  ring.close();
  full.join();
  early.join();
  painter.join();
  ring.commit(0);
  EXPECT_FALSE(ring.next());
}

}  // namespace
}  // namespace curvisplat
