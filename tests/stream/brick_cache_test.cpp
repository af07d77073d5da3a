// Decoded bricks in memory: what is kept, evicted and pinned. Then io_uring where the kernel refuses a part
// of it: each case is a process of its own, whose system calls a filter (seccomp) lets fail.
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <functional>
#include <initializer_list>
#include <map>
#include <random>
#include <thread>
#include <vector>

#include "stream/base/error.h"
#include "stream/paging/async_reads.h"
#include "stream/paging/brick_cache.h"
#include "tests/support/memory_limit.h"

namespace curvisplat {
namespace {

/// Fills all arrays of a brick with numbers of its own.
void fill(const BrickCache::Slot& slot, uint32_t brick) {
  const auto& g = slot.geometry();
  const auto& v = slot.values();
  float number = static_cast<float>(brick) * 100;
  for (float* array : {g.x, g.y, g.z, g.axis0, g.axis1, g.axis2, g.shear10, g.shear20, g.shear21, g.weight,
                       v.mean, v.slope0, v.slope1, v.slope2, v.variance})
    std::fill_n(array, g.size(), number++);
}

testing::AssertionResult holds(const BrickCache::Pin& pin, uint32_t brick, size_t splats) {
  const auto g = pin.geometry();
  const auto v = pin.values();
  if (g.size() != splats || v.size() != splats) return testing::AssertionFailure() << g.size() << " splats";
  float number = static_cast<float>(brick) * 100;
  for (const float* array : {g.x, g.y, g.z, g.axis0, g.axis1, g.axis2, g.shear10, g.shear20, g.shear21,
                             g.weight, v.mean, v.slope0, v.slope1, v.slope2, v.variance}) {
    for (size_t n = 0; n < splats; ++n)
      if (array[n] != number)
        return testing::AssertionFailure() << array[n] << " where " << number << " was put";
    ++number;
  }
  return testing::AssertionSuccess();
}

/// Puts a brick in, and lets go of it.
bool put(BrickCache& cache, uint32_t brick, uint32_t splats) {
  auto slot = cache.makeSlot(brick, splats);
  if (!slot) return false;
  fill(*slot, brick);
  std::move(*slot).keep();
  return true;
}

TEST(BrickCache, GivesBackWhatWasPutIn) {
  BrickCache cache(1 << 20);
  cache.beginEpoch({});
  EXPECT_FALSE(cache.find(7));
  {
    auto slot = cache.makeSlot(7, 100);
    ASSERT_TRUE(slot);
    EXPECT_FALSE(cache.find(7)) << "it is not filled yet";
    EXPECT_FALSE(cache.makeSlot(7, 100)) << "it is being made";
    fill(*slot, 7);
    const auto pin = std::move(*slot).keep();
    EXPECT_TRUE(holds(pin, 7, 100));
  }
  const auto pin = cache.find(7);
  ASSERT_TRUE(pin);
  EXPECT_TRUE(holds(*pin, 7, 100));
  EXPECT_FALSE(cache.makeSlot(7, 100)) << "it is there";
  EXPECT_EQ(cache.statistics().hits, 1u);
  EXPECT_EQ(cache.statistics().misses, 2u);
}

TEST(BrickCache, ChargesEveryArray) {
  EXPECT_EQ(BrickCache::charge(16), 17u * 64);
  EXPECT_EQ(BrickCache::charge(17), 17u * 128);
  BrickCache cache(4 * BrickCache::charge(100));
  cache.beginEpoch({});
  for (uint32_t brick = 0; brick < 4; ++brick) EXPECT_TRUE(put(cache, brick, 100));
  EXPECT_EQ(cache.statistics().bytes, 4 * BrickCache::charge(100));
  EXPECT_FALSE(put(cache, 4, 1)) << "all is of this turn";
  EXPECT_EQ(cache.statistics().bricks, 4u);
  EXPECT_EQ(cache.statistics().evictions, 0u);
}

TEST(BrickCache, SpaceThatIsNotKeptIsFreeAgain) {
  BrickCache cache(BrickCache::charge(100));
  cache.beginEpoch({});
  for (int n = 0; n < 3; ++n) EXPECT_TRUE(cache.makeSlot(1, 100));
  EXPECT_FALSE(cache.find(1));
  EXPECT_EQ(cache.statistics().bytes, 0u);
  EXPECT_TRUE(put(cache, 2, 100));
}

TEST(BrickCache, EvictsTheLeastRecentlyUsed) {
  BrickCache cache(3 * BrickCache::charge(100));
  cache.beginEpoch({});
  for (const uint32_t brick : {1u, 2u, 3u}) put(cache, brick, 100);
  cache.beginEpoch({});
  cache.find(1);
  cache.beginEpoch({});
  EXPECT_TRUE(put(cache, 4, 100));
  EXPECT_FALSE(cache.contains(2));
  EXPECT_TRUE(put(cache, 5, 100));
  EXPECT_FALSE(cache.contains(3));
  EXPECT_TRUE(cache.contains(1)) << "was used after them";
  EXPECT_EQ(cache.statistics().evictions, 2u);
}

TEST(BrickCache, KeepsWhatIsPinned) {
  BrickCache cache(2 * BrickCache::charge(100));
  cache.beginEpoch({});
  put(cache, 1, 100);
  put(cache, 2, 100);
  const auto pin = cache.find(1);
  const auto again = cache.find(1);
  cache.beginEpoch({});
  EXPECT_TRUE(put(cache, 3, 100)) << "in the place of 2";
  cache.beginEpoch({});
  EXPECT_TRUE(put(cache, 4, 100)) << "in the place of 3";
  EXPECT_FALSE(put(cache, 5, 100));
  EXPECT_TRUE(holds(*pin, 1, 100));
  EXPECT_TRUE(holds(*again, 1, 100));
}

TEST(BrickCache, KeepsBricksOfTheCurrentEpoch) {
  BrickCache cache(2 * BrickCache::charge(100));
  cache.beginEpoch({});
  put(cache, 1, 100);
  put(cache, 2, 100);
  // A scan over four bricks, again and again: half of them are hits, where plain LRU would have none.
  for (int turn = 0; turn < 5; ++turn) {
    cache.beginEpoch({1, 2, 3, 4});
    int hits = 0;
    for (uint32_t brick = 1; brick <= 4; ++brick) {
      hits += cache.find(brick).has_value();
      put(cache, brick, 100);
    }
    EXPECT_EQ(hits, 2);
  }
}

TEST(BrickCache, HoldsNothingWithoutCapacity) {
  BrickCache cache(0);
  cache.beginEpoch({});
  EXPECT_FALSE(put(cache, 1, 1));
}

TEST(BrickCache, SurvivesRandomUse) {
  constexpr uint64_t kCapacity = 300'000;
  std::mt19937 random(3);
  BrickCache cache(kCapacity);
  std::vector<std::pair<uint32_t, BrickCache::Pin>> pins;
  const auto splatsOf = [](uint32_t brick) { return 1 + brick * 37 % 900; };
  for (int step = 0; step < 20'000; ++step) {
    const uint32_t brick = static_cast<uint32_t>(random() % 60);
    if (random() % 50 == 0) {
      cache.beginEpoch({brick, brick + 1});
    } else if (random() % 3 == 0 && !pins.empty()) {
      const size_t n = random() % pins.size();
      ASSERT_TRUE(holds(pins[n].second, pins[n].first, splatsOf(pins[n].first)));
      pins.erase(pins.begin() + static_cast<ptrdiff_t>(n));
    } else if (auto pin = cache.find(brick)) {
      ASSERT_TRUE(holds(*pin, brick, splatsOf(brick)));
      if (pins.size() < 10) pins.emplace_back(brick, std::move(*pin));
    } else {
      put(cache, brick, splatsOf(brick));
    }
    ASSERT_LE(cache.statistics().bytes, kCapacity);
  }
  EXPECT_GT(cache.statistics().hits, 1000u);
  EXPECT_GT(cache.statistics().evictions, 100u);
}

TEST(Arena, BlocksDoNotOverlapAndHolesMerge) {
  constexpr uint64_t kCapacity = 1 << 16;
  Arena arena(kCapacity);
  std::mt19937 random(5);
  std::map<std::byte*, uint64_t> blocks;
  std::byte* const whole = arena.allocate(kCapacity);
  ASSERT_TRUE(whole);
  EXPECT_FALSE(arena.allocate(1));
  arena.free(whole, kCapacity);
  for (int step = 0; step < 20'000; ++step) {
    if (random() % 2 == 0 || blocks.empty()) {
      const uint64_t bytes = 1 + random() % 5000;
      std::byte* block = arena.allocate(bytes);
      if (!block) continue;
      ASSERT_EQ(reinterpret_cast<uintptr_t>(block) % Arena::kBlockAlignment, 0u);
      const auto after = blocks.lower_bound(block);
      if (after != blocks.end()) {
        ASSERT_LE(block + bytes, after->first);
      }
      if (after != blocks.begin()) {
        ASSERT_LE(std::prev(after)->first + std::prev(after)->second, block);
      }
      ASSERT_GE(block, whole);
      ASSERT_LE(block + bytes, whole + kCapacity);
      blocks.emplace(block, bytes);
    } else {
      const auto it = std::next(blocks.begin(), static_cast<ptrdiff_t>(random() % blocks.size()));
      arena.free(it->first, it->second);
      blocks.erase(it);
    }
  }
  for (const auto& [block, bytes] : blocks) arena.free(block, bytes);
  EXPECT_EQ(arena.allocate(kCapacity), whole);
}

constexpr unsigned kHangSeconds = 30;
enum Ending : int { kGood = 10, kBad, kNoFilter };

/// Lets these calls of this thread, and of those that it starts, fail. Returns false where that is forbidden.
bool refuse(std::initializer_list<long> calls, int error) {
  std::vector<sock_filter> filter{BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr))};
  for (const long call : calls) {
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<unsigned>(call), 0, 1));
    filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | static_cast<unsigned>(error)));
  }
  filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

