// Writes what fuzzing begins with: make_seeds FOLDER makes FOLDER/<target>/<seed> for every target. Inputs
// that fuzzing has found are beside them in corpus/, and stay there.
#include <cstdio>

#include "tests/fuzz/seeds.h"

int main(int argc, char** argv) {
  using namespace curvisplat;
  if (argc != 2) {
    std::fputs("usage: make_seeds FOLDER\n", stderr);
    return 2;
  }
  const Seeds seeds(argv[1]);
  writeCacheSeeds(seeds);
  writeInputSeeds(seeds);
}
