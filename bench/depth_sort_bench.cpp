// Sorts a brick's splats by depth on one core, with and without moving the 40 bytes of each. Items are
// splats.
#include <benchmark/benchmark.h>

#include <random>
#include <vector>

#include "render/project/depth_sort.h"
#include "render/project/projection.h"

namespace curvisplat {
namespace {

/// `smooth`: neighbouring splats have similar depths, as in grid order; else depths are random.
std::vector<uint32_t> keysOf(size_t count, bool smooth) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<uint32_t> keys(count);
  for (size_t n = 0; n < count; ++n) {
    const float depth = smooth ? static_cast<float>(n % 64) / 64 + 0.01f * unit(random) : unit(random);
    keys[n] = static_cast<uint32_t>(0x04000000 * depth);  // a brick has a part of all depths
  }
  return keys;
}

void sort(benchmark::State& state, bool moves) {
  const auto count = static_cast<size_t>(state.range(0));
  const std::vector<uint32_t> keys = keysOf(count, state.range(1) == 1);
  const std::vector<ScreenSplat> splats(count);
  std::vector<ScreenSplat> sorted(count);
  DepthSorter sorter;
  for (auto _ : state) {
    const auto order = sorter.sort(keys);
    benchmark::DoNotOptimize(order.data());
    if (!moves) continue;
    for (size_t n = 0; n < count; ++n) sorted[n] = splats[order[n].splat];
    benchmark::DoNotOptimize(sorted.data());
  }
  const auto items = static_cast<int64_t>(count) * static_cast<int64_t>(state.iterations());
  state.SetItemsProcessed(items);
  if (moves) state.SetBytesProcessed(items * static_cast<int64_t>(sizeof(ScreenSplat)));
}
void depthSort(benchmark::State& state) {
  sort(state, false);
}
void depthSortAndMove(benchmark::State& state) {
  sort(state, true);
}
#define CURVISPLAT_SORT(name) \
  BENCHMARK(name)->ArgNames({"splats", "smooth"})->ArgsProduct({{512, 4096, 16384, 65536}, {1, 0}})
CURVISPLAT_SORT(depthSort);
CURVISPLAT_SORT(depthSortAndMove);

}  // namespace
}  // namespace curvisplat
