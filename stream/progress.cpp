#include "stream/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace curvisplat {
namespace {

double secondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::string withUnit(double count) {
  if (count >= 1e9) return fmt::format("{:.1f} G", count * 1e-9);
  if (count >= 1e6) return fmt::format("{:.1f} M", count * 1e-6);
  if (count >= 1e3) return fmt::format("{:.1f} k", count * 1e-3);
  return fmt::format("{:.0f} ", count);
}

}  // namespace

Progress::Progress() : terminal_(isatty(STDERR_FILENO) == 1) {}
Progress::~Progress() {
  end();
}

void Progress::begin(std::string phase, uint64_t total, std::string unit) {
  end();
  phase_ = std::move(phase);
  unit_ = std::move(unit);
  total_ = total;
  done_ = skipped_ = 0;
  next_draw_ms_ = 0;
  start_ = std::chrono::steady_clock::now();
  usage_at_start_ = ProcessUsage::now();
}

void Progress::skip(uint64_t steps) {
  skipped_ += steps;
}

void Progress::advance(uint64_t steps) {
  throwIfStopped();
  done_.fetch_add(steps, std::memory_order_relaxed);
  if (!terminal_) return;
  const auto now_ms = static_cast<int64_t>(secondsSince(start_) * 1000);
  int64_t next = next_draw_ms_.load(std::memory_order_relaxed);
  if (now_ms >= next && next_draw_ms_.compare_exchange_strong(next, now_ms + 100)) draw();
}

void Progress::end() {
  if (phase_.empty()) return;
  ProcessUsage usage = ProcessUsage::now();
  usage.cpu_seconds -= usage_at_start_.cpu_seconds;
  usage.bytes_read -= usage_at_start_.bytes_read;
  usage.bytes_written -= usage_at_start_.bytes_written;
  phases_.push_back({phase_, unit_, secondsSince(start_), done_, usage});
  phase_.clear();
  if (terminal_) std::fputs("\r\033[K", stderr);
}

void Progress::draw() {
  const std::lock_guard lock(drawing_);
  const double done = static_cast<double>(done_.load());
  const double seconds = std::max(1e-3, secondsSince(start_));
  std::string line = fmt::format("{:<10}", phase_);
  if (total_ > 0) {
    const double skipped = static_cast<double>(skipped_.load());
    const double total = static_cast<double>(total_);
    const double part = std::min(1.0, (skipped + done) / total);
    const auto width = static_cast<int>(part * 30);
    line += fmt::format("[{:<30}] {:3.0f} %  ", std::string(static_cast<size_t>(width), '='), part * 100);
    if (done > 0)
      line += fmt::format("{:.0f} s left  ", seconds / done * std::max(0.0, total - skipped - done));
  }
  line += fmt::format("{}{}/s", withUnit(done / seconds), unit_);
  line.insert(0, "\r\033[K");
  std::fputs(line.c_str(), stderr);
  std::fflush(stderr);
}

}  // namespace curvisplat
