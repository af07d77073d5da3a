#include "tools/output/launched_ranks.h"

#include <dlfcn.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include "stream/base/error.h"
#include "stream/base/plugin.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

std::optional<Ranks> started;

/// A number of the environment; 0 where there is none.
unsigned long numberOf(const char* variable) {
  const char* const text = std::getenv(variable);
  return text ? std::strtoul(text, nullptr, 10) : 0;
}

/// How many processes the launcher says it has started; 1 without a launcher. Within a batch job's script, which no
/// srun has started, Slurm's numbers are the job's: they count where its process manager speaks as well.
unsigned long launchedCount() {
  if (const auto count = numberOf("OMPI_COMM_WORLD_SIZE")) return count;
  if (const auto count = numberOf("PMI_SIZE")) return count;
  if (std::getenv("PMIX_RANK") || std::getenv("PMI_RANK"))
    for (const char* variable : {"SLURM_STEP_NUM_TASKS", "SLURM_NTASKS", "PALS_SIZE"})
      if (const auto count = numberOf(variable)) return count;
  return 1;
}

constexpr const char* kPlugIn = "curvisplat-mpi.so";

std::unique_ptr<RankTransport> startMpi(unsigned long count) {
  std::string why_not;
  // MPI's own plug-ins look for its symbols among those of the whole process.
  void* const library = openPlugin(kPlugIn, RTLD_NOW | RTLD_GLOBAL, why_not);
  using Start = RankTransport* (*)(const char*);
  const auto start = library ? reinterpret_cast<Start>(::dlsym(library, "curvisplatStartMpi")) : nullptr;
  RankTransport* const transport = start ? start(CURVISPLAT_VERSION) : nullptr;
  if (transport) return std::unique_ptr<RankTransport>(transport);
  if (library) why_not = "it is of another version than the program";
  throw Error(
      "started as one of {} processes, but without MPI: {}: {}; build with CURVISPLAT_MPI=ON, or start one",
      count, kPlugIn, why_not);
}

std::string hostName() {
  char name[256] = "";
  ::gethostname(name, sizeof name - 1);
  return name;
}

/// Whether another rank says within a moment that it has failed.
bool anotherFails(RankTransport& transport, std::chrono::milliseconds moment) {
  const auto end = std::chrono::steady_clock::now() + moment;
  do {
    if (transport.failedCount() > 0) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  } while (std::chrono::steady_clock::now() < end);
  return false;
}

}  // namespace

Ranks& launchedRanks() {
  if (started) return *started;
  const unsigned long count = launchedCount();
  if (count > 1)
    started.emplace(startMpi(count));
  else
    started.emplace();
  // What there is once is printed once.
  if (!started->isFirst() && !std::freopen("/dev/null", "w", stdout))
    throw Error("/dev/null: cannot be opened");
  if (!started->isFirst()) muteMessages();
  return *started;
}

StopRanksWith::StopRanksWith(Ranks& ranks, const Progress& progress) : ranks_(ranks) {
  ranks.whileWaiting([&progress] { progress.throwIfStopped(); });
}

StopRanksWith::~StopRanksWith() {
  ranks_.whileWaiting({});
}

void endRanksAfter(const std::string& line, int status) {
  if (!started || started->alone()) return;
  using namespace std::chrono_literals;
  RankTransport& transport = *started->transport();
  const bool was_stopped = status > 128;  // by a signal, as the launcher sends when another rank has ended
  // The lowest rank of those that fail of the same cause prints: each waits longer than those before it. One that has
  // announced its failure already has waited for those of the others.
  const auto moment = 300ms + 100ms * std::min(started->rank(), 17u);
  const bool silent = !started->failedFirst() &&
                      (anotherFails(transport, started->isFirst() && !was_stopped ? 0ms : moment) ||
                       (was_stopped && !started->isFirst()));
  transport.announceFailure();
  if (!silent) {
    muteMessages(false);
    printMessage("rank {} of {} ({}): {}", started->rank(), started->count(), hostName(), line);
  }
  // The others see the announcement and remove their files; whoever does not in this time is ended by a signal. The
  // one that prints ends the job: those that are silent wait for it.
  started->waitForFailures(5s);
  if (silent) std::this_thread::sleep_for(2s);
  transport.abort(status);
}

void finishRanks() {
  if (started && started->transport()) started->transport()->finish();
}

}  // namespace curvisplat
