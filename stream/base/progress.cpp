#include "stream/base/progress.h"

#include <time.h>

#include <string>

#include "stream/base/os.h"

namespace curvisplat {
namespace {

double secondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

ProcessUsage ProcessUsage::now() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  ProcessUsage usage;
  usage.cpu_seconds = static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  const os::ProcessNumbers numbers = os::processNumbers();
  usage.bytes_read = numbers.bytes_read;
  usage.bytes_written = numbers.bytes_written;
  usage.memory_bytes = numbers.memory_bytes;
  usage.peak_memory_bytes = numbers.peak_memory_bytes;
  return usage;
}

Progress::~Progress() {
  end();
}

void Progress::begin(std::string phase, uint64_t total, std::string unit) {
  end();
  phase_ = std::move(phase);
  unit_ = std::move(unit);
  total_ = total;
  done_ = skipped_ = 0;
  next_display_ms_ = 0;
  start_ = std::chrono::steady_clock::now();
  usage_at_start_ = ProcessUsage::now();
}

void Progress::skip(uint64_t steps) {
  skipped_ += steps;
}

void Progress::advance(uint64_t steps) {
  throwIfStopped();
  done_.fetch_add(steps, std::memory_order_relaxed);
  if (!display_) return;
  const auto now_ms = static_cast<int64_t>(secondsSince(start_) * 1000);
  int64_t next = next_display_ms_.load(std::memory_order_relaxed);
  if (now_ms >= next && next_display_ms_.compare_exchange_strong(next, now_ms + 100)) show();
}

void Progress::end() {
  if (phase_.empty()) return;
  ProcessUsage usage = ProcessUsage::now();
  usage.cpu_seconds -= usage_at_start_.cpu_seconds;
  usage.bytes_read -= usage_at_start_.bytes_read;
  usage.bytes_written -= usage_at_start_.bytes_written;
  phases_.push_back({phase_, unit_, secondsSince(start_), done_, usage});
  phase_.clear();
  if (display_) display_(nullptr);
}

void Progress::show() {
  const MutexLock lock(displaying_);
  const State state{phase_, unit_, total_, done_.load(), skipped_.load(), secondsSince(start_)};
  display_(&state);
}

}  // namespace curvisplat
