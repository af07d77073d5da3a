// Builds the cells of bucket after bucket. Where the last cells of a bucket are being built, threads that are free begin the next
// one's; what was built is appended in order, by one thread at a time.
//
//   take --> jobs of a bucket --tasks, two buckets at a time--> built cells --bucket after bucket--> append
//                                        |
//                                        +--> give back, as soon as all cells of a bucket are built
//
// A bucket has few cells that are built as a whole, sometimes one, and each ends in a chain of merges that one thread makes. With
// 16 threads that would be a third of the time.
#pragma once

#include <tbb/task_group.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "preprocess/convert/bucket_loader.h"
#include "preprocess/convert/build_cell.h"
#include "stream/base/compute_permits.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// A cell that is built as a whole.
struct CellJob {
  uint32_t unit = 0;  // node of the bucket tree
  RecordSpan records;
};

/// What is built of a bucket, in Morton order.
struct BucketJobs {
  std::vector<CellJob> cells;
  // Of cells that began in earlier buckets: their records, and the places of these.
  std::vector<std::vector<std::byte>> carried;
  std::vector<std::vector<uint32_t>> carried_places;
};

class BucketBuilds {
 public:
  struct Stages {
    /// The next bucket, valid until it is given back; null at the end. May wait until those are given back that were taken
    /// before the last.
    std::function<LoadedBucket*()> take;
    /// Of those taken, the one that was taken first.
    std::function<void()> give_back;
    /// Called for one bucket after the other, that are not too large.
    std::function<BucketJobs(LoadedBucket&)> jobs_of;
    /// Called by several threads.
    std::function<BuiltCell(const CellJob&)> build;
    /// Called for all cells in the order of the jobs, one at a time, while others are built.
    std::function<void(uint32_t unit, BuiltCell&& cell)> append;
  };

  explicit BucketBuilds(Stages stages);
  ~BucketBuilds();

  /// Builds all buckets up to the first that is too large, and returns its number. Throws what a stage has thrown, when all tasks
  /// have ended. Once, in a thread of TBB's arena that shall do the work.
  std::optional<uint32_t> run();

 private:
  struct Bucket;

  template <typename Task>
  void run(const Task& task) {
    tasks_.run(withPermit(task));
  }
  void startNext();
  void build(Bucket& bucket, size_t cell);
  void noteBegun();
  void startNextIfDue() REQUIRES(mutex_);
  void noteBuilt(Bucket& bucket);
  void appendBuilt();
  void append(Bucket& bucket);

  const Stages stages_;
  tbb::task_group tasks_;
  std::optional<uint32_t> too_large_;

  Mutex mutex_;
  std::deque<std::unique_ptr<Bucket>> buckets_ GUARDED_BY(mutex_);  // that are not yet appended, in order
  size_t given_back_ GUARDED_BY(mutex_) = 0;                        // the first of them that are
  bool latest_has_begun_ GUARDED_BY(mutex_) = false;  // all of its cells are being built, or are built
  bool is_appending_ GUARDED_BY(mutex_) = false;      // one thread does
};

}  // namespace curvisplat
