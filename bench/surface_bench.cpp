// Draws a sheet of quads as the layers of a picture of 600x600. Items are quads.
#include <benchmark/benchmark.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <memory>

#include "render/camera/camera.h"
#include "render/surface/scene_layers.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{600, 600};

/// side x side quads, wavy, in [0, 1] x [0, 1].
std::shared_ptr<SurfaceScene> sheetOf(uint32_t side) {
  RawMesh raw;
  for (uint32_t j = 0; j <= side; ++j)
    for (uint32_t i = 0; i <= side; ++i) {
      const double x = 1.0 * i / side, y = 1.0 * j / side;
      raw.positions.emplace_back(x, y, 0.05 * std::sin(12 * x) * std::cos(9 * y));
    }
  for (uint32_t j = 0; j < side; ++j)
    for (uint32_t i = 0; i < side; ++i) {
      const uint32_t a = j * (side + 1) + i, b = a + 1, c = a + side + 1, d = c + 1;
      raw.triangles.insert(raw.triangles.end(), {{a, b, d}, {a, d, c}});
    }
  auto scene = std::make_shared<SurfaceScene>();
  scene->surfaces.push_back({std::make_shared<TriangleMesh>(meshOf(std::move(raw)))});
  return scene;
}

void sheet(benchmark::State& state) {
  const auto side = static_cast<uint32_t>(state.range(0));
  const auto scene = sheetOf(side);
  Camera camera;
  camera.focal_point = {0.5, 0.5, 0};
  camera.position = {0.9, -0.4, 1.6};
  camera.parallel_scale = 0.55;
  if (state.range(2)) camera.projection = Projection::kPerspective;
  const ScreenView view = ScreenView::of(camera, kSize, glm::dvec3(1.0), kLowPass, 1e-3);
  const ColourTable colours(TransferFunction::preset("viridis", 0, 1, 1));
  const SceneLook look{colours, {}, {}, 0};
  tbb::task_arena arena(static_cast<int>(state.range(1)));
  arena.execute([&] {
    ScreenVertices memory;  // as between the frames of a program
    for (auto _ : state) benchmark::DoNotOptimize(layersOf(*scene, view, {}, look, &memory));
  });
  state.SetItemsProcessed(static_cast<int64_t>(side) * side * static_cast<int64_t>(state.iterations()));
}
BENCHMARK(sheet)
    ->ArgNames({"side", "threads", "perspective"})
    ->ArgsProduct({{64, 256, 1024}, {1, 2}, {0, 1}})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

}  // namespace
}  // namespace curvisplat
