// Processes that do one job together, on one machine or many, started by mpirun or srun. Each has a number, its
// rank; most programs run as one rank alone.
//
// All ranks make the same calls in the same order, and each call waits for the others. A rank that fails announces
// it and does not call any more (tools/output/launched_ranks.h); others that wait then fail as well.
//
// One thread of a rank at a time. A message may be of any size; it is in memory at both ends.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace curvisplat {

/// The message passing that Ranks needs of a library such as MPI. No function throws; a failure of the
/// library ends the process.
class RankTransport {
 public:
  virtual ~RankTransport() = default;

  virtual unsigned rank() const = 0;
  virtual unsigned count() const = 0;

  /// Each of the three begins a call, which ends when isDone() returns true. The memory must stay until then
  /// or, if the caller does not wait for that, until this object has ended.
  ///   out, in  [rank]  a number for each rank, and from each
  virtual void beginSizes(const uint64_t* out, uint64_t* in) = 0;
  ///   out, in  [rank]  bytes for each rank, and from each
  virtual void beginExchange(const std::span<const std::byte>* out, const std::span<std::byte>* in) = 0;
  ///   values           replaced by the sums over all ranks
  virtual void beginSum(std::span<int64_t> values) = 0;
  virtual bool isDone() = 0;

  /// Tells the others that this rank has failed, and waits for nobody.
  virtual void announceFailure() = 0;
  /// How many other ranks have announced their failure to this one so far.
  virtual unsigned failedCount() = 0;

  /// Ends the job in good order. Waits for all.
  virtual void finish() = 0;
  /// Ends all ranks at once. Does not return.
  [[noreturn]] virtual void abort(int status) = 0;
};

/// Messages for each rank, or from each, in one block of memory that stays for the next ones: the system
/// would have to clear every page of a large block that is allocated anew. One thread at a time.
class Messages {
 public:
  /// `expected`: bytes of all messages together, as far as known; more are allocated where needed.
  explicit Messages(uint64_t expected = 0) : expected_(expected) {}

  /// Makes space for bytes[n] to or from each rank n. The former contents are lost; the new bytes are not
  /// initialised.
  void begin(std::span<const uint64_t> bytes);
  std::span<std::byte> of(unsigned rank) const {
    return {block_.get() + begins_[rank], begins_[rank + 1] - begins_[rank]};
  }
  /// The memory of all, for those who have to keep it.
  std::shared_ptr<std::byte[]> block() const { return block_; }

 private:
  uint64_t expected_, capacity_ = 0;
  std::shared_ptr<std::byte[]> block_;
  std::vector<uint64_t> begins_;  // [rank], then the end
};

/// The ranks of a job, as one of them sees them.
class Ranks {
 public:
  using Bytes = std::vector<std::byte>;

  /// One rank alone: nothing waits.
  Ranks() = default;
  explicit Ranks(std::unique_ptr<RankTransport> transport) : transport_(std::move(transport)) {}

  unsigned rank() const { return transport_ ? transport_->rank() : 0; }
  unsigned count() const { return transport_ ? transport_->count() : 1; }
  bool alone() const { return count() == 1; }
  /// Whether this rank is the one that writes and prints what is written and printed once.
  bool isFirst() const { return rank() == 0; }

  /// Sets a function that is called again and again while a call waits. What it throws leaves the waiting
  /// call, as does the Error that another rank has failed; no further calls are allowed then.
  void whileWaiting(std::function<void()> check) { check_ = std::move(check); }

  /// Sends to[n] to each rank n. Returns what came from each.
  std::vector<Bytes> exchange(std::vector<Bytes> to);
  /// Exchanges messages that are large and many. What a rank has for itself stays where it is, in `to`.
  void exchange(const Messages& to, Messages& from);
  /// Returns at rank 0 what each rank has given, [rank]; elsewhere nothing.
  std::vector<Bytes> gather(Bytes bytes);
  /// Returns what rank 0 has given.
  Bytes broadcast(Bytes bytes);
  /// Returns when all ranks have called it.
  void barrier();
  /// Replaces `values` by their sums over all ranks.
  void sum(std::span<int64_t> values);
  void sum(std::span<uint64_t> values);

  /// Tells the others that this rank fails, before it ends: they stop meanwhile.
  void announceFailure();
  /// Whether it was the first to fail, when it announced that.
  bool failedFirst() const { return failed_first_; }
  /// Waits until all others have announced their failure, but no longer than `longest`. Returns whether they have.
  bool waitForFailures(std::chrono::milliseconds longest);

  RankTransport* transport() { return transport_.get(); }

 private:
  /// The memory that the transport reads and writes during a call. Stays there if the call is left by an
  /// exception, until this object ends: MPI works on what was begun whenever it is called, also to announce
  /// the failure.
  struct Call {
    std::vector<uint64_t> out_bytes, in_bytes;  // [rank]
    std::vector<Bytes> to, from;                // [rank]
    std::shared_ptr<std::byte[]> to_block, from_block;
    std::vector<std::span<const std::byte>> out;  // [rank], of `to` or `to_block`
    std::vector<std::span<std::byte>> in;
    std::vector<int64_t> sums;
  };

  void exchangeSizes();
  void wait();
  void throwIfOneFailed();

  Call call_;  // the one under way
  std::unique_ptr<RankTransport> transport_;
  std::function<void()> check_;
  bool failed_first_ = false;
};

/// The one rank of a program that has no others. Any thread.
Ranks& oneRank();

/// Numbers, and structures of numbers, as a message; and back.
template <typename T>
Ranks::Bytes toBytes(const std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  Ranks::Bytes bytes(values.size() * sizeof(T));
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}
template <typename T>
std::vector<T> fromBytes(const Ranks::Bytes& bytes) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

}  // namespace curvisplat
