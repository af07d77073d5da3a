// The pipeline behind a frame: whatever is read, kept, cancelled or damaged, a picture is whole and right, or
// there is none.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <random>
#include <stop_token>
#include <thread>

#include "render/frame/frame.h"
#include "render/frame/frame_plan.h"
#include "stream/base/error.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::FaultySystemCalls;

/// Tests of each backend.
class FrameStreamingTest : public ::testing::TestWithParam<Backend> {
 protected:
  FrameStreamingTest() {
    writeRandomCache(path(), 3, GetParam() == Backend::kOsmesa ? 1000 : 3000);
    cache_ = std::make_unique<CacheReader>(path());
  }

  fs::path path() const { return folder_ / "a.splats"; }
  static TransferFunction function() { return TransferFunction::preset("viridis", -1, 1, 0.02); }
  static FrameOptions options() {
    FrameOptions made;
    made.size = {60, 50};
    made.lod_pixels = 0;
    made.memory_bytes = 256 << 20;
    return made;
  }
  Camera camera(const char* view) const {
    const Manifest& manifest = cache_->manifest();
    return Camera::named(view, manifest.lower, manifest.upper, options().size, Projection::kOrthographic, 30);
  }
  /// The least memory that renders at all.
  static uint64_t leastMemory(FrameRenderer& renderer, const Camera& camera) {
    FrameOptions wanted = options();
    wanted.memory_bytes = 1 << 20;
    wanted.threads = 8;  // as many as any test has: each takes some
    FrameStatistics statistics;
    try {
      renderer.render(camera, wanted, statistics);
    } catch (const UsageError& error) {
      const std::string message = error.what();
      return std::stoull(message.substr(message.find("at least ") + 9)) << 20;
    }
    return wanted.memory_bytes;
  }

  void overwrite(const fs::path& file, uint64_t offset) const {
    std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
    stream.seekp(static_cast<std::streamoff>(offset));
    stream.put('\x55').put('\x5a').put('\xa5');
  }

  void expectWholeOrNone() const;

  TemporaryFolder folder_;
  std::unique_ptr<CacheReader> cache_;
};

INSTANTIATE_TEST_SUITE_P(Backends, FrameStreamingTest, ::testing::Values(Backend::kOsmesa, Backend::kCpu),
                         [](const ::testing::TestParamInfo<Backend>& tested) {
                           return tested.param == Backend::kOsmesa ? "osmesa" : "cpu";
                         });

TEST_P(FrameStreamingTest, IsTheSameForAnyMemoryThreadsWayOfReadingAndHistory) {
  FrameRenderer reference(*cache_, 0, function(), GetParam());
  FrameStatistics statistics;
  FrameOptions plain = options();
  plain.threads = 1;
  const Image iso = reference.render(camera("iso"), plain, statistics);
  const Image side = reference.render(camera("-x"), plain, statistics);
  ASSERT_NE(iso.rgba, side.rgba);
  const uint64_t least = leastMemory(reference, camera("iso"));
  EXPECT_LT(least, uint64_t{64} << 20);

  FaultySystemCalls calls;
  const ScopedSystemCalls scope(calls);
  FrameRenderer renderer(*cache_, 0, function(), GetParam());
  size_t combination = 0;
  for (const bool direct : {false, true})
    for (const uint64_t memory : {least, least + (2 << 20), uint64_t{4} << 30})
      for (const unsigned threads : {1u, 2u, 4u}) {
        // Usually each memory with each number of threads once; with OpenGL each once.
        const size_t n = combination++;
        if (!faults::isWholeSweep() && n % (GetParam() == Backend::kCpu ? 2 : 7) != 0) continue;
        FrameOptions wanted = options();
        wanted.memory_bytes = memory;
        wanted.threads = threads;
        calls.refuse_direct_open = !direct;  // then bricks come through the page cache
        const std::string what = fmt::format("{} bytes, {} threads", memory, threads);
        EXPECT_EQ(renderer.render(camera("iso"), wanted, statistics).rgba, iso.rgba) << what << ", cold";
        EXPECT_EQ(statistics.bricks_cached, 0u);
        EXPECT_GT(statistics.bytes_read, 0u);
        if (!direct) expectSays(statistics.read_by, "page cache");
        EXPECT_EQ(renderer.render(camera("-x"), wanted, statistics).rgba, side.rgba) << what << ", turned";
        EXPECT_EQ(renderer.render(camera("iso"), wanted, statistics).rgba, iso.rgba) << what << ", warm";
        if (memory > least + (2 << 20)) {
          EXPECT_EQ(statistics.bricks_read, 0u);
          EXPECT_EQ(statistics.bytes_read, 0u);
        }
        EXPECT_LE(statistics.cache_peak_bytes + statistics.pager_peak_bytes + statistics.ring_peak_bytes +
                      statistics.sweep_peak_bytes,
                  memory);
        EXPECT_GT(statistics.ring_peak_bytes, 0u);
      }
}

