// Reads the bytes of a frame's bricks ahead of those who decode them, in the frame's order, with several
// reads under way at once.
//
//   start(bricks) ; workers: fetch(n) -> bytes of the n-th brick -> give them back, by dropping them ; stop()
//
// The bytes lie in one buffer of fixed size, which is used as a ring of batches (read_batch.h): space is
// granted to batches in order and freed in order, so that the brick that is needed next can always be read.
// Whoever holds a brick's bytes must not wait for a later brick meanwhile. Reads end in any order.
//
// Reads are direct where the file system allows it, else through the page cache; by io_uring where the kernel
// allows it, else by pread on threads. While a test replaces system calls they are by SystemCalls::pread. A
// read that fails, ends early or is put off again and again (EINTR, EAGAIN) marks its bricks unreadable.
// CacheReader then reads such a brick alone, or says what is wrong.
//
//                start()
//   kStopped ---------------> kReading      bricks are planned, read and handed out
//       ^                        |
//       '--------- stop() -------'          nothing is submitted or handed out; reads under way may still end
//
//   each of these --reading itself fails--> kBroken    fetch() and start() throw the failure; the thread ends
//   every state   --destructor----------------> kEnding    the thread ends
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "stream/base/mutex.h"
#include "stream/cache/cache_reader.h"
#include "stream/paging/async_reads.h"
#include "stream/paging/read_batch.h"

namespace curvisplat {

/// How a BrickPager reads.
struct PagerOptions {
  enum class Way { kAutomatic, kIoUring, kThreads };

  uint64_t buffer_bytes = 16 << 20;  // at least BrickPager::leastBufferBytes()
  unsigned queue_depth = 8;
  Way way = Way::kAutomatic;  // kIoUring: throws Error where the kernel refuses it
  bool direct = true;         // false: through the page cache
  /// Makes the AsyncReads that replaces every other method in a test, for at most `depth` reads at once.
  std::function<std::unique_ptr<AsyncReads>(unsigned depth)> reads;
};

/// Counts of what was read since the pager was made.
struct PagerStatistics {
  double reading_s = 0;            // time with at least one read under way
  uint64_t bytes = 0;              // from the files, with what lies between streams
  uint64_t requests = 0;           // to the kernel
  double depth_s = 0;              // requests under way, times seconds: over reading_s it is the mean depth
  uint64_t bricks_unreadable = 0;  // handed over without bytes
  uint64_t bricks_left_out = 0;    // were not read, since they were not needed any more
  uint64_t bytes_left_out = 0;     // of their streams
  uint64_t peak_bytes = 0;         // of the buffer
};

class BrickPager;

/// The bytes of one brick, lent: dropping it gives them back.
class PagedBrick {
 public:
  using Streams = std::array<std::span<const std::byte>, kBrickStreams>;

  /// `streams`: nullopt where it is not readable.
  PagedBrick(BrickPager& pager, uint64_t sequence, const std::optional<Streams>& streams)
      : pager_(&pager),
        sequence_(sequence),
        readable_(streams.has_value()),
        streams_(streams.value_or(Streams())) {}
  /// A brick that was not read because it was not needed any more.
  static PagedBrick leftOut() { return PagedBrick(); }
  ~PagedBrick();
  PagedBrick(PagedBrick&& other) noexcept;
  PagedBrick& operator=(PagedBrick&&) = delete;

  /// False where a read failed or the file ended: there are no bytes.
  bool readable() const { return readable_; }
  /// True if nobody needs the brick any more: there are no bytes.
  bool isLeftOut() const { return left_out_; }
  std::span<const std::byte> geometry() const { return streams_[0]; }
  std::span<const std::byte> values() const { return streams_[1]; }
  std::span<const std::byte> second() const { return streams_[2]; }  // of two variables

 private:
  PagedBrick() : left_out_(true) {}

  BrickPager* pager_ = nullptr;
  uint64_t sequence_ = 0;
  bool readable_ = false;
  bool left_out_ = false;
  Streams streams_;
};

/// The variables that are read for each splat, by their positions in the manifest: one, or two.
struct ReadVariables {
  size_t first = 0;
  std::optional<size_t> second = std::nullopt;

  ReadVariables(size_t only) : first(only) {}
  ReadVariables(size_t of_both, std::optional<size_t> other) : first(of_both), second(other) {}
  bool operator==(const ReadVariables&) const = default;
};

/// Reads a frame's bricks ahead, on a thread of its own.
class BrickPager {
 public:
  /// Opens the files of `cache`, which must outlive the pager, and starts the thread "pager". Throws Error if
  /// a file cannot be opened, or if the kernel refuses the way of reading that was asked for.
  BrickPager(const CacheReader& cache, const ReadVariables& variables, const PagerOptions& options);
  /// Stops, and waits for the reads under way.
  ~BrickPager();
  BrickPager(const BrickPager&) = delete;
  BrickPager& operator=(const BrickPager&) = delete;

  /// The size of the smallest buffer, in bytes: it holds the largest brick, so that bricks can be read one
  /// after the other.
  static uint64_t leastBufferBytes(const CacheReader& cache, const ReadVariables& variables);

  /// Returns whether nobody needs a brick any more. Once true, it stays so.
  using Unneeded = std::function<bool(uint32_t brick)>;

