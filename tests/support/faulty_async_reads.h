// Asynchronous reads whose ends a test may change: what io_uring may answer, and hardly ever does.
#pragma once

#include <functional>
#include <memory>

#include "stream/paging/async_reads.h"

namespace curvisplat::faults {

/// Does reads by others, and passes their ends through `change`.
class FaultyAsyncReads : public AsyncReads {
 public:
  /// Given the number of the end (from 0) and its result; returns what is to be said instead.
  using Change = std::function<int64_t(uint64_t number, int64_t result)>;

  FaultyAsyncReads(std::unique_ptr<AsyncReads> reads, Change change)
      : reads_(std::move(reads)), change_(std::move(change)) {}

  const char* name() const override { return reads_->name(); }
  void submit(const AsyncRead& read) override { reads_->submit(read); }
  std::optional<AsyncReadEnd> wait() override {
    std::optional<AsyncReadEnd> end = reads_->wait();
    if (end) end->result = change_(number_++, end->result);
    return end;
  }
  void wake() override { reads_->wake(); }

 private:
  const std::unique_ptr<AsyncReads> reads_;
  const Change change_;
  uint64_t number_ = 0;
};

}  // namespace curvisplat::faults