TEST_P(FrameStreamingTest, AnotherImageSizeFindsTheCacheWarm) {
  FrameRenderer renderer(*cache_, 0, function(), GetParam());
  FrameStatistics statistics;
  FrameOptions wanted = options();
  renderer.render(camera("iso"), wanted, statistics);
  wanted.size = {90, 75};
  renderer.render(camera("iso"), wanted, statistics);
  EXPECT_EQ(statistics.bricks_read, 0u);
}

TEST_P(FrameStreamingTest, PrefetchingMakesTheNextFrameWarm) {
  FrameRenderer renderer(*cache_, 0, function(), GetParam());
  FrameStatistics statistics;
  const Image expected = renderer.render(camera("iso"), options(), statistics);
  FrameRenderer prefetched(*cache_, 0, function(), GetParam());
  FrameOptions wanted = options();
  wanted.threads = 2;
  prefetched.prefetch(camera("iso"), wanted);
  prefetched.prefetch(camera("-x"), wanted);
  prefetched.prefetch(camera("iso"), wanted);
  // However far it has come: what it has done is not done again, and the picture is the same.
  EXPECT_EQ(prefetched.render(camera("iso"), wanted, statistics).rgba, expected.rgba);
  EXPECT_EQ(statistics.bricks_read + statistics.bricks_cached, statistics.bricks_drawn);
  prefetched.prefetch(camera("-x"), wanted);  // and is left behind
}

