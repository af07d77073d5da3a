// Bricks that are read from files by each way of reading; also where asynchronous reads end as io_uring may
// let them end, and hardly ever does (FaultyAsyncReads).
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <filesystem>
#include <functional>
#include <memory>
#include <numeric>
#include <random>
#include <thread>
#include <vector>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_format.h"
#include "stream/paging/async_reads.h"
#include "stream/paging/pager.h"
#include "tests/support/expect_error.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat::faults {
namespace {

/// Does reads by others, and passes their ends through `change`.
class FaultyAsyncReads : public AsyncReads {
 public:
  /// Gets the number of the end (from 0) and its result; returns what is to be said instead.
  using Change = std::function<int64_t(uint64_t number, int64_t result)>;

  FaultyAsyncReads(std::unique_ptr<AsyncReads> reads, Change change)
      : reads_(std::move(reads)), change_(std::move(change)) {}

  const char* name() const override { return reads_->name(); }
  void submit(const AsyncRead& read) override { reads_->submit(read); }
  std::optional<AsyncReadEnd> wait() override {
    std::optional<AsyncReadEnd> end = reads_->wait();
    if (end) end->result = change_(number_++, end->result);
    return end;
  }
  void wake() override { reads_->wake(); }

 private:
  const std::unique_ptr<AsyncReads> reads_;
  const Change change_;
  uint64_t number_ = 0;
};

}  // namespace
}  // namespace curvisplat::faults

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::FaultyAsyncReads;
using faults::FaultySystemCalls;
using Way = PagerOptions::Way;

bool uringWorks() {
  return makeUringReads(4) != nullptr;
}

PagerOptions optionsOf(Way way, bool direct, uint64_t buffer_bytes) {
  PagerOptions options;
  options.way = way;
  options.direct = direct;
  options.buffer_bytes = buffer_bytes;
  return options;
}

class PagerTest : public ::testing::Test {
 protected:
  PagerTest() {
    writeRandomCache(folder_ / "a.splats");
    cache_ = std::make_unique<CacheReader>(folder_ / "a.splats");
  }

  uint32_t bricks() const { return static_cast<uint32_t>(cache_->bricks().size()); }
  std::vector<uint32_t> inOrder() const {
    std::vector<uint32_t> order(bricks());
    std::iota(order.begin(), order.end(), 0u);
    return order;
  }

  /// Whether these are the bytes of the brick: the index has their checksums.
  static bool areOf(const CacheReader& cache, uint32_t brick, const PagedBrick& bytes) {
    return bytes.readable() && checksumOf(bytes.geometry()) == cache.bricks()[brick].geometry.checksum &&
           checksumOf(bytes.values()) == cache.brickVariables(0)[brick].values.checksum;
  }

  /// Takes all of `order` on some threads, and counts the bricks that came as they are.
  static size_t takeAll(BrickPager& pager, const CacheReader& cache, const std::vector<uint32_t>& order,
                        unsigned threads) {
    pager.start(order);
    std::atomic<size_t> next = 0, good = 0;
    const auto work = [&] {
      for (size_t n; (n = next++) < order.size();) {
        const auto bytes = pager.fetch(n);
        good += bytes && areOf(cache, order[n], *bytes);
      }
    };
    std::vector<std::thread> team;
    for (unsigned n = 1; n < threads; ++n) team.emplace_back(work);
    work();
    for (std::thread& thread : team) thread.join();
    return good;
  }

  TemporaryFolder folder_;
  std::unique_ptr<CacheReader> cache_;
};

TEST_F(PagerTest, BatchesBringEveryStreamOnce) {
  std::mt19937_64 random(1);
  for (int round = 0; round < 200; ++round) {
    // Streams in file order, some touching, some far apart; asked for in any order.
    std::vector<BrickExtents> bricks(1 + random() % 300);
    uint64_t ends[kBrickStreams] = {};
    for (BrickExtents& brick : bricks)
      for (size_t stream = 0; stream < kBrickStreams; ++stream) {
        if (stream == 2 && round % 3 == 0) continue;  // one variable
        brick[stream].length = static_cast<uint32_t>(1 + random() % (random() % 8 == 0 ? 300'000 : 9'000));
        brick[stream].offset = streamOffset(ends[stream], brick[stream].length);
        if (random() % 10 == 0) brick[stream].offset += random() % 200 * kPageBytes;
        ends[stream] = brick[stream].offset + brick[stream].length;
      }
    std::shuffle(bricks.begin(), bricks.end(), random);
    const uint64_t limit = 1 + random() % 2'000'000;
    const ReadBatch batch = planBatch(bricks, limit);
    ASSERT_GE(batch.bricks.size(), 1u);
    ASSERT_LE(batch.bytes, batch.bricks.size() == 1 ? pagedBytes(bricks[0]) : 2 * limit);
    uint64_t place = 0;
    for (const BatchRead& read : batch.reads) {
      ASSERT_EQ(read.offset % kPageBytes, 0u);
      ASSERT_EQ(read.length % kPageBytes, 0u);
      ASSERT_LE(read.needed, read.length);
      ASSERT_GT(read.needed + kPageBytes, read.length);
      ASSERT_EQ(read.place, place);
      place += read.length;
    }
    ASSERT_EQ(place, batch.bytes);
    for (size_t n = 0; n < batch.bricks.size(); ++n)
      for (size_t stream = 0; stream < kBrickStreams; ++stream) {
        const Extent& extent = bricks[n][stream];
        ASSERT_EQ(extent.length == 0, batch.bricks[n].read[stream] == BatchBrick::kNoRead);
        if (extent.length == 0) continue;
        const BatchRead& read = batch.reads.at(batch.bricks[n].read[stream]);
        ASSERT_EQ(read.stream, stream);
        ASSERT_GE(extent.offset, read.offset);
        ASSERT_LE(extent.offset + extent.length, read.offset + read.needed);
        ASSERT_EQ(batch.bricks[n].place[stream], read.place + extent.offset - read.offset);
        ASSERT_LE(read.first, n);
      }
  }
}

