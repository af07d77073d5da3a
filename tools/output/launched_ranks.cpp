#include "tools/output/launched_ranks.h"

#include <dlfcn.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/plugin.h"
#include "stream/base/text.h"

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

namespace {

/// The options that all ranks have to be given alike, by name.
std::map<std::string, std::string> sharedOptions(const CLI::App& command) {
  static const std::set<std::string> own{"GRID",      "SOLUTION", "CACHE",  "--tmp",
                                         "--threads", "--stats",  "--trace"};
  std::map<std::string, std::string> options{{"the command", command.get_name()},
                                             {"the version", CURVISPLAT_VERSION}};
  for (const CLI::Option* option : command.get_options())
    if (option->count() > 0 && !own.contains(option->get_name()))
      options[option->get_name()] = fmt::format("{}", fmt::join(option->results(), " "));
  for (char** variable = environ; *variable; ++variable) {
    const std::string_view text = *variable;
    const size_t equals = std::min(text.find('='), text.size());
    if (text.starts_with("CURVISPLAT_"))
      options[std::string(text.substr(0, equals))] = text.substr(std::min(equals + 1, text.size()));
  }
  return options;
}

/// One text of all of them, and back. Neither names nor values have zeros.
std::string joined(const std::map<std::string, std::string>& options) {
  std::string text;
  for (const auto& [name, value] : options) (((text += name) += '\0') += value) += '\0';
  return text;
}

std::map<std::string, std::string> taken(std::string_view text) {
  std::map<std::string, std::string> options;
  const auto next = [&] {
    const std::string word(text.substr(0, text.find('\0')));
    text.remove_prefix(std::min(word.size() + 1, text.size()));
    return word;
  };
  while (!text.empty()) {
    std::string name = next();
    options[std::move(name)] = next();
  }
  return options;
}

}  // namespace

void requireSameOptions(const CLI::App& command) {
  Ranks& ranks = launchedRanks();
  if (ranks.alone()) return;
  const std::map<std::string, std::string> here = sharedOptions(command);
  const std::string text = joined(here);
  const auto sent = fromBytes<char>(ranks.broadcast(toBytes(std::vector<char>(text.begin(), text.end()))));
  const std::map<std::string, std::string> first = taken({sent.data(), sent.size()});
  const auto in = [](const auto& options, const std::string& name) {
    const auto found = options.find(name);
    return found == options.end() ? "not given" : "'" + found->second + "'";
  };
  std::map<std::string, std::string> all = here;
  all.insert(first.begin(), first.end());
  for (const auto& [name, value] : all)
    if (in(here, name) != in(first, name))
      throw UsageError("{} is {:.100} here and {:.100} at rank 0; start all ranks with the same options",
                       name, in(here, name), in(first, name));
}

void requireSameSteps(uint64_t steps) {
  const uint64_t first = fromBytes<uint64_t>(launchedRanks().broadcast(toBytes(std::vector{steps})))[0];
  if (steps != first)
    throw Error("the files are {} here and {} at rank 0; give all ranks the same files",
                countText(steps, "time step"), countText(first, "time step"));
}

StopRanksWith::StopRanksWith(Ranks& ranks, const Progress& progress) : ranks_(ranks) {
  ranks.whileWaiting([&progress] { progress.throwIfStopped(); });
}

StopRanksWith::~StopRanksWith() {
  ranks_.whileWaiting({});
}

void printMessageOfRank(const std::string& text) {
  if (!started || started->alone()) return printMessage("{}", text);
  muteMessages(false);
  printMessage("rank {} of {} ({}): {}", started->rank(), started->count(), hostName(), text);
  muteMessages(!started->isFirst());
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
    printMessageOfRank(line);
  }
  // The others see the announcement and remove their files; whoever does not in this time, which is long enough for a
  // machine with much other work, is ended by a signal. The one that prints ends the job: those that are silent wait for it.
  started->waitForFailures(20s);
  if (silent) std::this_thread::sleep_for(2s);
  transport.abort(status);
}

void finishRanks() {
  if (started && started->transport()) started->transport()->finish();
}

}  // namespace curvisplat
