// A list of numbers of 8 bytes in a spool file, and its writer.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/formats/common/spool_file.h"

namespace curvisplat {

struct SpooledNumbers {
  std::shared_ptr<SpoolFile> spool;
  uint64_t offset = 0, count = 0;  // of numbers

  /// Any number of threads. The list must hold numbers of the type that is read.
  void read(uint64_t first, std::span<double> to) const {
    if (!to.empty()) spool->readAt(offset + 8 * first, std::as_writable_bytes(to));
  }
  void read(uint64_t first, std::span<uint64_t> to) const {
    if (!to.empty()) spool->readAt(offset + 8 * first, std::as_writable_bytes(to));
  }
  void read(uint64_t first, std::span<int64_t> to) const {
    if (!to.empty()) spool->readAt(offset + 8 * first, std::as_writable_bytes(to));
  }
};

/// Writes numbers to a spool file of its own, some at a time. For one thread.
template <typename Value>
class NumberSpool {
 public:
  static_assert(sizeof(Value) == 8);
  explicit NumberSpool(const std::filesystem::path& folder) {
    numbers_.spool = std::make_shared<SpoolFile>(folder);
  }
  void add(Value value) {
    pending_.push_back(value);
    ++added_;
    if (pending_.size() == kPending) flush();
  }
  uint64_t size() const { return added_; }
  /// What has been added; more may follow.
  SpooledNumbers soFar() {
    flush();
    return numbers_;
  }
  SpooledNumbers finish() {
    flush();
    return std::move(numbers_);
  }

 private:
  static constexpr size_t kPending = 65536;

  void flush() {
    if (pending_.empty()) return;
    const uint64_t at = numbers_.spool->append(
        [&](const SpoolFile::Sink& sink) { sink(std::as_bytes(std::span(pending_))); });
    if (numbers_.count == 0) numbers_.offset = at;
    numbers_.count += pending_.size();
    pending_.clear();
  }

  SpooledNumbers numbers_;
  std::vector<Value> pending_;
  uint64_t added_ = 0;
};

}  // namespace curvisplat
