// make_sparse_cache OUT.splats BRICKS: makes a cache of that many bricks, of which only the coarsest have
// data (test_caches.h), to measure with: `make_sparse_cache a.splats 1000000 && curvisplat render a.splats
// ...`
#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <exception>

#include "tests/support/test_caches.h"

int main(int count, char** words) {
  if (count != 3) {
    fmt::print(stderr, "usage: make_sparse_cache OUT.splats BRICKS\n");
    return 2;
  }
  try {
    curvisplat::writeSparseCache(words[1], std::strtoull(words[2], nullptr, 10));
  } catch (const std::exception& error) {
    fmt::print(stderr, "make_sparse_cache: {}\n", error.what());
    return 1;
  }
}
