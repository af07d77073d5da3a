#include "stream/paging/pager.h"

#include <algorithm>
#include <cerrno>
#include <new>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/mirror.h"
#include "stream/base/threads.h"
#include "stream/cache/cache_format.h"

namespace curvisplat {
namespace {

// The buffer is shared by this many batches, or twice as many: some are read while some are decoded.
constexpr uint64_t kBatchesInBuffer = 8;

// A read that the kernel puts off (EAGAIN, EINTR) this many times in a row has failed.
constexpr uint8_t kMaxPutOff = 100;

BrickExtents extentsOf(const CacheReader& cache, const ReadVariables& variables, uint32_t brick) {
  return {cache.bricks()[brick].geometry, cache.brickVariables(variables.first)[brick].values,
          variables.second ? cache.brickVariables(*variables.second)[brick].values : Extent{}};
}

/// `file`: one of those to be read.
std::unique_ptr<AsyncReads> makeReads(const PagerOptions& options, const std::filesystem::path& file) {
  using Way = PagerOptions::Way;
  if (options.reads) return options.reads(options.queue_depth);
  if (options.way != Way::kThreads && !isMirrored(file) &&
      (SystemCalls::areReal() || options.way == Way::kIoUring)) {
    if (auto reads = makeUringReads(options.queue_depth)) return reads;
    if (options.way == Way::kIoUring) throw Error("this system refuses io_uring");
  }
  return makeThreadReads(options.queue_depth);
}

uint64_t roundedToPages(uint64_t bytes) {
  return (bytes + kPageBytes - 1) / kPageBytes * kPageBytes;
}

}  // namespace

PagedBrick::PagedBrick(PagedBrick&& other) noexcept
    : pager_(std::exchange(other.pager_, nullptr)),
      sequence_(other.sequence_),
      readable_(other.readable_),
      left_out_(other.left_out_),
      streams_(other.streams_) {}

PagedBrick::~PagedBrick() {
  if (pager_) pager_->giveBack(sequence_);
}

BrickPager::BrickPager(const CacheReader& cache, const ReadVariables& variables, const PagerOptions& options)
    : cache_(cache),
      variables_(variables),
      depth_(options.queue_depth),
      direct_(options.direct),
      capacity_(roundedToPages(options.buffer_bytes)),
      files_{std::make_unique<DirectFile>(cache.geometryPath(), options.direct),
             std::make_unique<DirectFile>(cache.valuesPath(variables.first), options.direct),
             variables.second
                 ? std::make_unique<DirectFile>(cache.valuesPath(*variables.second), options.direct)
                 : nullptr},
      buffer_(static_cast<std::byte*>(std::aligned_alloc(kPageBytes, capacity_))),
      reads_(makeReads(options, cache.geometryPath())),
      under_way_(depth_) {
  CURVISPLAT_CHECK_OP(depth_, >=, 1u);
  if (!buffer_) throw std::bad_alloc();
  for (uint64_t tag = 0; tag < depth_; ++tag) free_tags_.push_back(tag);
  thread_ = std::thread([this] { loop(); });
}

BrickPager::~BrickPager() {
  stop();
  {
    const MutexLock lock(mutex_);
    state_ = State::kEnding;
  }
  reads_->wake();
  thread_.join();
}

uint64_t BrickPager::leastBufferBytes(const CacheReader& cache, const ReadVariables& variables) {
  uint64_t most = kPageBytes;
  for (uint32_t brick = 0; brick < cache.bricks().size(); ++brick)
    most = std::max(most, pagedBytes(extentsOf(cache, variables, brick)));
  return most;
}

void BrickPager::start(std::vector<uint32_t> bricks, Unneeded unneeded) {
  MutexLock lock(mutex_);
  awaitIdle(lock);
  first_batch_ += batches_.size();
  next_batch_ = first_batch_;
  batches_.clear();
  waiting_.reset();
  planned_ = end_ = 0;
  bricks_ = std::move(bricks);
  unneeded_ = std::move(unneeded);
  left_out_.assign(bricks_.size(), 0);
  extents_.clear();
  extents_.reserve(bricks_.size());
  for (const uint32_t brick : bricks_) extents_.push_back(extentsOf(cache_, variables_, brick));
  state_ = State::kReading;
  reads_->wake();
}

void BrickPager::stepChanged() {
  MutexLock lock(mutex_);
  awaitIdle(lock);
  files_[1] = std::make_unique<DirectFile>(cache_.valuesPath(variables_.first), direct_);
  if (variables_.second)
    files_[2] = std::make_unique<DirectFile>(cache_.valuesPath(*variables_.second), direct_);
}

void BrickPager::stop() {
  const MutexLock lock(mutex_);
  haltReading();
  arrived_.notify_all();
}

void BrickPager::haltReading() {
  if (state_ == State::kReading) state_ = State::kStopped;
}

/// Stops, and waits until no read is under way. Throws the failure that broke reading.
void BrickPager::awaitIdle(MutexLock& lock) {
  haltReading();
  while (state_ != State::kBroken && reads_under_way_ > 0) idle_.wait(lock);
  if (state_ == State::kBroken) std::rethrow_exception(failure_);
  CURVISPLAT_CHECK_OP(lent_, ==, 0u);
}

std::optional<PagedBrick> BrickPager::fetch(uint64_t sequence) {
  MutexLock lock(mutex_);
  CURVISPLAT_CHECK(state_ != State::kReading || sequence < extents_.size());
  while (state_ == State::kReading && !hasArrived(sequence)) arrived_.wait(lock);
  if (state_ == State::kBroken) std::rethrow_exception(failure_);
  if (state_ != State::kReading) return {};
  if (left_out_[sequence]) return PagedBrick::leftOut();
  const Batch& batch = batchOf(sequence);
  const size_t n = sequence - batch.first;
  const BatchBrick& brick = batch.plan.bricks[n];
  const std::byte* bytes = buffer_.get() + batch.begin % capacity_;
  ++lent_;
  if (!batch.readable[n]) {
    ++statistics_.bricks_unreadable;
    return PagedBrick(*this, sequence, std::nullopt);
  }
  std::array<std::span<const std::byte>, kBrickStreams> streams;
  for (size_t stream = 0; stream < kBrickStreams; ++stream)
    if (const uint32_t length = extents_[sequence][stream].length; length > 0)
      streams[stream] = {bytes + brick.place[stream], length};
  return PagedBrick(*this, sequence, streams);
}

PagerStatistics BrickPager::statistics() const {
  const MutexLock lock(mutex_);
  return statistics_;
}

std::string BrickPager::way() const {
  const MutexLock lock(mutex_);
  const bool direct = !direct_refused_ && files_[0]->isDirect() && files_[1]->isDirect();
  return std::string(reads_->name()) + (direct ? ", direct" : ", through the page cache");
}

void BrickPager::loop() {
  nameThisThread("pager");
  try {
    MutexLock lock(mutex_);
    while (state_ != State::kEnding) {
      if (state_ == State::kReading) {
        planAhead();
        submitReads();
      }
      lock.unlock();
      const auto end = reads_->wait();
      lock.lock();
      if (end) complete(*end);
    }
  } catch (...) {
    const MutexLock lock(mutex_);
    failure_ = std::current_exception();
    state_ = State::kBroken;
    arrived_.notify_all();
    idle_.notify_all();
  }
}

void BrickPager::planAhead() {
  wants_space_ = false;
  if (unneeded_) waiting_.reset();  // some of it may be unneeded by now
  while (planned_ < extents_.size()) {
    if (!waiting_) {
      const std::span<const BrickExtents> needed = nextNeeded();
      if (needed.empty()) return;
      waiting_ = planBatch(needed, capacity_ / kBatchesInBuffer);
    }
    const auto begin = spaceFor(waiting_->bytes);
    if (!begin) {
      wants_space_ = true;
      return;
    }
    Batch& batch = batches_.emplace_back();
    batch.plan = *std::exchange(waiting_, {});
    batch.first = planned_;
    batch.begin = *begin;
    batch.done.assign(batch.plan.reads.size(), 0);
    batch.put_off.assign(batch.plan.reads.size(), 0);
    batch.missing.clear();
    for (const BatchBrick& brick : batch.plan.bricks)
      batch.missing.push_back(static_cast<uint8_t>(
          kBrickStreams - std::count(brick.read.begin(), brick.read.end(), BatchBrick::kNoRead)));
    batch.readable.assign(batch.plan.bricks.size(), 1);
    batch.kept = static_cast<uint32_t>(batch.plan.bricks.size());
    planned_ += batch.kept;
    end_ = *begin + batch.plan.bytes;
    statistics_.peak_bytes = std::max(statistics_.peak_bytes, end_ - batches_.front().begin);
  }
}

/// Leaves out what is not needed of the bricks not planned yet; those that then follow one another.
std::span<const BrickExtents> BrickPager::nextNeeded() {
  const std::span<const BrickExtents> all(extents_);
  if (!unneeded_) return all.subspan(planned_);
  const uint64_t before = planned_;
  while (planned_ < all.size() && unneeded_(bricks_[planned_])) {
    for (const Extent& extent : all[planned_]) statistics_.bytes_left_out += extent.length;
    ++statistics_.bricks_left_out;
    left_out_[planned_++] = 1;
  }
  if (planned_ > before) arrived_.notify_all();
  size_t count = 0;
  while (count < kMaxBatchBricks && planned_ + count < all.size() && !unneeded_(bricks_[planned_ + count]))
    ++count;
  return all.subspan(planned_, count);
}

std::optional<uint64_t> BrickPager::spaceFor(uint64_t bytes) const {
  CURVISPLAT_CHECK_OP(bytes, <=, capacity_);
  const uint64_t next_lap = (end_ + capacity_ - 1) / capacity_ * capacity_;
  if (batches_.empty()) return next_lap;
  const uint64_t begin = end_ % capacity_ + bytes > capacity_ ? next_lap : end_;
  if (begin + bytes - batches_.front().begin > capacity_) return {};
  return begin;
}

void BrickPager::submitReads() {
  while (!free_tags_.empty() && next_batch_ < first_batch_ + batches_.size()) {
    Batch& batch = batches_[next_batch_ - first_batch_];
    if (batch.next_read == batch.plan.reads.size()) {
      ++next_batch_;
    } else {
      const uint32_t read = batch.next_read++;
      submit(next_batch_, read, !direct_refused_ && files_[batch.plan.reads[read].stream]->isDirect());
    }
  }
}

void BrickPager::submit(uint64_t number, uint32_t read_number, bool direct) {
  const Batch& batch = batches_[number - first_batch_];
  const BatchRead& read = batch.plan.reads[read_number];
  const DirectFile& file = *files_[read.stream];
  const uint32_t done = batch.done[read_number];
  const uint64_t tag = free_tags_.back();
  free_tags_.pop_back();
  under_way_[tag] = {number, read_number, direct};
  countReads(1);
  ++statistics_.requests;
  // Through the page cache no more than what is needed: the pages are whole in memory only.
  reads_->submit({direct ? file.directFd() : file.bufferedFd(), read.offset + done,
                  buffer_.get() + batch.begin % capacity_ + read.place + done,
                  (direct ? read.length : read.needed) - done, tag});
}

void BrickPager::complete(const AsyncReadEnd& end) {
  const UnderWay read = under_way_[end.tag];
  free_tags_.push_back(end.tag);
  countReads(-1);
  if (reads_under_way_ == 0) idle_.notify_all();
  if (state_ != State::kReading) return;
  Batch& batch = batches_[read.batch - first_batch_];
  uint32_t& done = batch.done[read.read];
  const bool is_put_off = end.result == -EINTR || end.result == -EAGAIN;
  uint8_t& put_off = batch.put_off[read.read];
  put_off = is_put_off ? static_cast<uint8_t>(put_off + 1) : uint8_t{0};
  if (is_put_off && put_off < kMaxPutOff) {
    submit(read.batch, read.read, read.direct);
  } else if (end.result == -EINVAL && read.direct) {
    direct_refused_ = true;
    submit(read.batch, read.read, false);
  } else if (end.result <= 0) {
    finishRead(batch, read.read, false);
  } else {
    statistics_.bytes += static_cast<uint64_t>(end.result);
    done += static_cast<uint32_t>(end.result);
    if (done >= batch.plan.reads[read.read].needed)
      finishRead(batch, read.read, true);
    else
      submit(read.batch, read.read, read.direct && done % kPageBytes == 0);
  }
}

void BrickPager::finishRead(Batch& batch, uint32_t read, bool good) {
  bool arrived = false;
  for (size_t n = batch.plan.reads[read].first; n < batch.plan.bricks.size(); ++n)
    for (const uint32_t waited_for : batch.plan.bricks[n].read) {
      if (waited_for != read) continue;
      batch.readable[n] &= good;
      arrived |= --batch.missing[n] == 0;
    }
  if (arrived) arrived_.notify_all();
}

bool BrickPager::hasArrived(uint64_t sequence) {
  if (sequence >= planned_) return false;
  if (left_out_[sequence]) return true;
  const Batch& batch = batchOf(sequence);
  return batch.missing[sequence - batch.first] == 0;
}

void BrickPager::giveBack(uint64_t sequence) {
  const MutexLock lock(mutex_);
  --lent_;
  --batchOf(sequence).kept;
  while (!batches_.empty() && batches_.front().kept == 0) {
    batches_.pop_front();
    ++first_batch_;
  }
  next_batch_ = std::max(next_batch_, first_batch_);
  if (wants_space_) reads_->wake();
}

BrickPager::Batch& BrickPager::batchOf(uint64_t sequence) {
  const auto after = std::upper_bound(batches_.begin(), batches_.end(), sequence,
                                      [](uint64_t s, const Batch& batch) { return s < batch.first; });
  return *std::prev(after);
}

/// Called before the number of reads under way changes.
void BrickPager::countReads(int change) {
  const auto now = std::chrono::steady_clock::now();
  if (reads_under_way_ > 0) {
    const double seconds = std::chrono::duration<double>(now - counted_).count();
    statistics_.reading_s += seconds;
    statistics_.depth_s += seconds * reads_under_way_;
  }
  counted_ = now;
  reads_under_way_ += static_cast<unsigned>(change);
}

}  // namespace curvisplat
