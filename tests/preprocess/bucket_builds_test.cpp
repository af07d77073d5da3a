// Building and appending buckets that these tests make up: their cells hold no records.
#include "preprocess/convert/bucket_builds.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <condition_variable>
#include <mutex>
#include <numeric>
#include <random>
#include <stdexcept>

namespace curvisplat {
namespace {

struct Stopped : std::runtime_error {
  Stopped() : std::runtime_error("stopped") {}
};

/// Buckets of `cells` cells each, numbered from 0 through all of them.
class MadeUpBuckets {
 public:
  explicit MadeUpBuckets(std::vector<uint32_t> cells) : cells_of_(std::move(cells)) {
    for (size_t n = 0; n < loaded_.size(); ++n) loaded_[n].bucket = static_cast<uint32_t>(n);
  }

  uint32_t cells() const { return std::accumulate(cells_of_.begin(), cells_of_.end(), 0u); }

  BucketBuilds::Stages stages() {
    return {[this] { return take(); }, [this] { giveBack(); },
            [this](LoadedBucket& loaded) { return jobsOf(loaded.bucket); },
            [this](const CellJob& job) { return build(job.unit); },
            [this](uint32_t unit, BuiltCell&& cell) { append(unit, cell); }};
  }

  std::function<void(uint32_t unit)> on_build = [](uint32_t) {}, on_append = on_build, on_take = on_build;
  uint32_t too_large = UINT32_MAX;
  std::vector<uint32_t> appended;
  size_t most_taken = 0,
         most_waiting = 0;  // buckets that were not given back; cells that were built and not appended

 private:
  LoadedBucket* take() {
    on_take(taken_);
    if (taken_ == cells_of_.size()) return nullptr;
    const std::lock_guard lock(mutex_);
    loaded_[taken_].too_large = taken_ == too_large;
    ++taken_;
    most_taken = std::max(most_taken, taken_ - given_back_);
    return &loaded_[taken_ - 1];
  }

  void giveBack() {
    const std::lock_guard lock(mutex_);
    ++given_back_;
    EXPECT_LE(given_back_, taken_);
  }

  BucketJobs jobsOf(uint32_t bucket) {
    EXPECT_EQ(bucket, next_bucket_++);
    BucketJobs jobs;
    for (uint32_t n = 0; n < cells_of_[bucket]; ++n) jobs.cells.push_back({next_cell_++, {}});
    return jobs;
  }

  BuiltCell build(uint32_t unit) {
    // Threads that wait for the parts of a cell may take other tasks.
    std::atomic<size_t> parts = 0;
    tbb::parallel_for(0, 8, [&](int) { ++parts; });
    EXPECT_EQ(parts, 8u);
    on_build(unit);
    const std::lock_guard lock(mutex_);
    ++waiting_;
    most_waiting = std::max(most_waiting, waiting_);
    return {{}, unit, 0};
  }

  void append(uint32_t unit, const BuiltCell& cell) {
    EXPECT_EQ(cell.own_bricks, unit);
    EXPECT_FALSE(is_appending_.exchange(true));
    on_append(unit);
    appended.push_back(unit);
    is_appending_ = false;
    const std::lock_guard lock(mutex_);
    --waiting_;
  }

