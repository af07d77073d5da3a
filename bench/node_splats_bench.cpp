// Turns nodes of one scalar into splats on one core.
#include <benchmark/benchmark.h>

#include <cmath>

#include "preprocess/splats/node_splats.h"

namespace curvisplat {
namespace {

/// A stretched, curved block of n³ nodes with one scalar.
NodeArrays curvedBlock(uint64_t n) {
  NodeArrays nodes;
  nodes.scalars.resize(1);
  for (uint64_t k = 0; k < n; ++k) {
    for (uint64_t j = 0; j < n; ++j) {
      for (uint64_t i = 0; i < n; ++i) {
        const double u = double(i) / double(n - 1), v = double(j) / double(n - 1),
                     w = double(k) / double(n - 1);
        const double r = 0.3 + 0.7 * std::expm1(5 * v) / std::expm1(5.0);
        nodes.x.push_back(-r * std::sin(3 * u));
        nodes.y.push_back(r * std::cos(3 * u));
        nodes.z.push_back(w + 0.1 * r * std::sin(9 * u));
        nodes.scalars[0].push_back(static_cast<float>(u * v + w));
      }
    }
  }
  nodes.blank.assign(n * n * n, 0);
  return nodes;
}

void nodeSplats(benchmark::State& state) {
  const uint64_t n = 96;
  NodeArrays nodes = curvedBlock(n);
  if (state.range(0) > 0)
    for (size_t at = 0; at < nodes.blank.size(); at += static_cast<size_t>(state.range(0)))
      nodes.blank[at] = 1;
  const BlockWindow window{{"block 1", n, n, n, true}, 0, {0, n, 0, n}, &nodes};
  NodeScratch scratch;
  NodeSplats splats;
  uint64_t k = 0;
  for (auto _ : state) {
    computeNodeSplats(window, {0, n, k, k + 4}, scratch, splats);
    benchmark::DoNotOptimize(splats.splats.data());
    k = (k + 4) % n;
  }
  state.counters["nodes"] =
      benchmark::Counter(static_cast<double>(n * n * 4 * state.iterations()), benchmark::Counter::kIsRate);
}
// Argument: every how many nodes one is blanked; 0: none.
BENCHMARK(nodeSplats)->ArgName("blank_every")->Arg(0)->Arg(1001)->Arg(31);

}  // namespace
}  // namespace curvisplat
