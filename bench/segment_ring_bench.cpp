// The queue between workers and painter: the cost of handing over segments, which are not filled, by one
// worker and by several. Items are segments; a frame has some hundreds of them.
#include <benchmark/benchmark.h>

#include <atomic>
#include <vector>

#include "render/sweep/segment_ring.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

void segmentRing(benchmark::State& state) {
  constexpr uint64_t kSegments = 2000;
  const auto workers = static_cast<unsigned>(state.range(0));
  const auto splats = static_cast<size_t>(state.range(1));
  std::vector<ScreenSplat> memory(1'600'000);  // of 64 MB, as a frame's
  SegmentRing ring(memory);
  WorkerTeam team(workers, "bench");
  for (auto _ : state) {
    ring.reset();
    std::atomic<uint64_t> next = 0;
    team.start([&](unsigned) {
      for (uint64_t sequence = next++; sequence < kSegments; sequence = next++) {
        benchmark::DoNotOptimize(ring.acquire(sequence, splats));
        ring.commit(sequence);
      }
    });
    for (uint64_t sequence = 0; sequence < kSegments; ++sequence) {
      benchmark::DoNotOptimize(ring.next());
      ring.release();
    }
    team.wait();
  }
  state.SetItemsProcessed(static_cast<int64_t>(kSegments) * static_cast<int64_t>(state.iterations()));
}
BENCHMARK(segmentRing)
    ->ArgNames({"workers", "splats"})
    ->ArgsProduct({{1, 2, 4}, {0, 1000, 65536}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace curvisplat
