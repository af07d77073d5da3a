// A conversion that is killed at a given system call, for tests of what it leaves:
//
//    dying_convert GRID FUNCTION OUTPUT BUCKET_SPLATS KILL_AT writes|all [resume] [overwrite] [surfaces]
//
// Converts the first scalar. If the conversion ends before it is killed (KILL_AT -1: always), prints the
// number of calls.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <span>
#include <string>

#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/formats/open/open_grid.h"
#include "tests/support/dying_system_calls.h"

int main(int argc, char** argv) {
  using namespace curvisplat;
  try {
    const std::span<char*> words(argv, static_cast<size_t>(argc));
    const auto says = [&](const std::string& word) {
      return std::find(words.begin() + 6, words.end(), word) != words.end();
    };
    OpenGridOptions grid;
    grid.grid = words[1];
    grid.solutions = {words[2]};
    ConvertOptions options;
    options.output = words[3];
    options.bucket_splats = std::stoull(words[4]);
    options.scalars = {0};
    options.memory_bytes = leastMemory(1);
    options.title = "killed";
    options.resume = says("resume");
    options.surfaces = says("surfaces");
    options.overwrite = says("overwrite");
    const auto source = openGrid(grid);

    faults::DyingSystemCalls calls;
    calls.die_at = std::stoll(words[5]);
    calls.count_reads = says("all");
    const ScopedSystemCalls scope(calls);
    Progress progress;
    convert(*source, options, progress);
    fmt::print("{}\n", calls.calls.load());
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}
