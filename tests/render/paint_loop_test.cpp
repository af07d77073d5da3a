#include "render/project/paint_loop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

namespace curvisplat {
namespace {

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

}  // namespace
}  // namespace curvisplat