TEST_F(PagerTest, NeighboursBecomeOneRead) {
  std::vector<BrickExtents> bricks(16);
  for (size_t n = 0; n < bricks.size(); ++n) {
    bricks[n][0] = {n * 10 * kPageBytes, 9 * kPageBytes + 5, 0};
    bricks[n][1] = {n * 1000, 1000, 0};
  }
  std::reverse(bricks.begin(), bricks.end());
  const ReadBatch batch = planBatch(bricks, 1 << 20);
  ASSERT_EQ(batch.bricks.size(), 16u);
  ASSERT_EQ(batch.reads.size(), 2u);
  EXPECT_EQ(batch.reads[0].length, 160 * kPageBytes);
  EXPECT_EQ(batch.reads[1].length, 4 * kPageBytes);
}

TEST_F(PagerTest, ReadsTheSameBytesAsPlainReads) {
  std::vector<fs::path> caches{folder_ / "a.splats"};
  const fs::path in_memory = "/dev/shm/curvisplat_pager_test_" + std::to_string(::getpid());
  if (fs::is_directory("/dev/shm")) {
    fs::copy(caches[0], in_memory);
    caches.push_back(in_memory);
  }
  for (const fs::path& path : caches) {
    const CacheReader cache(path);
    const uint64_t least = BrickPager::leastBufferBytes(cache, 0);
    std::mt19937 random(2);
    for (const Way way : {Way::kIoUring, Way::kThreads})
      for (const bool direct : {true, false})
        for (const uint64_t buffer : {least, least + 5 * kPageBytes, uint64_t{2} << 20}) {
          if (way == Way::kIoUring && !uringWorks()) continue;
          BrickPager pager(cache, 0, optionsOf(way, direct, buffer));
          for (int round = 0; round < 3; ++round) {
            std::vector<uint32_t> order(inOrder());
            if (round > 0) std::shuffle(order.begin(), order.end(), random);
            if (round > 1) order.insert(order.end(), order.begin(), order.begin() + 10);
            EXPECT_EQ(takeAll(pager, cache, order, 1 + static_cast<unsigned>(round)), order.size())
                << path << ' ' << pager.way() << ' ' << buffer;
          }
          EXPECT_TRUE(pager.way().starts_with(way == Way::kIoUring ? "io_uring" : "pread")) << pager.way();
          const PagerStatistics statistics = pager.statistics();
          EXPECT_LE(statistics.peak_bytes, pager.bufferBytes());
          EXPECT_GE(statistics.bytes, 3 * fs::file_size(path / "geometry.bin"));
          EXPECT_GT(statistics.requests, 0u);
          EXPECT_GT(statistics.depth_s, 0);
          EXPECT_EQ(statistics.bricks_unreadable, 0u);
        }
  }
  fs::remove_all(in_memory);
}

TEST_F(PagerTest, ReadsByIoUringWhereTheKernelAllowsIt) {
  if (!uringWorks()) GTEST_SKIP() << "this kernel, or this container, refuses io_uring";
  for (const Way way : {Way::kAutomatic, Way::kIoUring}) {
    BrickPager pager(*cache_, 0, optionsOf(way, true, 1 << 20));
    EXPECT_EQ(takeAll(pager, *cache_, inOrder(), 2), bricks());
    EXPECT_TRUE(pager.way().starts_with("io_uring")) << pager.way();
  }
}

