#include "tools/output/progress_bar.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>

namespace curvisplat {
namespace {

std::string withUnit(double count) {
  if (count >= 1e9) return fmt::format("{:.1f} G", count * 1e-9);
  if (count >= 1e6) return fmt::format("{:.1f} M", count * 1e-6);
  if (count >= 1e3) return fmt::format("{:.1f} k", count * 1e-3);
  return fmt::format("{:.0f} ", count);
}

void draw(const Progress::State& state) {
  const double done = static_cast<double>(state.done);
  const double seconds = std::max(1e-3, state.seconds);
  std::string line = fmt::format("{:<10}", state.phase);
  if (state.total > 0) {
    const double skipped = static_cast<double>(state.skipped);
    const double total = static_cast<double>(state.total);
    const double part = std::min(1.0, (skipped + done) / total);
    const auto width = static_cast<int>(part * 30);
    line += fmt::format("[{:<30}] {:3.0f} %  ", std::string(static_cast<size_t>(width), '='), part * 100);
    if (done > 0)
      line += fmt::format("{:.0f} s left  ", seconds / done * std::max(0.0, total - skipped - done));
  }
  line += fmt::format("{}{}/s", withUnit(done / seconds), state.unit);
  line.insert(0, "\r\033[K");
  std::fputs(line.c_str(), stderr);
  std::fflush(stderr);
}

}  // namespace

Progress::Display progressBar() {
  if (isatty(STDERR_FILENO) != 1) return {};
  return [](const Progress::State* state) {
    if (state == nullptr)
      std::fputs("\r\033[K", stderr);
    else
      draw(*state);
  };
}

}  // namespace curvisplat