  /// Begins to read `bricks`, after stopping what was begun before; all bricks that were handed out must have
  /// been given back. `unneeded`, if there is one, is asked on the pager's thread, just before a brick would
  /// be read, and not after stop(). Throws the failure if the pager is kBroken.
  void start(std::vector<uint32_t> bricks, Unneeded unneeded = {});
  /// Opens the files of values anew, after the cache was put at another step of the same geometry; they are
  /// read from the next start() on. Stops what was begun before; all bricks must have been given back. Throws
  /// Error if a file cannot be opened.
  void stepChanged();
  /// Waits for bricks[sequence] of start(). Each may be taken once, by any thread. Returns nullopt once
  /// stopped. Throws the failure if the pager is kBroken.
  std::optional<PagedBrick> fetch(uint64_t sequence);
  /// Wakes all who wait: nothing is handed out until the next start(). Any thread may call it, any number of
  /// times.
  void stop();

  PagerStatistics statistics() const;
  /// How it reads, for people: "io_uring, direct".
  std::string way() const;
  uint64_t bufferBytes() const { return capacity_; }

 private:
  friend class PagedBrick;

  enum class State { kStopped, kReading, kBroken, kEnding };  // the diagram above

  struct Batch {
    ReadBatch plan;
    uint64_t first = 0;             // sequence of its first brick
    uint64_t begin = 0;             // position in the ring, see below
    std::vector<uint32_t> done;     // [read] bytes
    std::vector<uint8_t> put_off;   // [read] times in a row
    std::vector<uint8_t> missing;   // [brick] reads to come
    std::vector<uint8_t> readable;  // [brick]
    uint32_t next_read = 0;         // to be submitted
    uint32_t kept = 0;              // bricks not given back
  };
  /// A read that the kernel has, by its tag.
  struct UnderWay {
    uint64_t batch = 0;
    uint32_t read = 0;
    bool direct = false;
  };

  void loop();
  void haltReading() REQUIRES(mutex_);
  void awaitIdle(MutexLock& lock) REQUIRES(mutex_);
  void planAhead() REQUIRES(mutex_);
  std::span<const BrickExtents> nextNeeded() REQUIRES(mutex_);
  std::optional<uint64_t> spaceFor(uint64_t bytes) const REQUIRES(mutex_);
  void submitReads() REQUIRES(mutex_);
  void submit(uint64_t number, uint32_t read_number, bool direct) REQUIRES(mutex_);
  void complete(const AsyncReadEnd& end) REQUIRES(mutex_);
  void finishRead(Batch& batch, uint32_t read, bool good) REQUIRES(mutex_);
  bool hasArrived(uint64_t sequence) REQUIRES(mutex_);
  void giveBack(uint64_t sequence);
  Batch& batchOf(uint64_t sequence) REQUIRES(mutex_);
  void countReads(int change) REQUIRES(mutex_);

  const CacheReader& cache_;
  const ReadVariables variables_;
  const unsigned depth_;
  const bool direct_;
  const uint64_t capacity_;
  std::array<std::unique_ptr<DirectFile>, kBrickStreams> files_;
  struct Free {
    void operator()(std::byte* bytes) const { std::free(bytes); }
  };
  std::unique_ptr<std::byte, Free> buffer_;
  std::unique_ptr<AsyncReads> reads_;

  mutable Mutex mutex_;                                   // guards no bytes of the buffer
  ConditionVariable arrived_;                             // a brick is complete, or all has stopped
  ConditionVariable idle_;                                // no read is under way
  std::vector<uint32_t> bricks_ GUARDED_BY(mutex_);       // [sequence]
  std::vector<BrickExtents> extents_ GUARDED_BY(mutex_);  // [sequence]
  Unneeded unneeded_ GUARDED_BY(mutex_);
  std::vector<uint8_t> left_out_ GUARDED_BY(mutex_);     // [sequence]
  uint64_t planned_ GUARDED_BY(mutex_) = 0;              // bricks in batches so far, or left out
  std::optional<ReadBatch> waiting_ GUARDED_BY(mutex_);  // the next batch, which has no space yet
  // Batches that hold space, in order. Positions count on for ever, as in a SegmentRing; modulo the capacity
  // they are places in the buffer.
  std::deque<Batch> batches_ GUARDED_BY(mutex_);
  uint64_t first_batch_ GUARDED_BY(mutex_) = 0;  // number of batches_.front()
  uint64_t next_batch_ GUARDED_BY(mutex_) = 0;   // number of the first with reads to submit
  uint64_t end_ GUARDED_BY(mutex_) = 0;
  std::vector<UnderWay> under_way_ GUARDED_BY(mutex_);  // [tag]
  std::vector<uint64_t> free_tags_ GUARDED_BY(mutex_);
  unsigned reads_under_way_ GUARDED_BY(mutex_) = 0;
  uint64_t lent_ GUARDED_BY(mutex_) = 0;            // bricks handed out and not given back
  bool direct_refused_ GUARDED_BY(mutex_) = false;  // by a read: the file system is not what it said
  bool wants_space_ GUARDED_BY(mutex_) = false;
  State state_ GUARDED_BY(mutex_) = State::kStopped;
  std::exception_ptr failure_ GUARDED_BY(mutex_);  // in kBroken
  PagerStatistics statistics_ GUARDED_BY(mutex_);
  std::chrono::steady_clock::time_point counted_ GUARDED_BY(mutex_);

  std::thread thread_;
};

}  // namespace curvisplat