/// Each kind of reads, with its ends changed.
class PagerFaultTest : public PagerTest, public ::testing::WithParamInterface<bool> {
 protected:
  void SetUp() override {
    if (GetParam() && !uringWorks()) GTEST_SKIP() << "this kernel, or this container, refuses io_uring";
  }
  PagerOptions optionsWith(FaultyAsyncReads::Change change) const {
    PagerOptions options;
    options.reads = [by_uring = GetParam(), change = std::move(change)](unsigned depth) {
      return std::make_unique<FaultyAsyncReads>(by_uring ? makeUringReads(depth) : makeThreadReads(depth),
                                                change);
    };
    return options;
  }
};

INSTANTIATE_TEST_SUITE_P(Ways, PagerFaultTest, ::testing::Bool(),
                         [](const auto& tested) { return tested.param ? "io_uring" : "threads"; });

TEST_P(PagerFaultTest, AnyReadMayFailAndNobodyHangs) {
  std::atomic<uint64_t> reads = 0;
  uint64_t of_one_frame = 1;
  for (uint64_t at = 0; at < of_one_frame; ++at) {
    reads = 0;
    PagerOptions options = optionsWith([&, at](uint64_t number, int64_t result) {
      ++reads;
      return number == at ? -EIO : result;
    });
    options.buffer_bytes = BrickPager::leastBufferBytes(*cache_, 0);  // many reads
    BrickPager pager(*cache_, 0, options);
    EXPECT_LT(takeAll(pager, *cache_, inOrder(), 2), bricks()) << at;
    EXPECT_GT(pager.statistics().bricks_unreadable, 0u) << at;
    of_one_frame = reads;
    EXPECT_EQ(takeAll(pager, *cache_, inOrder(), 2), bricks()) << at;
  }
  EXPECT_GT(of_one_frame, 5u);
}

TEST_P(PagerFaultTest, ShortReadsAreCompleted) {
  for (const int64_t most : {int64_t{1}, int64_t{4096}, int64_t{5000}}) {
    BrickPager pager(*cache_, 0, optionsWith([most](uint64_t number, int64_t result) {
      return number % 3 == 0 ? std::min(result, most) : result;
    }));
    EXPECT_EQ(takeAll(pager, *cache_, inOrder(), 2), bricks()) << most;
  }
}

TEST_P(PagerFaultTest, ReadsThatArePutOffAreRepeatedButNotForEver) {
  for (const int64_t error : {EAGAIN, EINTR}) {
    BrickPager sometimes(*cache_, 0, optionsWith([error](uint64_t number, int64_t result) {
      return number % 3 == 0 ? -error : result;
    }));
    EXPECT_EQ(takeAll(sometimes, *cache_, inOrder(), 2), bricks());
    BrickPager always(*cache_, 0, optionsWith([error](uint64_t, int64_t) { return -error; }));
    EXPECT_EQ(takeAll(always, *cache_, inOrder(), 2), 0u);
    EXPECT_EQ(always.statistics().bricks_unreadable, bricks());
  }
}

TEST_F(PagerTest, JoinsReads) {
  BrickPager pager(*cache_, 0, {});
  EXPECT_EQ(takeAll(pager, *cache_, inOrder(), 1), bricks());
  EXPECT_LT(pager.statistics().requests, bricks() / 2);
}

TEST_F(PagerTest, ReadsThroughSystemCallsThatATestReplaced) {
  FaultySystemCalls faulty;
  const ScopedSystemCalls scope(faulty);
  BrickPager pager(*cache_, 0, {});
  EXPECT_EQ(takeAll(pager, *cache_, inOrder(), 2), bricks());
  EXPECT_GT(faulty.reads, 0);
  expectSays(pager.way(), "pread on 8 threads");
}

TEST_F(PagerTest, CompletesShortAndInterruptedReads) {
  for (const size_t largest : {size_t{4096}, size_t{777}, size_t{5000}}) {
    FaultySystemCalls faulty;
    faulty.largest_transfer = largest;
    faulty.interrupt_every = 3;
    const ScopedSystemCalls scope(faulty);
    BrickPager pager(*cache_, 0, {});
    EXPECT_EQ(takeAll(pager, *cache_, inOrder(), 2), bricks()) << largest;
  }
}

TEST_F(PagerTest, GoesThroughThePageCacheWhereDirectReadsAreRefused) {
  for (const bool at_open : {true, false}) {
    FaultySystemCalls faulty;
    (at_open ? faulty.refuse_direct_open : faulty.refuse_direct_reads) = true;
    const ScopedSystemCalls scope(faulty);
    BrickPager pager(*cache_, 0, {});
    EXPECT_EQ(takeAll(pager, *cache_, inOrder(), 2), bricks());
    expectSays(pager.way(), "page cache");
  }
}

