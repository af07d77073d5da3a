#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <new>
#include <semaphore>
#include <thread>
#include <utility>
#include <vector>

#include "stream/base/compute_permits.h"
#include "stream/base/memory.h"
#include "stream/base/threads.h"
#include "tests/support/memory_limit.h"

namespace curvisplat {
namespace {

TEST(ComputePermits, AreHeldByNoMoreThreadsThanThereAre) {
  constexpr int kPermits = 3, kThreads = 8, kTimes = 2000;
  ComputePermits permits(kPermits);
  std::atomic<int> now = 0, most = 0, done = 0;
  const auto compute = [&] {
    const int those = ++now;
    int before = most;
    while (before < those && !most.compare_exchange_weak(before, those)) {
    }
    std::this_thread::yield();
    --now;
  };
  std::vector<std::thread> threads;
  for (int n = 0; n < kThreads; ++n)
    threads.emplace_back([&, n] {
      for (int time = 0; time < kTimes; ++time) {
        const Computing computing(&permits, n % 2 == 0 ? Urgency::kUrgent : Urgency::kNormal);
        compute();
        Computing::giveWay();
        compute();
        double waited_s = 0;
        { const WaitTimer waiting(waited_s, "wait for nothing"); }
        compute();
        ++done;
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(done, kThreads * kTimes);
  EXPECT_LE(most, kPermits);
  EXPECT_EQ(now, 0);
}

TEST(ComputePermits, AreLeftToAnUrgentThreadFirst) {
  for (int time = 0; time < 200; ++time) {
    ComputePermits permits(1);
    std::atomic<int> order = 0, normal = 0, urgent = 0;
    std::thread of_normal, of_urgent;
    {
      const Computing computing(&permits);
      of_normal = std::thread([&] {
        const Computing waited(&permits);
        normal = ++order;
      });
      of_urgent = std::thread([&] {
        const Computing waited(&permits, Urgency::kUrgent);
        urgent = ++order;
      });
      while (urgent == 0) Computing::giveWay();  // this thread waits, and is as urgent as `normal`
    }
    of_normal.join();
    of_urgent.join();
    EXPECT_EQ(urgent, 1);
    EXPECT_EQ(normal, 2);
  }
}

TEST(ComputePermits, AreAnothersWhileTheirThreadWaits) {
  ComputePermits permits(1);
  std::binary_semaphore computed(0);
  const Computing computing(&permits);
  std::thread other([&] {
    const Computing of_other(&permits);
    computed.release();
  });
  double waited_s = 0;
  {
    const WaitTimer waiting(waited_s, "wait for the other");
    computed.acquire();
  }
  other.join();
}

TEST(ComputePermits, AreNotWaitedForByAThreadThatNeedsNoneAnyMore) {
  ComputePermits permits(1);
  const Computing computing(&permits);
  std::atomic<bool> asked = false, unneeded = false;
  std::thread other([&] {
    const Computing in_vain(&permits, Urgency::kUrgent, [&] {
      asked = true;
      return unneeded.load();
    });
    EXPECT_FALSE(in_vain.granted());
  });
  while (!asked) std::this_thread::yield();
  unneeded = true;
  permits.recheck();
  other.join();
}

TEST(ComputePermits, AreHeldByThreadsThatTakePartInALoop) {
  ComputePermits permits(1);
  const auto ofThread = [] { return Computing::ofThisThread(); };
  const auto inAnotherThread = [](const auto& work) {
    ComputePermits* held = nullptr;
    const GivenBackPermit given_back;
    std::thread([&] { held = work(); }).join();
    return held;
  };
  EXPECT_EQ(inAnotherThread(withPermit(ofThread)), nullptr);
  const Computing computing(&permits);
  EXPECT_EQ(withPermit(ofThread)(), &permits);
  EXPECT_EQ(inAnotherThread(withPermit(ofThread)), &permits);
  EXPECT_EQ(inAnotherThread(ofThread), nullptr);
}

TEST(ComputePermits, AreLeftToUrgentThreadsBetweenCallsOfALoop) {
  ComputePermits permits(1);
  const Computing computing(&permits);
  std::atomic<bool> read = false;
  std::thread reader([&] {
    const Computing urgent(&permits, Urgency::kUrgent);
    read = true;
  });
  while (!permits.isWantedUrgently()) std::this_thread::yield();
  withPermit([&] { EXPECT_TRUE(read); })();
  reader.join();
}

TEST(ComputePermits, OfAThreadThatHoldsOneAreEnough) {
  ComputePermits permits(1), of_others(1);
  const Computing computing(&permits);
  {
    const Computing again(&permits, Urgency::kUrgent), another(&of_others);
    EXPECT_TRUE(again.granted());
  }
  const Computing without(nullptr);
  EXPECT_TRUE(without.granted());
}

struct Counted {
  Counted() { ++alive; }
  ~Counted() { --alive; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;

  static inline std::atomic<int> alive = 0;
};

TEST(PerThread, EachThreadHasAnObjectUntilItEnds) {
  static const PerThread<Counted> objects;
  const Counted* const here = &objects.own();
  EXPECT_EQ(here, &objects.own());
  std::thread([&] {
    const Counted* const there = &objects.own();
    EXPECT_NE(there, here);
    EXPECT_EQ(there, &objects.own());
    EXPECT_EQ(Counted::alive, 2);
  }).join();
  EXPECT_EQ(Counted::alive, 1);
}

struct FailsOnce {
  FailsOnce() {
    if (std::exchange(fails, false)) throw std::bad_alloc();
  }

  static inline bool fails = true;
};

TEST(PerThread, LackOfMemoryIsThrownAndCanBeTriedAgain) {
  static const PerThread<FailsOnce> objects;
  EXPECT_THROW(objects.own(), std::bad_alloc);
  EXPECT_EQ(&objects.own(), &objects.own());
}

using test::mappedBytes;

/// Whether requireSpareMemory() throws where the process may map `spare_bytes` more, tried in a process of its own.
bool isRefusedWith(uint64_t spare_bytes) {
  const pid_t child = ::fork();
  if (child == 0) {
    const test::MemoryLimit limit(spare_bytes);
    try {
      requireSpareMemory();
    } catch (const std::bad_alloc&) {
      ::_exit(1);
    }
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status)) << status;
  return WEXITSTATUS(status) == 1;
}

TEST(SpareMemory, IsRequiredWithinALimitOfAddressSpace) {
  EXPECT_TRUE(isRefusedWith(uint64_t{16} << 20));
  EXPECT_FALSE(isRefusedWith(uint64_t{64} << 20));
}

TEST(SpareMemory, IsGivenBack) {
  const uint64_t before = mappedBytes();
  for (int n = 0; n < 10; ++n) requireSpareMemory();
  EXPECT_LT(mappedBytes(), before + (uint64_t{32} << 20));
}

}  // namespace
}  // namespace curvisplat
