#include "stream/base/ranks.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "stream/base/check.h"
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
  constexpr int kEagerTries = 1000;
  constexpr auto kShortest = std::chrono::microseconds(20), kLongest = std::chrono::microseconds(2000);
  auto pause = kShortest;
  for (int tries = 0; !transport_->isDone(); ++tries) {
    if (tries < kEagerTries) {
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

std::vector<uint64_t> Ranks::sizesFor(const std::vector<std::span<const std::byte>>& out) {
  std::vector<uint64_t> out_bytes, in_bytes(count());
  for (const auto& bytes : out) out_bytes.push_back(bytes.size());
  transport_->beginSizes(out_bytes.data(), in_bytes.data());
  wait();
  return in_bytes;
}

std::vector<Ranks::Bytes> Ranks::exchange(const std::vector<Bytes>& to) {
  CURVISPLAT_CHECK_OP(to.size(), ==, count());
  if (alone()) return to;
  const std::vector<std::span<const std::byte>> out(to.begin(), to.end());
  const std::vector<uint64_t> in_bytes = sizesFor(out);
  std::vector<Bytes> from(count());
  std::vector<std::span<std::byte>> in;
  for (unsigned n = 0; n < count(); ++n) {
    from[n].resize(in_bytes[n]);
    in.emplace_back(from[n]);
  }
  transport_->beginExchange(out.data(), in.data());
  wait();
  return from;
}

void Ranks::exchange(const Messages& to, Messages& from) {
  std::vector<std::span<const std::byte>> out;
  for (unsigned n = 0; n < count(); ++n) out.push_back(n == rank() ? std::span<const std::byte>() : to.of(n));
  from.begin(alone() ? std::vector<uint64_t>(1) : sizesFor(out));
  if (alone()) return;
  std::vector<std::span<std::byte>> in;
  for (unsigned n = 0; n < count(); ++n) in.push_back(from.of(n));
  transport_->beginExchange(out.data(), in.data());
  wait();
}

std::vector<Ranks::Bytes> Ranks::gather(Bytes bytes) {
  std::vector<Bytes> to(count());
  to[0] = std::move(bytes);
  std::vector<Bytes> from = exchange(to);
  if (!isFirst()) from.clear();
  return from;
}

Ranks::Bytes Ranks::broadcast(Bytes bytes) {
  std::vector<Bytes> to(count());
  if (isFirst()) std::fill(to.begin(), to.end(), bytes);
  return std::move(exchange(to).front());
}

void Ranks::barrier() {
  std::vector<int64_t> nothing(1);
  sum(std::span<int64_t>(nothing));
}

void Ranks::sum(std::span<int64_t> values) {
  if (alone()) return;
  transport_->beginSum(values);
  wait();
}

void Ranks::sum(std::span<uint64_t> values) {
  // Signed and unsigned sums have the same bits.
  sum(std::span(reinterpret_cast<int64_t*>(values.data()), values.size()));
}

}  // namespace curvisplat
