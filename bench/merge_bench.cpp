// Merges splats of one scalar into the voxels of an inner brick on one core.
#include <benchmark/benchmark.h>

#include <random>

#include "preprocess/shape/merge.h"

namespace curvisplat {
namespace {

/// 8 full bricks into a lattice of 32³ voxels: 16 splats a voxel, voxel after voxel (nearly as in grid order)
/// or at random.
void mergeVoxels(benchmark::State& state) {
  const bool in_order = state.range(0) == 1;
  const bool finish = state.range(1) == 1;
  constexpr size_t kVoxels = 32 * 32 * 32, kSplats = 16 * kVoxels;
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Splat> splats(4096);
  std::vector<SplatScalar> values(splats.size());
  for (size_t n = 0; n < splats.size(); ++n) {
    splats[n] = {{unit(random), unit(random), unit(random)}, {1, 0.5, 0.1}, {0.1, 0.2, 0.3}, 0.05};
    values[n] = {unit(random), {unit(random), 0.1, 0.2}, 0.01};
  }
  std::vector<uint32_t> voxel_of(kSplats);
  for (size_t n = 0; n < kSplats; ++n)
    voxel_of[n] = static_cast<uint32_t>(in_order ? n / 16 : random() % kVoxels);

  VoxelMerger merger(1, kVoxels);
  for (auto _ : state) {
    merger.clear();
    for (size_t n = 0; n < kSplats; ++n) {
      const size_t at = n % splats.size();
      merger.add(voxel_of[n], splats[at].position, splats[at], {&values[at], 1});
    }
    if (!finish) continue;
    Splat splat;
    SplatScalar value;
    double detail = 0;
    for (size_t voxel = 0; voxel < kVoxels; ++voxel) {
      if (merger.count(voxel) == 0) continue;
      merger.finish(voxel, splat, {&value, 1});
      benchmark::DoNotOptimize(detail += merger.detail(voxel));
    }
  }
  state.counters["splats"] =
      benchmark::Counter(static_cast<double>(kSplats * state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(mergeVoxels)->ArgNames({"in_order", "finish"})->ArgsProduct({{1, 0}, {0, 1}});

}  // namespace
}  // namespace curvisplat