/// The result of `run` in a process of its own; the negative signal if that kills it, as after a hang.
int inProcess(const std::function<int()>& run) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(kHangSeconds);
    ::_exit(run());
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

class UringReads : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!makeUringReads(4)) GTEST_SKIP() << "this kernel, or this container, refuses io_uring";
    if (inProcess([] { return refuse({SYS_acct}, EPERM) ? kGood : kNoFilter; }) == kNoFilter)
      GTEST_SKIP() << "this container refuses filters of system calls";
  }
};

TEST_F(UringReads, AreNotUsedWhereReadsCannotBeSubmitted) {
  const auto run = []() -> int {
    if (!refuse({SYS_io_uring_enter}, EPERM)) return kNoFilter;
    return makeUringReads(4) ? kBad : kGood;
  };
  EXPECT_EQ(inProcess(run), kGood);
}

TEST_F(UringReads, AreNotUsedUnderValgrind) {
  const auto run = []() -> int {
    ::setenv("LD_PRELOAD", "/usr/libexec/valgrind/vgpreload_core-amd64-linux.so", 1);
    return makeUringReads(4) ? kBad : kGood;
  };
  EXPECT_EQ(inProcess(run), kGood);
}

TEST_F(UringReads, EndWithAnErrorIfTheirThreadCannotBeWoken) {
  if (kHasThreadSanitizer) GTEST_SKIP() << "the forked process starts a thread";
  const auto run = []() -> int {
    const auto reads = makeUringReads(4);
    // Not write: sanitizers need it for themselves.
    if (!reads || !refuse({SYS_sendto, SYS_sendmsg}, EIO)) return kNoFilter;
    std::thread waking([&] { reads->wake(); });
    int ending = kBad;
    try {
      reads->wait();
    } catch (const Error&) {
      ending = kGood;
    }
    waking.join();
    return ending;
  };
  EXPECT_EQ(inProcess(run), kGood);
}

TEST_F(UringReads, WakeOnceForAnyNumberOfCalls) {
  const auto reads = makeUringReads(4);
  for (int n = 0; n < 100'000; ++n) reads->wake();  // more than the socket's buffer takes
  EXPECT_FALSE(reads->wait().has_value());
  std::thread waking([&] { reads->wake(); });
  EXPECT_FALSE(reads->wait().has_value());
  waking.join();
}

}  // namespace
}  // namespace curvisplat
