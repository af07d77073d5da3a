#include "preprocess/convert/bucket_builds.h"

#include <tbb/task_arena.h>

#include <utility>

#include "stream/base/freed_memory.h"

namespace curvisplat {

struct BucketBuilds::Bucket {
  explicit Bucket(BucketJobs&& bucket_jobs)
      : jobs(std::move(bucket_jobs)),
        cells(jobs.cells.size()),
        not_begun(jobs.cells.size()),
        not_ended(jobs.cells.size()) {}

  BucketJobs jobs;
  std::vector<BuiltCell> cells;  // [job]
  std::atomic<size_t> not_begun, not_ended;
  bool is_built = false;  // guarded by BucketBuilds::mutex_
};

BucketBuilds::BucketBuilds(Stages stages) : stages_(std::move(stages)) {}

BucketBuilds::~BucketBuilds() = default;

std::optional<uint32_t> BucketBuilds::run() {
  run([this] { startNext(); });
  tasks_.wait();  // a task that throws ends the others: none begins any more
  return too_large_;
}

/// One at a time: called again once all cells of this bucket have begun.
void BucketBuilds::startNext() {
  LoadedBucket* const loaded = stages_.take();
  if (!loaded) return;
  if (loaded->too_large) {
    too_large_ = loaded->bucket;
    return;
  }
  auto next = std::make_unique<Bucket>(stages_.jobs_of(*loaded));
  Bucket& bucket = *next;
  {
    const MutexLock lock(mutex_);
    buckets_.push_back(std::move(next));
  }
  const size_t cells = bucket.jobs.cells.size();
  if (cells == 0) {
    noteBegun();
    noteBuilt(bucket);
    return;
  }
  for (size_t n = 0; n < cells; ++n) run([this, &bucket, n] { build(bucket, n); });
}

void BucketBuilds::build(Bucket& bucket, size_t cell) {
  if (--bucket.not_begun == 0) noteBegun();
  // While this thread waits for parts of the cell, it may not begin another, which would keep it from this one.
  tbb::this_task_arena::isolate([&] { bucket.cells[cell] = stages_.build(bucket.jobs.cells[cell]); });
  if (--bucket.not_ended == 0) noteBuilt(bucket);
}

void BucketBuilds::noteBegun() {
  const MutexLock lock(mutex_);
  latest_has_begun_ = true;
  startNextIfDue();
}

/// If no more than one other is on its way: a third would take more memory.
void BucketBuilds::startNextIfDue() {
  if (!latest_has_begun_ || buckets_.size() > 1) return;
  latest_has_begun_ = false;
  run([this] { startNext(); });
}

void BucketBuilds::noteBuilt(Bucket& bucket) {
  freeMemory(bucket.jobs.carried);
  freeMemory(bucket.jobs.carried_places);
  {
    const MutexLock lock(mutex_);
    bucket.is_built = true;
    for (; given_back_ < buckets_.size() && buckets_[given_back_]->is_built; ++given_back_)
      stages_.give_back();
  }
  appendBuilt();
}

/// Appends the first buckets as far as they are built, unless another thread does, or has failed to.
void BucketBuilds::appendBuilt() {
  MutexLock lock(mutex_);
  if (is_appending_) return;
  is_appending_ = true;
  while (!buckets_.empty() && buckets_.front()->is_built) {
    Bucket& bucket = *buckets_.front();
    lock.unlock();
    append(bucket);
    lock.lock();
    buckets_.pop_front();
    --given_back_;
    startNextIfDue();
  }
  is_appending_ = false;
}

void BucketBuilds::append(Bucket& bucket) {
  tbb::this_task_arena::isolate([&] {  // as in build()
    for (size_t n = 0; n < bucket.cells.size(); ++n)
      stages_.append(bucket.jobs.cells[n].unit, std::move(bucket.cells[n]));
  });
}

}  // namespace curvisplat
