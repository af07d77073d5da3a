// Frames of the window on a thread of their own: coarse while the picture moves, then refined; and a window
// that is closed while its pictures load, of which nothing stays.
#include <gtest/gtest.h>

#include <algorithm>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/reference/known_pictures.h"
#include "tests/reference/reference_march.h"
#include "tests/support/shared_egl.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_display.h"
#include "tools/view/frame_loop.h"

namespace curvisplat {
namespace {

class FrameLoopTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    convertGrid(SceneGridSource(makeScene("half-annulus"), {96, 40, 32}), *folder_ / "scene.splats");
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static FrameRequest requestOf(double parallel_scale = 1.25) {
    FrameRequest request{
        DrawnScalars(0, TransferFunction::preset("viridis", 0, 1, 0.05)), 1, halfAnnulusCamera(), {}};
    request.camera.parallel_scale = parallel_scale;
    request.options.size = {160, 120};
    request.options.lod_pixels = 0.3;
    return request;
  }

  /// Waits for the loop's next word.
  void wait() {
    std::unique_lock lock(mutex_);
    woken_.wait(lock, [this] { return wakes_ > 0; });
    wakes_ = 0;
  }
  std::function<void()> waker() {
    return [this] {
      const std::lock_guard lock(mutex_);
      ++wakes_;
      woken_.notify_all();
    };
  }
  /// Frames until the loop rests.
  std::vector<ShownFrame> all(FrameLoop& loop) {
    std::vector<ShownFrame> frames;
    while (true) {
      const bool busy = loop.busy();
      while (auto frame = loop.poll()) frames.push_back(std::move(*frame));
      if (!busy) return frames;
      wait();
    }
  }

