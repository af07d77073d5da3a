#include "tools/output/command_run.h"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <string>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/trace.h"
#include "tools/output/launched_ranks.h"
#include "tools/output/start_checks.h"

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

namespace {

std::atomic<Progress*> job = nullptr;
std::atomic<int> received = 0;  // the last signal; 0: none
static_assert(std::atomic<Progress*>::is_always_lock_free && std::atomic<int>::is_always_lock_free);

void stopJob(int signal) {
  received = signal;
  if (Progress* progress = job) progress->stop(signal);
}

}  // namespace

StopOnSignals::StopOnSignals(Progress& progress) {
  job = &progress;
  struct sigaction action {};
  action.sa_handler = stopJob;
  action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    ::sigaction(signal, nullptr, &before);
    if (before.sa_handler != SIG_IGN) ::sigaction(signal, &action, nullptr);
  }
  if (const int signal = received) progress.stop(signal);
}

StopOnSignals::~StopOnSignals() {
  job = nullptr;
}

void ignoreFileSizeSignal() {
  struct sigaction action {};
  action.sa_handler = SIG_IGN;
  ::sigaction(SIGXFSZ, &action, nullptr);
}

void runTraced(const std::filesystem::path& path, const std::vector<std::filesystem::path>& others,
               const std::function<void()>& command) {
  if (path.empty()) return command();
  const Ranks& ranks = launchedRanks();
  std::filesystem::path own = path;
  if (!ranks.alone())
    own.replace_filename(
        fmt::format("{}.{}{}", path.stem().string(), ranks.rank(), path.extension().string()));
  checkJsonOutput("--trace", own, others);
  const auto endQuietly = [] {
    try {
      Trace::end();
    } catch (const Error&) {  // what ended the command is reported
    }
  };
  Trace::begin(own, ranks.rank());
  try {
    command();
  } catch (const UsageError&) {
    endQuietly();
    removeFileIfThere(own);
    throw;
  } catch (...) {
    endQuietly();
    throw;
  }
  Trace::end();
}

}  // namespace curvisplat
