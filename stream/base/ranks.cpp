#include "stream/base/ranks.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "stream/base/error.h"

namespace curvisplat {

void Messages::begin(std::span<const uint64_t> bytes) {
  begins_.assign(1, 0);
  for (const uint64_t of_rank : bytes) begins_.push_back(begins_.back() + of_rank);
  if (begins_.back() <= capacity_) return;
  block_.reset();  // before the next one is allocated
  capacity_ = std::max(begins_.back(), expected_);
  block_ = std::make_unique_for_overwrite<std::byte[]>(capacity_);
}

/// MPI's own waits keep a core busy, which others may need for their work.
void Ranks::wait() {
  // On a machine with much other work each try takes as long as the others' turns: 1000 took over 20 s.
  constexpr int kEagerTries = 1000;
  const auto eager_end = std::chrono::steady_clock::now() + std::chrono::milliseconds(20);
  constexpr auto kShortest = std::chrono::microseconds(20), kLongest = std::chrono::microseconds(2000);
  auto pause = kShortest;
  for (int tries = 0; !transport_->isDone(); ++tries) {
    if (tries < kEagerTries && std::chrono::steady_clock::now() < eager_end) {
      std::this_thread::yield();
      continue;
    }
    if (check_) check_();
    throwIfOneFailed();
    std::this_thread::sleep_for(pause);
    pause = std::min(2 * pause, kLongest);
  }
}

/// Rank 0 is the last to leave: it removes the folder in which others still remove their files.
void Ranks::throwIfOneFailed() {
  if (transport_->failedCount() == 0) return;
  if (isFirst()) waitForFailures(std::chrono::seconds(3));
  throw Error("another rank has failed");
}

void Ranks::announceFailure() {
  if (alone()) return;
  failed_first_ = transport_->failedCount() == 0;
  transport_->announceFailure();
}

bool Ranks::waitForFailures(std::chrono::milliseconds longest) {
  if (alone()) return true;
  const auto end = std::chrono::steady_clock::now() + longest;
  while (transport_->failedCount() + 1 < count()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

/// How many bytes come from each rank, where those of call_.out go to each.
void Ranks::exchangeSizes() {
  for (const auto& bytes : call_.out) call_.out_bytes.push_back(bytes.size());
  call_.in_bytes.resize(count());
  transport_->beginSizes(call_.out_bytes.data(), call_.in_bytes.data());
  wait();
}

std::vector<Ranks::Bytes> Ranks::exchange(std::vector<Bytes> to) {
  CURVISPLAT_CHECK_OP(to.size(), ==, count());
  if (alone()) return to;
  call_.to = std::move(to);
  call_.out.assign(call_.to.begin(), call_.to.end());
  exchangeSizes();
  for (const uint64_t bytes : call_.in_bytes) call_.from.emplace_back(bytes);
  call_.in.assign(call_.from.begin(), call_.from.end());
  transport_->beginExchange(call_.out.data(), call_.in.data());
  wait();
  return std::move(std::exchange(call_, {}).from);
}

void Ranks::exchange(const Messages& to, Messages& from) {
  if (alone()) return from.begin(std::vector<uint64_t>(1));
  call_.to_block = to.block();
  for (unsigned n = 0; n < count(); ++n)
    call_.out.push_back(n == rank() ? std::span<const std::byte>() : to.of(n));
  exchangeSizes();
  from.begin(call_.in_bytes);
  call_.from_block = from.block();
  for (unsigned n = 0; n < count(); ++n) call_.in.push_back(from.of(n));
  transport_->beginExchange(call_.out.data(), call_.in.data());
  wait();
  call_ = {};
}

std::vector<Ranks::Bytes> Ranks::gather(Bytes bytes) {
  std::vector<Bytes> to(count());
  to[0] = std::move(bytes);
  std::vector<Bytes> from = exchange(std::move(to));
  if (!isFirst()) from.clear();
  return from;
}

Ranks::Bytes Ranks::broadcast(Bytes bytes) {
  std::vector<Bytes> to(count());
  if (isFirst()) std::fill(to.begin(), to.end(), bytes);
  return std::move(exchange(std::move(to)).front());
}

void Ranks::barrier() {
  std::vector<int64_t> nothing(1);
  sum(std::span<int64_t>(nothing));
}

void Ranks::sum(std::span<int64_t> values) {
  if (alone()) return;
  call_.sums.assign(values.begin(), values.end());
  transport_->beginSum(call_.sums);
  wait();
  std::copy(call_.sums.begin(), call_.sums.end(), values.begin());
  call_ = {};
}

Ranks& oneRank() {
  static Ranks alone;  // its calls change nothing
  return alone;
}

void Ranks::sum(std::span<uint64_t> values) {
  // Signed and unsigned sums have the same bits.
  sum(std::span(reinterpret_cast<int64_t*>(values.data()), values.size()));
}

}  // namespace curvisplat