  const std::vector<uint32_t> cells_of_;
  std::vector<LoadedBucket> loaded_ = std::vector<LoadedBucket>(cells_of_.size());
  std::mutex mutex_;
  size_t taken_ = 0, given_back_ = 0, waiting_ = 0;
  uint32_t next_bucket_ = 0, next_cell_ = 0;
  std::atomic<bool> is_appending_ = false;
};

std::vector<uint32_t> firstNumbers(uint32_t count) {
  std::vector<uint32_t> numbers(count);
  std::iota(numbers.begin(), numbers.end(), 0u);
  return numbers;
}

/// A gate that threads wait at until another opens it.
class Gate {
 public:
  void open() {
    const std::lock_guard lock(mutex_);
    is_open_ = true;
    opened_.notify_all();
  }
  /// Whether it was opened within a time that is long beyond doubt.
  bool pass() {
    std::unique_lock lock(mutex_);
    return opened_.wait_for(lock, std::chrono::seconds(60), [this] { return is_open_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable opened_;
  bool is_open_ = false;
};

/// Runs `work` with as many threads of TBB's, whatever the machine has.
template <typename Work>
void withThreads(int threads, const Work& work) {
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism,
                                    static_cast<size_t>(threads));
  tbb::task_arena arena(threads);
  arena.execute(work);
}

TEST(BucketBuilds, AppendsAllCellsInOrderAndHoldsTwoBuckets) {
  std::mt19937 random(7);
  for (const int threads : {1, 2, 3, 8}) {
    SCOPED_TRACE(threads);
    std::vector<uint32_t> cells(100);
    for (uint32_t& count : cells) count = static_cast<uint32_t>(random() % 6);  // 0: all of it was carried
    MadeUpBuckets buckets(cells);
    withThreads(threads, [&] { EXPECT_EQ(BucketBuilds(buckets.stages()).run(), std::nullopt); });
    EXPECT_EQ(buckets.appended, firstNumbers(buckets.cells()));
    EXPECT_LE(buckets.most_taken, 2u);
    EXPECT_LE(buckets.most_waiting, 2 * 5u);
  }
}

TEST(BucketBuilds, BeginsABucketWhileTheLastCellOfTheOneBeforeIsBuilt) {
  for (const int threads : {2, 8}) {
    SCOPED_TRACE(threads);
    MadeUpBuckets buckets({1, 1, 3, 1});
    Gate gate;
    buckets.on_build = [&](uint32_t unit) {
      if (unit == 0) {
        EXPECT_TRUE(gate.pass());
      }
      if (unit == 1) gate.open();
    };
    withThreads(threads, [&] { BucketBuilds(buckets.stages()).run(); });
    EXPECT_EQ(buckets.appended, firstNumbers(6));
  }
}

TEST(BucketBuilds, BuildsWhileItAppends) {
  MadeUpBuckets buckets({1, 1});
  Gate gate;
  buckets.on_append = [&](uint32_t unit) {
    if (unit == 0) {
      EXPECT_TRUE(gate.pass());
    }
  };
  buckets.on_build = [&](uint32_t unit) {
    if (unit == 1) gate.open();
  };
  withThreads(2, [&] { BucketBuilds(buckets.stages()).run(); });
  EXPECT_EQ(buckets.appended, firstNumbers(2));
}

TEST(BucketBuilds, EndsBeforeABucketThatIsTooLarge) {
  for (const int threads : {1, 4}) {
    for (const uint32_t too_large : {0u, 2u, 4u}) {
      SCOPED_TRACE(too_large);
      MadeUpBuckets buckets({2, 2, 2, 2, 2});
      buckets.too_large = too_large;
      withThreads(threads, [&] { EXPECT_EQ(BucketBuilds(buckets.stages()).run(), too_large); });
      EXPECT_EQ(buckets.appended, firstNumbers(2 * too_large));
    }
  }
}

TEST(BucketBuilds, ThrowsWhatAStageThrowsWhicheverCallDoes) {
  for (const int threads : {1, 2, 8}) {
    for (uint32_t failing = 0; failing < 12; ++failing) {
      SCOPED_TRACE(failing);
      const auto failingOf = [&](MadeUpBuckets& buckets, std::function<void(uint32_t)>& stage) {
        stage = [failing](uint32_t n) {
          if (n == failing) throw Stopped();
        };
        withThreads(threads, [&] { EXPECT_THROW(BucketBuilds(buckets.stages()).run(), Stopped); });
        // In order, up to what has failed.
        EXPECT_EQ(buckets.appended, firstNumbers(static_cast<uint32_t>(buckets.appended.size())));
      };
      MadeUpBuckets of_building({3, 0, 1, 5, 1, 2}), of_appending({3, 0, 1, 5, 1, 2});
      MadeUpBuckets of_taking(std::vector<uint32_t>(12, 2));
      failingOf(of_building, of_building.on_build);
      failingOf(of_appending, of_appending.on_append);
      EXPECT_EQ(of_appending.appended, firstNumbers(failing));
      failingOf(of_taking, of_taking.on_take);
    }
  }
}

}  // namespace
}  // namespace curvisplat