TEST_F(PagerTest, AFailingDiskMarksBricksAndHangsNobody) {
  for (const int64_t at : {0, 1, 3}) {
    FaultySystemCalls faulty;
    faulty.fail_read_at = at;
    faulty.error = EIO;
    const ScopedSystemCalls scope(faulty);
    BrickPager pager(*cache_, 0, optionsOf(Way::kAutomatic, true, BrickPager::leastBufferBytes(*cache_, 0)));
    EXPECT_LT(takeAll(pager, *cache_, inOrder(), 3), bricks());
    EXPECT_GT(pager.statistics().bricks_unreadable, 0u);
  }
}

TEST_F(PagerTest, StoppingWakesAllWhoWaitAndStartingBeginsAnew) {
  std::mt19937 random(7);
  for (const Way way : {Way::kIoUring, Way::kThreads}) {
    if (way == Way::kIoUring && !uringWorks()) continue;
    BrickPager pager(*cache_, 0, optionsOf(way, true, BrickPager::leastBufferBytes(*cache_, 0)));
    for (int round = 0; round < 100; ++round) {
      std::vector<uint32_t> order = inOrder();
      std::shuffle(order.begin(), order.end(), random);
      pager.start(order);
      const size_t taken = random() % order.size();
      std::thread other([&] {
        // Never gets its turn: the buffer is too small for all that come before.
        EXPECT_FALSE(pager.fetch(order.size() - 1));
      });
      {
        std::vector<PagedBrick> held;
        for (size_t n = 0; n < taken / 8; ++n) {
          const auto bytes = pager.fetch(n);
          ASSERT_TRUE(bytes && areOf(*cache_, order[n], *bytes)) << n;
        }
      }
      pager.stop();
      other.join();
      EXPECT_FALSE(pager.fetch(0));
    }
    EXPECT_EQ(takeAll(pager, *cache_, inOrder(), 2), bricks());
  }
}

TEST_F(PagerTest, AFileThatShrinksMarksWhatIsGone) {
  const auto order = inOrder();
  for (const Way way : {Way::kIoUring, Way::kThreads}) {
    if (way == Way::kIoUring && !uringWorks()) continue;
    BrickPager pager(*cache_, 0, optionsOf(way, true, 1 << 20));
    ASSERT_EQ(takeAll(pager, *cache_, order, 2), bricks());
    const uint64_t size = fs::file_size(cache_->geometryPath());
    const std::string whole = [&] {
      std::string bytes(size, '\0');
      InputFile(cache_->geometryPath()).readAt(0, std::span(bytes.data(), bytes.size()));
      return bytes;
    }();
    fs::resize_file(cache_->geometryPath(), size / 2);
    pager.start(order);
    for (size_t n = 0; n < order.size(); ++n) {
      const Extent& extent = cache_->bricks()[order[n]].geometry;
      const auto bytes = pager.fetch(n);
      ASSERT_TRUE(bytes);
      if (extent.offset + extent.length > size / 2) {
        EXPECT_FALSE(bytes->readable()) << n;
      }
      EXPECT_TRUE(!bytes->readable() || areOf(*cache_, order[n], *bytes)) << n;
    }
    fs::resize_file(cache_->geometryPath(), 0);
    OutputFile file(cache_->geometryPath());
    file.append(std::as_bytes(std::span(whole)));
    file.close();
  }
}

TEST_F(PagerTest, LeavesOutWhatIsNotNeeded) {
  const std::vector<uint32_t> order = inOrder();
  for (const Way way : {Way::kAutomatic, Way::kThreads})
    for (const uint64_t buffer : {BrickPager::leastBufferBytes(*cache_, 0), uint64_t{64} << 20}) {
      BrickPager pager(*cache_, 0, optionsOf(way, false, buffer));
      const auto unneeded = [](uint32_t brick) { return brick % 3 == 1 || (brick > 20 && brick < 40); };
      pager.start(order, unneeded);
      uint64_t left_out = 0, bytes = 0;
      for (const uint32_t brick : order) {
        const std::optional<PagedBrick> paged = pager.fetch(brick);
        ASSERT_TRUE(paged);
        EXPECT_EQ(paged->isLeftOut(), unneeded(brick)) << brick;
        EXPECT_EQ(areOf(*cache_, brick, *paged), !unneeded(brick)) << brick;
        if (!unneeded(brick)) continue;
        ++left_out;
        bytes += cache_->bricks()[brick].geometry.length + cache_->brickVariables(0)[brick].values.length;
      }
      EXPECT_EQ(pager.statistics().bricks_left_out, left_out);
      EXPECT_EQ(pager.statistics().bytes_left_out, bytes);
      pager.start(order, [](uint32_t) { return true; });
      for (const uint32_t brick : order) EXPECT_TRUE(pager.fetch(brick)->isLeftOut());
      pager.start(order);  // and it is forgotten
      for (const uint32_t brick : order) EXPECT_TRUE(areOf(*cache_, brick, *pager.fetch(brick)));
    }
}

}  // namespace
}  // namespace curvisplat
