// A conversion by several ranks of which one is killed in a given pass, for tests of what it leaves:
//
//    mpirun -n 3 dying_ranks GRID FUNCTION OUTPUT VICTIM PASS DELAY_US
//
// Rank VICTIM kills itself DELAY_US microseconds after its first PASS passes have ended; VICTIM -1: none does, and rank 0
// prints the seconds of each pass. Converts the first scalar in one thread within 256 MiB.
#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>
#include <thread>

#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/open_grid.h"
#include "stream/base/progress.h"
#include "tools/output/launched_ranks.h"

int main(int argc, char** argv) {
  using namespace curvisplat;
  if (argc != 7) return 2;
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
    ConvertOptions options;
    options.output = argv[3];
    options.scalars = {0};
    options.memory_bytes = uint64_t{256} << 20;
    options.threads = 1;
    options.title = "in";
    options.ranks = &ranks;
    convert(*openGrid(grid), options, progress);
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
