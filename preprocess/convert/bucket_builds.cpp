#include "preprocess/convert/bucket_builds.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <system_error>
#include <utility>

#include "preprocess/convert/splat_record.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"
#include "stream/base/memory.h"
#include "stream/base/trace.h"
#include "stream/model/octree.h"

namespace curvisplat {
namespace {

/// Finds the unit of one record after the other; neighbours are mostly in the same leaf.
class UnitFinder {
 public:
  explicit UnitFinder(const BucketTree& tree) : tree_(&tree) {}
  uint32_t unitOf(const RootPosition& position) {
    if (unit_ == BucketTree::kNone || !(*tree_)[unit_].cell.contains(position))
      unit_ = buildUnitOf(*tree_, tree_->leafOf(position));
    return unit_;
  }

 private:
  const BucketTree* tree_;
  uint32_t unit_ = BucketTree::kNone;
};

/// The first cell of kMaxLevel in `cell`: disjoint cells of any levels compare as these do.
Cell firstDeepest(const Cell& cell) {
  Cell deepest{static_cast<uint32_t>(kMaxLevel), {}};
  for (int axis = 0; axis < 3; ++axis) deepest.at[axis] = cell.at[axis] << (kMaxLevel - cell.level);
  return deepest;
}

/// A team of `count` threads, or an empty one if the system cannot start them.
std::unique_ptr<WorkerTeam> teamOf(unsigned count) {
  try {
    return std::make_unique<WorkerTeam>(count, "bucket-reader");
  } catch (const std::system_error&) {
    return std::make_unique<WorkerTeam>(0, "bucket-reader");
  }
}

}  // namespace

uint32_t buildUnitOf(const BucketTree& tree, uint32_t leaf) {
  uint32_t unit = leaf;
  for (uint32_t above = tree[leaf].parent; above != BucketTree::kNone; above = tree[above].parent) {
    const CellContents& contents = tree[above].contents;
    if (contents.splats > kMaxBrickSplats && !contents.coincide()) break;
    unit = above;
  }
  return unit;
}

/// One of the threads that load a bucket, and what it has read of the present one.
struct BucketLoader::Reader {
  struct Chunk {
    size_t begin = 0, end = 0;  // in the bucket's bytes
  };
  struct Part {
    uint32_t unit = 0;
    size_t count = 0;
    size_t next = 0;  // of the bucket's places
  };
  std::vector<Chunk> chunks;
  std::vector<Part> parts;
  std::vector<uint32_t> part_of;  // [unit]
  std::exception_ptr error;

  void clear(size_t units) {
    chunks.clear();
    parts.clear();
    part_of.assign(units, BucketTree::kNone);
    error = nullptr;
  }

