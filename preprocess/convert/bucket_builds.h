// Buckets in memory, and their cells as bricks. BucketLoader reads the buckets of a temporary file ahead of
// the work, and groups the records of each by the cells that are to be built. BucketBuilds has all threads
// build the cells of bucket after bucket, and appends the results in order.
//
//   BucketLoader --take--> jobs of a bucket --tasks, two buckets at a time--> cells --in order--> append
//                                                |
//                                                +--> give back, as soon as all cells of a bucket are built
//
// Two buckets are in memory at most. What is appended depends on the splats alone, not on threads.
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

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_plan.h"
#include "preprocess/convert/build_cell.h"
#include "preprocess/grid/read_ahead.h"
#include "stream/base/compute_permits.h"
#include "stream/base/memory.h"
#include "stream/base/mutex.h"
#include "stream/base/threads.h"

namespace curvisplat {

/// The node of the tree that is built as a whole from the records in `leaf`: the leaf itself, or the highest
/// node above it that fits a brick, or whose splats all coincide. It depends on the splats alone, where the
/// leaf depends on the plan.
uint32_t buildUnitOf(const BucketTree& tree, uint32_t leaf);

struct LoadedBucket {
  struct Part {
    uint32_t unit = 0;  // node of the tree
    size_t begin = 0, count = 0;
  };

  uint32_t bucket = 0;
  bool too_large = false;  // has more records than allowed: nothing is loaded
  UnfilledArray<std::byte> bytes;
  UnfilledArray<uint32_t> places;  // of the records: RecordSpan's
  std::vector<Part> parts;         // of `places`, in Morton order

  RecordSpan records(const Part& part) {
    return {bytes.data(), places.span().subspan(part.begin, part.count)};
  }
};

/// The buckets first .. end - 1.
struct BucketRange {
  uint32_t first = 0, end = 0;
};

/// Loads the buckets of a range that are not empty, in order. Ends after one that is too large, so that its
/// division has the memory for itself. Several threads load a bucket together: one alone would take longer
/// than 16 take to build it. In memory are two buckets of `most_bytes`, 4 bytes a record of three, and a
/// chunk for each reader. Tree and file must not change meanwhile.
class BucketLoader {
 public:
  /// `readers`: threads that load a bucket, 1 to BucketChains::kCount. One does if the system cannot start
  /// the others.
  BucketLoader(const BucketTree& tree, const BucketFile& file, size_t variables, const BucketRange& range,
               uint64_t most_bytes, unsigned readers);
  ~BucketLoader();

  /// The next bucket, until it is given back; null at the end. Throws Error if the disk fails. Two may be
  /// taken. One thread at a time.
  LoadedBucket* acquire() { return ahead_.acquire(); }
  /// Gives back the bucket that was taken first of those not given back. Any thread.
  void giveBack() { ahead_.giveBack(); }

 private:
  struct Reader;

  bool fill(LoadedBucket& loaded);
  void read(LoadedBucket& loaded);
  void sortParts(LoadedBucket& loaded);
  void place(LoadedBucket& loaded);
  void forEachReader(const std::function<void(Reader&, size_t)>& job);

  const BucketTree* tree_;
  const BucketFile* file_;
  const size_t variables_;
  uint32_t position_;
  const uint32_t end_;
  const uint64_t most_bytes_;
  bool ended_ = false;
  std::unique_ptr<WorkerTeam> team_;  // of all readers but the first, which is the thread that reads ahead
  std::vector<Reader> readers_;
  // Tags of records, by the record's place in the bucket over the least bytes of a record, which no two
  // share: 2 x its part among its reader's, and 1 if it is irregular.
  UnfilledArray<uint32_t> tags_;
  ReadAhead<LoadedBucket> ahead_;  // last: its thread uses the others
};

/// A cell that is built as a whole.
struct CellJob {
  uint32_t unit = 0;  // node of the bucket tree
  RecordSpan records;
};

/// The jobs that build a bucket, in Morton order.
struct BucketJobs {
  std::vector<CellJob> cells;
  // The records of cells that began in earlier buckets, and the places of these records.
  std::vector<std::vector<std::byte>> carried;
  std::vector<std::vector<uint32_t>> carried_places;
};

/// Builds the cells of bucket after bucket. While the last cells of a bucket are being built, threads that
/// are free begin those of the next one; what was built is appended in order, by one thread at a time. A
/// bucket has few cells that are built as a whole, sometimes one, and each ends in a chain of merges that
/// one thread makes: with 16 threads that would be a third of the time.
class BucketBuilds {
 public:
  struct Stages {
    /// The next bucket, valid until it is given back; null at the end. May wait until those are given back
    /// that were taken before the last.
    std::function<LoadedBucket*()> take;
    /// Gives back the bucket that was taken first of those not given back.
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

  /// Builds all buckets up to the first that is too large, and returns its number. Throws what a stage has
  /// thrown, when all tasks have ended. Once, in a thread of TBB's arena that shall do the work.
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
