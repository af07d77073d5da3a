// Both painters on the same splats: round ones of one radius, anywhere in an image of 600x600.
//
//   radius   of the footprint, in pixels
//   kind     0 flat splats; 1 classified per pixel, smooth transfer function; 2 the same, function with steps
//
// `pixels` counts the pixels inside of footprints.
#include <benchmark/benchmark.h>

#include <cmath>
#include <random>
#include <vector>

#include "render/backend/backend.h"
#include "render/project/footprint.h"

namespace curvisplat {
namespace {

constexpr ImageSize kPaintedPicture{600, 600};
constexpr float kPictureSide = 600;
enum Kind { kFlat, kSmooth, kSteps };

ClassificationTable tableFor(int64_t kind) {
  return {[kind](double f) {
            const glm::dvec3 colour(f, 0.5 + 0.5 * std::sin(5 * f), 1 - f);
            const double extinction = kind == kSteps ? (std::fmod(10 * f, 2) < 1 ? 0.1 : 3) : 2 * f * f;
            return TransferFunction::Value{colour, extinction};
          },
          0, 1};
}

/// Splats that cover about 20 million pixels. Their slopes are those of a grid with 50 nodes over the
/// scalar's range.
std::vector<ScreenSplat> roundSplats(float radius) {
  const auto l = radius / static_cast<float>(kKernelSupport);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  std::vector<ScreenSplat> splats(static_cast<size_t>(2e7 / (M_PI * radius * radius)));
  for (ScreenSplat& splat : splats)
    splat = {kPictureSide * unit(random),
             kPictureSide * unit(random),
             l,
             0,
             l,
             0.2f * unit(random),
             unit(random),
             0.02f * around(random),
             0.02f * around(random),
             0.01f * unit(random),
             0,
             0,
             0,
             0,
             0,
             0};
  return splats;
}

void paint(benchmark::State& state, Backend which) {
  const auto backend = makeBackend(which);
  const auto radius = static_cast<float>(state.range(0));
  const auto splats = roundSplats(radius);
  const ClassificationTable table = tableFor(state.range(1));
  constexpr size_t kSegment = 16384;
  for (auto _ : state)
    backend->run([&](Painter& painter) {
      painter.begin(kPaintedPicture, glm::vec4(1), table, {.per_pixel = state.range(1) != kFlat});
      for (size_t n = 0; n < splats.size(); n += kSegment)
        painter.draw(std::span(splats).subspan(n, std::min(kSegment, splats.size() - n)));
      benchmark::DoNotOptimize(painter.end().rgba.data());
    });
  const auto count = static_cast<double>(splats.size()) * static_cast<double>(state.iterations());
  state.counters["splats"] = benchmark::Counter(count, benchmark::Counter::kIsRate);
  state.counters["pixels"] = benchmark::Counter(count * M_PI * radius * radius, benchmark::Counter::kIsRate);
}

void arguments(benchmark::internal::Benchmark* bench) {
  bench->ArgNames({"radius", "kind"})->MeasureProcessCPUTime()->UseRealTime()->Unit(benchmark::kMillisecond);
  for (const int kind : {kFlat, kSmooth, kSteps})
    for (const int radius : {2, 4, 8, 16}) bench->Args({radius, kind});
}

BENCHMARK_CAPTURE(paint, cpu, Backend::kCpu)->Apply(arguments);
BENCHMARK_CAPTURE(paint, osmesa, Backend::kOsmesa)->Apply(arguments);

}  // namespace
}  // namespace curvisplat