  static std::vector<Brick> coarsest(const CacheReader& cache) {
    std::vector<Brick> roots;
    std::ranges::copy_if(cache.bricks(), std::back_inserter(roots),
                         [](const Brick& brick) { return brick.parent == kNoBrick; });
    return roots;
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  const CacheReader cache_{*folder_ / "scene.splats"};
  std::mutex mutex_;
  std::condition_variable woken_;
  int wakes_ = 0;
};
std::unique_ptr<TemporaryFolder> FrameLoopTest::folder_;

TEST_F(FrameLoopTest, RefinesToThePictureThatRenderDraws) {
  FrameLoop loop(cache_, Backend::kCpu, waker());
  const FrameRequest request = requestOf();
  const uint64_t number = loop.request(request);
  const std::vector<ShownFrame> frames = all(loop);
  ASSERT_FALSE(frames.empty());
  EXPECT_TRUE(frames.back().is_final);
  EXPECT_EQ(frames.back().request, number);
  FrameRenderer renderer(cache_, 0, request.scalars.opacity.function, Backend::kCpu);
  FrameStatistics statistics;
  EXPECT_EQ(frames.back().image.rgba, renderer.render(request.camera, request.options, statistics).rgba);
}

TEST_F(FrameLoopTest, AMovingPictureIsOneAndCoarse) {
  FrameLoop loop(cache_, Backend::kCpu, waker());
  FrameRequest request = requestOf();
  request.moving = true;
  loop.request(request);
  const std::vector<ShownFrame> frames = all(loop);
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_FALSE(frames[0].is_final);
  EXPECT_LE(frames[0].statistics.splats_read, 100'000u);
  EXPECT_EQ(frames[0].image.size.width, 160);
}

/// A moving picture is shown where it was drawn. Nothing of it is read back before the picture is wanted.
TEST_F(FrameLoopTest, PicturesStayOnTheCardOfAWindowThatSharesIt) {
  std::optional<SharedEgl> window;
  try {
    window.emplace();
  } catch (const Error& error) {
    GTEST_SKIP() << error.what();
  }
  // Small: OpenGL on the processor takes a second for ten thousand splats.
  convertGrid(SceneGridSource(makeScene("half-annulus"), {32, 16, 12}), *folder_ / "small.splats");
  const CacheReader small(*folder_ / "small.splats");
  FrameLoop loop(small, Backend::kEgl, waker(), {}, &*window);
  FrameRequest request = requestOf();
  request.options.card_memory_bytes = 64 << 20;
  request.may_stay_on_card = request.moving = true;
  for (int n = 0; n < 5; ++n) {
    request.camera.position.x += 0.01;
    loop.request(request);
    for (const ShownFrame& frame : all(loop)) {
      if (loop.backendName().find("compute shaders") == std::string::npos) GTEST_SKIP() << loop.backendName();
      EXPECT_TRUE(frame.on_card) << loop.backendName();
      EXPECT_TRUE(frame.image.rgba.empty() && frame.bytes.empty());
      EXPECT_EQ(frame.statistics.card_read_bytes, 0u);
      EXPECT_GT(frame.statistics.card_peak_bytes, 0u);
    }
  }
  request.moving = false;
  loop.request(request);
  const ShownFrame shown = std::move(all(loop).back());
  EXPECT_TRUE(shown.is_final && shown.on_card);
  request.may_stay_on_card = false;
  request.only_final = true;
  loop.request(request);
  std::vector<ShownFrame> reads = all(loop);
  ASSERT_EQ(reads.size(), 1u);
  const ShownFrame read = std::move(reads.back());
  EXPECT_FALSE(read.on_card);
  EXPECT_GT(read.statistics.card_read_bytes, 0u);
  const std::vector<uint8_t> seen = window->read(*shown.on_card);
  ASSERT_EQ(seen.size(), read.bytes.size());
  for (size_t n = 0; n < seen.size(); ++n) EXPECT_NEAR(seen[n], read.bytes[n], 1) << n;
}

TEST_F(FrameLoopTest, AMovingPicturesTimeDecidesItsSplatsAndPixels) {
  FrameLoop loop(cache_, Backend::kCpu, waker());
  FrameRequest request = requestOf();
  request.moving = true;
  const auto lastOf = [&](int pictures, double target_s) {
    request.target_s = target_s;
    ShownFrame last;
    for (int n = 0; n < pictures; ++n) {
      loop.request(request);
      last = std::move(all(loop).back());
    }
    return last;
  };
  const uint64_t first = lastOf(1, 1e-9).statistics.splats_read;
  const uint64_t hurried = lastOf(12, 1e-9).statistics.splats_read;  // no picture is as quick as that
  const ShownFrame unhurried = lastOf(20, 1e9);
  EXPECT_LT(4 * hurried, first);
  EXPECT_GT(unhurried.statistics.splats_read, 4 * hurried);
  EXPECT_TRUE(unhurried.is_final);  // there was time for all there is
}

// The first movement in each view would otherwise take as long as the processor is slow.
TEST_F(FrameLoopTest, TheFirstPictureAtRestTeachesWhatAMovingOneMayHave) {
  FrameRequest request = requestOf();
  request.target_s = 1e-9;  // no picture is as quick as that
  const auto splatsOfMoving = [&](FrameLoop& loop) {
    request.moving = true;
    loop.request(request);
    return all(loop).back().statistics.splats_read;
  };
  FrameLoop untaught(cache_, Backend::kCpu, waker()), taught(cache_, Backend::kCpu, waker());
  taught.request(request);
  EXPECT_TRUE(all(taught).back().is_final);
  EXPECT_LT(splatsOfMoving(taught), splatsOfMoving(untaught));
}

TEST_F(FrameLoopTest, TheNewestRequestCounts) {
  FrameLoop loop(cache_, Backend::kCpu, waker());
  uint64_t newest = 0;
  for (int n = 0; n < 50; ++n) newest = loop.request(requestOf(1 + 0.01 * n));
  const std::vector<ShownFrame> frames = all(loop);
  ASSERT_FALSE(frames.empty());
  EXPECT_EQ(frames.back().request, newest);
  EXPECT_TRUE(frames.back().is_final);
}

TEST_F(FrameLoopTest, AnotherFunctionChangesThePicture) {
  FrameLoop loop(cache_, Backend::kCpu, waker());
  FrameRequest request = requestOf();
  loop.request(request);
  const Image viridis = all(loop).back().image;
  request.scalars.opacity.function = TransferFunction::preset("inferno", 0, 1, 0.05);
  request.function_version = 2;
  loop.request(request);
  const std::vector<ShownFrame> frames = all(loop);
  const Image& inferno = frames.back().image;
  // It shows in the first picture already.
  EXPECT_GT(compareImages(frames.front().image, inferno).psnr_db,
            compareImages(frames.front().image, viridis).psnr_db + 5);
  FrameRenderer renderer(cache_, 0, request.scalars.opacity.function, Backend::kCpu);
  FrameStatistics statistics;
  EXPECT_EQ(inferno.rgba, renderer.render(request.camera, request.options, statistics).rgba);
}

TEST_F(FrameLoopTest, TooLittleMemoryEndsTheRequestOnly) {
  FrameLoop loop(cache_, Backend::kCpu, waker());
  FrameRequest request = requestOf();
  request.options.memory_bytes = 1 << 20;
  loop.request(request);
  EXPECT_THROW(all(loop), UsageError);
  request.options.memory_bytes = 512 << 20;
  loop.request(request);
  EXPECT_TRUE(all(loop).back().is_final);
}

TEST_F(FrameLoopTest, OneAtATimeDrawsTheSamePictures) {
  FrameLoop loop(cache_, Backend::kCpu, waker());
  FrameRequest request = requestOf();
  request.one_at_a_time = true;
  const auto last = [&] {
    std::optional<ShownFrame> shown;
    while (!shown || !shown->is_final) {
      wait();
      if (auto frame = loop.poll()) {
        shown = std::move(frame);
        EXPECT_TRUE(loop.busy()) << "it waits for the picture's memory";
        loop.giveBack();
      }
    }
    return std::move(*shown);
  };
  loop.request(request);
  const ShownFrame first = last();
  request.camera.parallel_scale *= 2;
  loop.request(request);
  const uint64_t splats = last().statistics.splats_drawn;
  request.one_at_a_time = false;
  request.camera.parallel_scale /= 2;
  loop.request(request);
  EXPECT_EQ(all(loop).back().image.rgba, first.image.rgba);
  EXPECT_NE(splats, first.statistics.splats_drawn);
  request.one_at_a_time = true;
  loop.request(request);
  wait();  // the loop ends although its picture is not taken
}

/// The picture is the one that `render --keep-going` draws.
TEST_F(FrameLoopTest, CoarserDataIsDrawnWhereABrickIsDamaged) {
  const std::filesystem::path copy = *folder_ / "leaf.splats";
  std::filesystem::copy(*folder_ / "scene.splats", copy);
  const CacheReader reader(copy);
  {
    std::fstream file(reader.geometryPath(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(reader.bricks().back().geometry.offset));
    file.put('\x55').put('\x5a').put('\xa5');
  }
  FrameLoop loop(reader, Backend::kCpu, waker());
  FrameRequest request = requestOf();
  request.options.lod_pixels = 0;
  for (int n = 0; n < 2; ++n) {  // the second knows already
    loop.request(request);
    const std::vector<ShownFrame> frames = all(loop);
    ASSERT_TRUE(!frames.empty() && frames.back().is_final);
    ASSERT_EQ(frames.back().statistics.bricks_unreadable.size(), 1u);
    FrameRenderer renderer(reader, 0, request.scalars.opacity.function, Backend::kCpu);
    FrameStatistics statistics;
    FrameOptions options = request.options;
    options.keep_going = true;
    EXPECT_EQ(frames.back().image.rgba, renderer.render(request.camera, options, statistics).rgba);
  }
}

/// Coarse pictures show nothing then, finer ones all there is.
TEST_F(FrameLoopTest, FinerDataIsDrawnWhereACoarseBrickIsDamaged) {
  const std::filesystem::path copy = *folder_ / "root.splats";
  std::filesystem::copy(*folder_ / "scene.splats", copy);
  const CacheReader reader(copy);
  ASSERT_EQ(coarsest(reader).size(), 1u);
  {
    std::fstream file(reader.geometryPath(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(coarsest(reader).front().geometry.offset));
    file.put('\x55').put('\x5a').put('\xa5');
  }
  for (const bool moving : {false, true}) {
    SCOPED_TRACE(moving);
    FrameLoop loop(reader, Backend::kCpu, waker());
    FrameRequest request = requestOf();
    request.moving = moving;
    request.target_s = 1e-9;  // no picture is as quick as that: the coarsest are asked for
    request.options.lod_pixels = 0;
    for (int n = 0; n < (moving ? 4 : 1); ++n) {
      loop.request(request);
      const std::vector<ShownFrame> frames = all(loop);
      ASSERT_FALSE(frames.empty());
      for (const ShownFrame& frame : frames) EXPECT_GT(frame.statistics.splats_drawn, 0u);
      EXPECT_TRUE(moving || frames.back().is_final);
    }
  }
}

TEST_F(FrameLoopTest, FacesThatAStepLacksEndTheRequestOnly) {
  FrameLoop loop(cache_, Backend::kCpu, waker());
  FrameRequest request = requestOf();
  SurfaceScene scene;
  scene.grid_surfaces.emplace_back();
  request.options.scene = std::make_shared<const SurfaceScene>(scene);
  request.faces_at = [](const CacheReader&, const FaceNames&) -> std::vector<GridSurface> {
    throw Error("no such faces");
  };
  loop.request(request);
  EXPECT_THROW(all(loop), UsageError);
  loop.request(requestOf());
  EXPECT_TRUE(all(loop).back().is_final);
}

TEST_F(FrameLoopTest, ADamagedCacheEndsTheLoop) {
  const std::filesystem::path copy = *folder_ / "copy.splats";
  std::filesystem::copy(*folder_ / "scene.splats", copy);
  const CacheReader reader(copy);
  std::filesystem::resize_file(copy / "geometry.bin", 100);
  FrameLoop loop(reader, Backend::kCpu, waker());
  loop.request(requestOf());
  EXPECT_THROW(all(loop), Error);
  EXPECT_FALSE(loop.busy());
  EXPECT_THROW(loop.poll(), Error);
}

TEST_F(FrameLoopTest, EndsInTheMiddleOfAPicture) {
  for (int n = 0; n < 20; ++n) {
    FrameLoop loop(cache_, Backend::kCpu, waker());
    loop.request(requestOf());
    if (n % 2) wait();
  }
}

TEST(Effort, LearnsFromTime) {
  Effort effort(1000);
  const uint64_t first = effort.splats();
  effort.learn(0.2, 0.1, false);
  EXPECT_EQ(effort.splats(), first / 2);
  effort.learn(0.01, 0.1, false);
  EXPECT_EQ(effort.splats(), first);
  effort.learn(0.01, 0.1, true);  // there are no more splats to draw
  EXPECT_EQ(effort.splats(), first);
  EXPECT_EQ(effort.detailPixels(), 0);
}

TEST(Effort, TakesFewerPixelsWhereFewerSplatsDoNotHelp) {
  Effort effort(1000);
  const uint64_t first = effort.splats();
  effort.learn(0.4, 0.1, true);
  EXPECT_EQ(effort.splats(), first);
  EXPECT_DOUBLE_EQ(effort.detailPixels(), 4);  // a quarter of the pixels
  effort.learn(0.05, 0.1, true);
  effort.learn(0.05, 0.1, true);
  EXPECT_EQ(effort.detailPixels(), 0);
  for (int n = 0; n < 100; ++n) effort.learn(100, 0.1, false);
  EXPECT_EQ(effort.splats(), 1000u);
  EXPECT_EQ(effort.detailPixels(), 16);
}

/// Names of this process's threads, but for TBB's, which stay for whoever comes next.
std::multiset<std::string> threadNames() {
  std::multiset<std::string> names;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream file(task.path() / "comm");
    std::string name;
    std::getline(file, name);
    for (const char* ours : {"frames", "prepare", "pager", "read", "gl"})
      if (name == ours) names.insert(name);
  }
  return names;
}

auto openFiles() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
}

/// Reads by io_uring where the system has it, or by threads.
class ClosingTest : public testing::TestWithParam<bool> {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    convertGrid(SceneGridSource(makeScene("half-annulus"), {96, 40, 32}), *folder_ / "scene.splats");
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::unique_ptr<TemporaryFolder> folder_;
};
std::unique_ptr<TemporaryFolder> ClosingTest::folder_;

TEST_P(ClosingTest, LeavesNoThreadAndNoFile) {
  const CacheReader cache(*folder_ / "scene.splats");
  const auto files = openFiles();
  FrameRequest request{
      DrawnScalars(0, TransferFunction::preset("viridis", 0, 1, 0.05)), 1, halfAnnulusCamera(), {}};
  request.options.size = {160, 120};
  request.options.lod_pixels = 0;
  SystemCalls calls;  // a double of the system's, which io_uring would pass by
  std::optional<ScopedSystemCalls> scope;
  if (GetParam()) scope.emplace(calls);
  for (const int pictures : {0, 1, 2}) {
    SCOPED_TRACE(pictures);
    std::mutex mutex;
    std::condition_variable woken;
    int wakes = 0;
    {
      FrameLoop loop(cache, Backend::kCpu, [&] {
        const std::lock_guard lock(mutex);
        ++wakes;
        woken.notify_all();
      });
      loop.request(request);
      std::unique_lock lock(mutex);
      woken.wait(lock, [&] { return wakes >= pictures; });
      if (pictures > 0) {
        const std::multiset<std::string> names = threadNames();
        for (const char* name : {"frames", "pager", "prepare"}) EXPECT_TRUE(names.contains(name)) << name;
        EXPECT_EQ(names.contains("read"), GetParam());
      }
    }
    // One that was waited for may be seen for a moment more.
    EXPECT_TRUE(eventually([] { return threadNames().empty(); })) << *threadNames().begin();
    EXPECT_EQ(openFiles(), files);
  }
}

INSTANTIATE_TEST_SUITE_P(ReadingByThreads, ClosingTest, testing::Bool());

}  // namespace
}  // namespace curvisplat
