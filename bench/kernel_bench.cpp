// Evaluates the kernel and its footprint on one core. Items are values.
#include <benchmark/benchmark.h>

#include <cstdint>

#include "render/project/footprint.h"

namespace curvisplat {
namespace {

constexpr int kValues = 1024;

void kernelValues(benchmark::State& state) {
  for (auto _ : state)
    for (int n = 0; n < kValues; ++n) benchmark::DoNotOptimize(kernel(kKernelSupport * n / kValues));
  state.SetItemsProcessed(kValues * static_cast<int64_t>(state.iterations()));
}
BENCHMARK(kernelValues);

/// The footprint by quadrature.
void footprintValues(benchmark::State& state) {
  for (auto _ : state)
    for (int n = 0; n < kValues; ++n) benchmark::DoNotOptimize(footprint(kKernelSupport * n / kValues));
  state.SetItemsProcessed(kValues * static_cast<int64_t>(state.iterations()));
}
BENCHMARK(footprintValues)->Unit(benchmark::kMillisecond);

/// The footprint's table, which a painter makes once.
void footprintTableOfAPainter(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(footprintTable(kValues).data());
  state.SetItemsProcessed((kValues + 1) * static_cast<int64_t>(state.iterations()));
}
BENCHMARK(footprintTableOfAPainter)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace curvisplat