  uint32_t partOf(uint32_t unit) {
    uint32_t& part = part_of[unit];
    if (part == BucketTree::kNone) {
      part = static_cast<uint32_t>(parts.size());
      parts.push_back({unit, 0, 0});
    }
    return part;
  }
};

BucketLoader::BucketLoader(const BucketTree& tree, const BucketFile& file, size_t variables,
                           const BucketRange& range, uint64_t most_bytes, unsigned readers)
    : tree_(&tree),
      file_(&file),
      variables_(variables),
      position_(range.first),
      end_(range.end),
      most_bytes_(most_bytes),
      team_(teamOf(readers - 1)),
      readers_(team_->size() + 1),
      ahead_([this](LoadedBucket& loaded) { return fill(loaded); }) {}

BucketLoader::~BucketLoader() = default;

bool BucketLoader::fill(LoadedBucket& loaded) {
  while (position_ < end_ && file_->bytes(position_) == 0) ++position_;
  if (position_ == end_ || ended_) return false;
  loaded.bucket = position_++;
  loaded.too_large = ended_ = file_->bytes(loaded.bucket) > most_bytes_;
  loaded.parts.clear();
  if (loaded.too_large) return true;
  read(loaded);
  sortParts(loaded);
  place(loaded);
  return true;
}

/// Calls job(reader, number) in the threads of all readers.
void BucketLoader::forEachReader(const std::function<void(Reader&, size_t)>& job) {
  const auto run = [&](size_t number) {
    try {
      job(readers_[number], number);
    } catch (...) {
      readers_[number].error = std::current_exception();
    }
  };
  team_->start([&, permits = Computing::ofThisThread()](unsigned number) {
    const Computing computing(permits, Urgency::kUrgent);
    run(number + 1);
  });
  run(0);
  {
    const GivenBackPermit given_back;
    const TraceScope trace("wait for readers", TraceKind::kWait);
    team_->wait();
  }
  for (const Reader& reader : readers_)
    if (reader.error) std::rethrow_exception(reader.error);
}

/// Reads the bucket's records, in any order, and finds the part of each: with its length, that is all that
/// placing it takes.
void BucketLoader::read(LoadedBucket& loaded) {
  const size_t bytes = file_->bytes(loaded.bucket), least_record = regularRecordBytes(variables_);
  loaded.bytes.resize(bytes);
  tags_.resize(bytes / least_record + 1);

  std::atomic<size_t> read_bytes = 0;
  forEachReader([&](Reader& reader, size_t number) {
    const TraceScope trace("read bucket");
    reader.clear(tree_->size());
    UnitFinder finder(*tree_);
    for (size_t chain = number; chain < BucketChains::kCount; chain += readers_.size())
      file_->forEachChunk(loaded.bucket, chain, [&](std::span<const std::byte> chunk) {
        const size_t begin = read_bytes.fetch_add(chunk.size()), end = begin + chunk.size();
        CURVISPLAT_CHECK_OP(end, <=, bytes);
        std::copy(chunk.begin(), chunk.end(), &loaded.bytes[begin]);
        reader.chunks.push_back({begin, end});
        for (size_t at = begin; at < end;) {
          const std::byte* const record = &loaded.bytes[at];
          const uint32_t part = reader.partOf(finder.unitOf(recordPosition(record)));
          const bool is_irregular = recordIsIrregular(record);
          ++reader.parts[part].count;
          tags_[at / least_record] = 2 * part + is_irregular;
          at += is_irregular ? irregularRecordBytes(variables_) : least_record;
        }
      });
  });
  CURVISPLAT_CHECK_OP(read_bytes.load(), ==, bytes);
}

/// Puts the parts of all readers into Morton order, and says where each reader's places of them begin.
void BucketLoader::sortParts(LoadedBucket& loaded) {
  std::vector<Reader::Part*> sorted;
  for (Reader& reader : readers_)
    for (Reader::Part& part : reader.parts) sorted.push_back(&part);
  std::stable_sort(sorted.begin(), sorted.end(), [&](const Reader::Part* a, const Reader::Part* b) {
    return mortonLess(firstDeepest((*tree_)[a->unit].cell), firstDeepest((*tree_)[b->unit].cell));
  });
  size_t placed = 0;
  for (Reader::Part* const part : sorted) {
    if (loaded.parts.empty() || loaded.parts.back().unit != part->unit)
      loaded.parts.push_back({part->unit, placed, 0});
    loaded.parts.back().count += part->count;
    part->next = placed;
    placed += part->count;
  }
  loaded.places.resize(placed);
}

/// Notes where the records of each part lie.
void BucketLoader::place(LoadedBucket& loaded) {
  const size_t least_record = regularRecordBytes(variables_);
  forEachReader([&](Reader& reader, size_t) {
    const TraceScope trace("place records");
    for (const Reader::Chunk& chunk : reader.chunks)
      for (size_t at = chunk.begin; at < chunk.end;) {
        const uint32_t tag = tags_[at / least_record];
        loaded.places[reader.parts[tag / 2].next++] = static_cast<uint32_t>(at);
        at += tag % 2 ? irregularRecordBytes(variables_) : least_record;
      }
  });
}

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
  // While this thread waits for parts of the cell, it may not begin another, which would keep it from this
  // one.
  tbb::this_task_arena::isolate([&] { bucket.cells[cell] = stages_.build(bucket.jobs.cells[cell]); });
  if (--bucket.not_ended == 0) noteBuilt(bucket);
}

void BucketBuilds::noteBegun() {
  const MutexLock lock(mutex_);
  latest_has_begun_ = true;
  startNextIfDue();
}

/// Starts the next bucket if no more than one other is on its way: a third would take more memory.
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
