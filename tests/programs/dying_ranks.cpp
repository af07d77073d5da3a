// A conversion, or an addition of a scalar, by several ranks of which one is killed in a given pass, for tests of what it leaves:
//
//    mpirun -n 3 dying_ranks GRID FUNCTION OUTPUT VICTIM PASS DELAY_US
//    mpirun -n 3 dying_ranks GRID FUNCTION CACHE VICTIM PASS DELAY_US SCALAR
//
// Rank VICTIM kills itself DELAY_US microseconds after its first PASS passes have ended; VICTIM -1: none does, and rank 0
// prints the seconds of each pass. Converts the first scalar, or adds the named one, in one thread within 256 MiB.
#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>
#include <thread>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/convert/convert.h"
#include "preprocess/formats/derived/derived_source.h"
#include "preprocess/formats/open/open_grid.h"
#include "stream/base/progress.h"
#include "tools/output/launched_ranks.h"

namespace {

using namespace curvisplat;

/// The options that conversions and additions have in common.
template <typename Options>
Options optionsOf(Ranks& ranks, uint32_t scalar) {
  Options options;
  options.scalars = {scalar};
  options.memory_bytes = uint64_t{256} << 20;
  options.threads = 1;
  options.ranks = &ranks;
  return options;
}

void convertFirst(const DataSource& source, const char* output, Ranks& ranks, Progress& progress) {
  auto options = optionsOf<ConvertOptions>(ranks, 0);
  options.output = output;
  options.title = "in";
  convert(source, options, progress);
}

void addNamed(const DataSource& source, const char* cache, const std::string& name, Ranks& ranks,
              Progress& progress) {
  uint32_t scalar = 0;
  while (source.description().scalars.at(scalar).name != name) ++scalar;
  auto options = optionsOf<AddScalarOptions>(ranks, scalar);
  options.cache = cache;
  addScalars(source, options, progress);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 7 && argc != 8) return 2;
  try {
    Ranks& ranks = launchedRanks();
    const int victim = std::stoi(argv[4]), pass = std::stoi(argv[5]);
    const std::chrono::microseconds delay(std::stoll(argv[6]));
    const bool dies = victim == static_cast<int>(ranks.rank());
    const auto die_later = [delay] {
      std::thread([delay] {
        std::this_thread::sleep_for(delay);
        std::raise(SIGKILL);
      }).detach();
    };
    if (dies && pass == 0) die_later();
    int ended = 0;
    Progress progress([&](const Progress::State* state) {
      if (!state && ++ended == pass && dies) die_later();
    });
    OpenGridOptions grid;
    grid.grid = argv[1];
    grid.solutions = {argv[2]};
    const DerivedSource source(openGrid(grid), {});
    if (argc == 7)
      convertFirst(source, argv[3], ranks, progress);
    else
      addNamed(source, argv[3], argv[7], ranks, progress);
    if (ranks.isFirst())
      for (const Progress::Phase& phase : progress.phases())
        fmt::print("{} {:.6f}\n", phase.name, phase.seconds);
    finishRanks();
    return 0;
  } catch (const std::exception& error) {
    endRanksAfter(error.what(), 1);
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}
