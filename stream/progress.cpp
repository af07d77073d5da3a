#include "stream/progress.h"

#include <fmt/format.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace curvisplat {
namespace {

double secondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double processCpuSeconds() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
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
  done_ = 0;
  next_draw_ms_ = 0;
  start_ = std::chrono::steady_clock::now();
  cpu_start_s_ = processCpuSeconds();
}

void Progress::advance(uint64_t steps) {
  done_.fetch_add(steps, std::memory_order_relaxed);
  if (!terminal_) return;
  const auto now_ms = static_cast<int64_t>(secondsSince(start_) * 1000);
  int64_t next = next_draw_ms_.load(std::memory_order_relaxed);
  if (now_ms >= next && next_draw_ms_.compare_exchange_strong(next, now_ms + 100)) draw();
}

void Progress::end() {
  if (phase_.empty()) return;
  phases_.push_back({phase_, unit_, secondsSince(start_), processCpuSeconds() - cpu_start_s_, done_});
  phase_.clear();
  if (terminal_) fmt::print(stderr, "\r\033[K");
}

void Progress::draw() {
  const std::lock_guard lock(drawing_);
  const double done = static_cast<double>(done_.load());
  const double seconds = std::max(1e-3, secondsSince(start_));
  std::string line = fmt::format("{:<10}", phase_);
  if (total_ > 0) {
    const double part = std::min(1.0, done / static_cast<double>(total_));
    const auto width = static_cast<int>(part * 30);
    line += fmt::format("[{:<30}] {:3.0f} %  ", std::string(static_cast<size_t>(width), '='), part * 100);
    if (part > 0) line += fmt::format("{:.0f} s left  ", seconds / part - seconds);
  }
  line += fmt::format("{}{}/s", withUnit(done / seconds), unit_);
  fmt::print(stderr, "\r\033[K{}", line);
  std::fflush(stderr);
}

}  // namespace curvisplat
