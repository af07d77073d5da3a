// Work beside the window: on threads of low priority, which are its own.
#include "tools/view/background_jobs.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <latch>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>

#include "stream/base/progress.h"
#include "tests/support/memory_limit.h"
#include "tests/support/virtual_display.h"

namespace curvisplat {
namespace {

void nobody() {}

int niceOfThisThread() {
  return getpriority(PRIO_PROCESS, 0);
}

struct Threads {
  std::set<int> nices;
  std::set<std::thread::id> ids;
};

/// The threads that two tasks run in, which wait for each other: TBB has to find a second thread.
Threads threadsOfALoop() {
  std::mutex mutex;
  std::latch both(2);
  Threads threads;
  tbb::parallel_for(0, 2, [&](int) {
    {
      const std::lock_guard lock(mutex);
      threads.nices.insert(niceOfThisThread());
      threads.ids.insert(std::this_thread::get_id());
    }
    both.arrive_and_wait();
  });
  return threads;
}

Threads threadsOfAJob() {
  Threads threads;
  BackgroundJob job(
      "job", "beginning",
      [&](Progress&) {
        threads = threadsOfALoop();
        return std::filesystem::path("done");
      },
      nobody);
  EXPECT_TRUE(eventually([&] { return job.isDone(); }));
  EXPECT_EQ(job.get(), "done");
  return threads;
}

// The thread sanitizer cannot see how TBB hands a loop from one thread to another (support/one_tbb_thread.cpp).
constexpr const char* kUnseenByThreadSanitizer = "a loop of several threads";

class BackgroundJobTest : public testing::Test {
 protected:
  void SetUp() override {
    if (tbb::info::default_concurrency() < 2) GTEST_SKIP() << "one core";
  }
  const int nice_ = niceOfThisThread();  // of the test, perhaps run by nice(1)
};

/// Whoever used TBB's threads first.
TEST_F(BackgroundJobTest, AllOfItsThreadsHaveLowPriorityAndThoseThatDrawHaveNot) {
  if (kHasThreadSanitizer) GTEST_SKIP() << kUnseenByThreadSanitizer;
  for (const bool draws_first : {false, true}) {
    if (draws_first) {
      EXPECT_EQ(threadsOfALoop().nices, std::set{nice_});
    }
    const Threads converting = threadsOfAJob();
    EXPECT_EQ(converting.nices, std::set{std::max(nice_, 10)});
    EXPECT_EQ(converting.ids.size(), 2u);
    EXPECT_EQ(threadsOfALoop().nices, std::set{nice_});  // so they are others
  }
}

TEST_F(BackgroundJobTest, AllCoresWorkOnIt) {
  if (kHasThreadSanitizer) GTEST_SKIP() << kUnseenByThreadSanitizer;
  const auto cores = static_cast<size_t>(tbb::info::default_concurrency());
  std::mutex mutex;
  std::set<std::thread::id> ids;
  BackgroundJob job(
      "job", "beginning",
      [&](Progress&) {
        std::latch all(static_cast<std::ptrdiff_t>(cores));
        tbb::parallel_for(
            tbb::blocked_range<size_t>(0, cores, 1),
            [&](const tbb::blocked_range<size_t>&) {
              {
                const std::lock_guard lock(mutex);
                ids.insert(std::this_thread::get_id());
              }
              all.arrive_and_wait();
            },
            tbb::simple_partitioner());
        return std::filesystem::path();
      },
      nobody);
  EXPECT_TRUE(eventually([&] { return job.isDone(); }));
  EXPECT_EQ(ids.size(), cores);
}

TEST_F(BackgroundJobTest, SaysHowFarItIs) {
  std::latch looked(1);
  BackgroundJob job(
      "saving a.mp4", "beginning",
      [&](Progress& progress) {
        progress.begin("sorting splats", 4, "splats");
        progress.advance(1);
        looked.wait();
        progress.end();
        return std::filesystem::path();
      },
      nobody);
  EXPECT_EQ(job.title(), "saving a.mp4");
  EXPECT_TRUE(eventually([&] { return job.phase() == "sorting splats"; }));
  EXPECT_GE(job.part(), 0);
  EXPECT_LE(job.part(), 0.25f);
  looked.count_down();
  EXPECT_TRUE(eventually([&] { return job.isDone(); }));
}

TEST_F(BackgroundJobTest, ThrowsWhatItsWorkThrows) {
  if (kHasThreadSanitizer) GTEST_SKIP() << kUnseenByThreadSanitizer;
  BackgroundJob job(
      "job", "beginning",
      [](Progress&) -> std::filesystem::path {
        tbb::parallel_for(0, 100, [](int n) {
          if (n == 50) throw std::runtime_error("the fiftieth");
        });
        return {};
      },
      nobody);
  EXPECT_TRUE(eventually([&] { return job.isDone(); }));
  EXPECT_THROW(job.get(), std::runtime_error);
}

TEST_F(BackgroundJobTest, EndsWhenItIsStopped) {
  std::latch begun(1);
  bool interrupted = false;
  {
    BackgroundJob job(
        "job", "beginning",
        [&](Progress& progress) -> std::filesystem::path {
          begun.count_down();
          try {
            while (true) {
              progress.throwIfStopped();
              std::this_thread::yield();
            }
          } catch (const Interrupted&) {
            interrupted = true;
            throw;
          }
        },
        nobody);
    begun.wait();
  }
  EXPECT_TRUE(interrupted);
}

/// Pictures of a movie are counted for the user, bytes of a conversion are not.
TEST_F(BackgroundJobTest, CountsPictures) {
  const auto phaseOf = [](const char* phase, uint64_t total, const char* unit) {
    BackgroundJob job(
        "job", "beginning",
        [=](Progress& progress) {
          progress.begin(phase, total, unit);
          progress.advance(std::min<uint64_t>(total, 12));
          return std::filesystem::path("done");
        },
        nobody);
    EXPECT_TRUE(eventually([&] { return job.isDone(); }));
    return job.phase();
  };
  EXPECT_EQ(phaseOf("drawing pictures", 90, kPicturesUnit), "drawing pictures, 12 of 90");
  EXPECT_EQ(phaseOf("drawing pictures", 1, kPicturesUnit), "drawing pictures");
  EXPECT_EQ(phaseOf("seams", 90, "nodes"), "joining blocks");  // a pass of Conversion
  EXPECT_EQ(phaseOf("sorting splats", 90, "splats"), "sorting splats");
}

TEST_F(BackgroundJobTest, AnOpeningHandsOnWhatItIsTold) {
  Opening opening(
      "opening a.xyz",
      [](Progress&, const OpeningEvents& events) {
        events.say("a note");
        Preview preview;
        preview.what = "every 2nd index plane";
        events.preview(preview);
        return std::filesystem::path("a.splats");
      },
      nobody);
  EXPECT_TRUE(eventually([&] { return opening.isDone(); }));
  EXPECT_EQ(opening.takeMessages(), std::vector<std::string>{"a note"});
  EXPECT_EQ(opening.takePreview().value().what, "every 2nd index plane");
  EXPECT_FALSE(opening.takePreview());
  EXPECT_EQ(opening.get(), "a.splats");
}

}  // namespace
}  // namespace curvisplat