/// Stops frames at many moments. Each has to be whole and right, or there is none.
void FrameStreamingTest::expectWholeOrNone() const {
  FrameRenderer renderer(*cache_, 0, function(), GetParam());
  FrameStatistics statistics;
  FrameOptions wanted = options();
  wanted.size = {24, 20};
  wanted.memory_bytes = leastMemory(renderer, camera("iso")) + (40 << 20);
  wanted.threads = 3;
  const Image expected = renderer.render(camera("iso"), wanted, statistics);

  const int rounds = faults::isWholeSweep() ? 500 : GetParam() == Backend::kCpu ? 60 : 25;
  std::vector<std::stop_source> stops(static_cast<size_t>(rounds));
  std::atomic<int> round = -1, ended = -1;
  std::thread stopper([&] {
    std::mt19937 random(5);
    for (int n = 0; n < rounds; ++n) {
      for (int now; (now = round.load()) < n;) round.wait(now);
      // Some moment of the frame, or after it.
      for (uint32_t turns = random() % (random() % 2 ? 100'000 : 2'000'000); turns > 0 && ended < n;
           --turns) {
      }
      stops[static_cast<size_t>(n)].request_stop();
    }
  });
  int stopped = 0, whole = 0;
  for (int n = 0; n < rounds; ++n) {
    wanted.stop = stops[static_cast<size_t>(n)].get_token();
    round = n;
    round.notify_one();
    try {
      const Image image = renderer.render(camera("iso"), wanted, statistics);
      EXPECT_EQ(image.rgba, expected.rgba);
      ++whole;
    } catch (const Interrupted&) {
      ++stopped;
    }
    ended = n;
    if (n % 7 == 0) renderer.prefetch(camera("+z"), wanted);
  }
  stopper.join();
  EXPECT_EQ(stopped + whole, rounds);
  EXPECT_GT(stopped, 0);
  wanted.stop = {};
  EXPECT_EQ(renderer.render(camera("iso"), wanted, statistics).rgba, expected.rgba);
}

TEST_P(FrameStreamingTest, CanBeStoppedAtAnyMoment) {
  expectWholeOrNone();
}

TEST_P(FrameStreamingTest, CanBeStoppedAtAnyMomentWhileThreadsRead) {
  SystemCalls calls;  // a double of the system's, which io_uring would pass by
  const ScopedSystemCalls scope(calls);
  expectWholeOrNone();
}

TEST_P(FrameStreamingTest, PartsOfBricksArePagedAndKept) {
  FrameRenderer reference(*cache_, 0, function(), GetParam());
  FrameStatistics statistics;
  const Image whole = reference.render(camera("+x"), options(), statistics);
  const uint64_t splats = statistics.splats_read;
  const uint64_t least = leastMemory(reference, camera("+x"));
  FrameRenderer renderer(*cache_, 0, function(), GetParam());
  bool in_part = false;  // a brick
  for (const uint64_t sixteenths : {6, 10}) {
    FrameOptions wanted = options();
    wanted.max_splats = splats * sixteenths / 16;
    const Image expected =
        FrameRenderer(*cache_, 0, function(), GetParam()).render(camera("+x"), wanted, statistics);
    EXPECT_NE(expected.rgba, whole.rgba);
    const uint64_t bricks = statistics.bricks_read;
    const FramePlan plan = FramePlanner(*cache_, {0, function()}).plan(camera("+x"), wanted);
    in_part |= std::any_of(plan.parts.begin(), plan.parts.end(),
                           [](const SweptPart& part) { return !part.part.whole(); });
    for (const uint64_t memory : {least, uint64_t{4} << 30})
      for (const unsigned threads : {1u, 4u}) {
        if (GetParam() != Backend::kCpu && (memory == least) != (threads == 4)) continue;
        wanted.memory_bytes = memory;
        wanted.threads = threads;
        for (const char* when : {"cold", "warm"}) {
          EXPECT_EQ(renderer.render(camera("+x"), wanted, statistics).rgba, expected.rgba) << when;
          EXPECT_EQ(statistics.bricks_read + statistics.bricks_cached, bricks);
        }
        renderer.prefetch(camera("+x"), wanted);
        EXPECT_EQ(renderer.render(camera("+x"), wanted, statistics).rgba, expected.rgba);
      }
  }
  EXPECT_TRUE(in_part);
}

TEST_P(FrameStreamingTest, AFailingDiskEndsTheFrameOnce) {
  FaultySystemCalls faulty;
  const ScopedSystemCalls scope(faulty);
  FrameRenderer renderer(*cache_, 0, function(), GetParam());
  FrameStatistics statistics;
  for (const unsigned threads : {1u, 4u}) {
    FrameOptions wanted = options();
    wanted.threads = threads;
    faulty.reads = 0;
    faulty.fail_read_at = 1;
    faulty.error = EIO;
    EXPECT_THROW(renderer.render(camera("iso"), wanted, statistics), Error);
    faulty.fail_read_at = -1;
    EXPECT_NO_THROW(renderer.render(camera("iso"), wanted, statistics));
  }
}

TEST_P(FrameStreamingTest, KeepGoingDrawsTheNearestReadableAncestor) {
  FrameStatistics statistics;
  const Image whole =
      FrameRenderer(*cache_, 0, function(), GetParam()).render(camera("iso"), options(), statistics);
  EXPECT_TRUE(statistics.bricks_unreadable.empty());
  const uint32_t last = static_cast<uint32_t>(cache_->bricks().size()) - 1;
  overwrite(cache_->geometryPath(), cache_->bricks()[last].geometry.offset);
  overwrite(cache_->valuesPath(0), cache_->brickVariables(0)[last - 7].values.offset);

  FrameRenderer renderer(*cache_, 0, function(), GetParam());
  EXPECT_THROW(renderer.render(camera("iso"), options(), statistics), Error);
  FrameOptions wanted = options();
  wanted.keep_going = true;
  std::vector<float> first;
  for (const unsigned threads : {1u, 4u}) {
    wanted.threads = threads;
    const Image image = renderer.render(camera("iso"), wanted, statistics);
    ASSERT_EQ(statistics.bricks_unreadable.size(), 2u);
    EXPECT_EQ(statistics.bricks_unreadable[0].brick, last - 7);
    EXPECT_EQ(statistics.bricks_unreadable[1].brick, last);
    expectSays(statistics.bricks_unreadable[1].reason, "brick " + std::to_string(last));
    EXPECT_NE(image.rgba, whole.rgba);
    if (first.empty()) first = image.rgba;
    EXPECT_EQ(image.rgba, first) << threads;
    EXPECT_GT(compareImages(image, whole).psnr_db, 15);
  }

  // With nothing to be read at all there is the background, and a report of every brick.
  fs::resize_file(cache_->geometryPath(), 0);
  FrameRenderer blind(*cache_, 0, function(), GetParam());
  const Image empty = blind.render(camera("iso"), wanted, statistics);
  EXPECT_EQ(statistics.bricks_unreadable.size(), statistics.bricks_drawn);
  EXPECT_TRUE(std::all_of(empty.rgba.begin(), empty.rgba.end(), [](float value) { return value == 1; }));
}

TEST_P(FrameStreamingTest, AFileThatShrinksEndsTheFrameWithItsBrick) {
  FrameRenderer renderer(*cache_, 0, function(), GetParam());
  fs::resize_file(cache_->valuesPath(0), fs::file_size(cache_->valuesPath(0)) / 3);
  FrameStatistics statistics;
  expectError([&] { renderer.render(camera("iso"), options(), statistics); }, {"brick ", "var.0.bin"});
  FrameOptions wanted = options();
  wanted.keep_going = true;
  EXPECT_NO_THROW(renderer.render(camera("iso"), wanted, statistics));
  EXPECT_FALSE(statistics.bricks_unreadable.empty());
}

}  // namespace
}  // namespace curvisplat
