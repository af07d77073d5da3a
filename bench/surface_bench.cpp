// Draws a sheet of quads, or lines, as the layers of a picture of 600x600. Items are quads, or segments.
#include <benchmark/benchmark.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "render/camera/camera.h"
#include "render/mesh/curve_set.h"
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

/// Helices of a thousand segments, three pixels wide, in [0, 1]³.
std::shared_ptr<SurfaceScene> linesOf(size_t lines) {
  constexpr int kSegments = 1000;
  std::mt19937 random(3);
  const auto any = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<glm::dvec3> points;
  std::vector<uint32_t> begins{0};
  std::vector<float> values;
  for (size_t line = 0; line < lines; ++line) {
    const glm::dvec3 middle(any(), any(), any());
    const glm::dvec3 way = glm::normalize(glm::dvec3(any() - 0.5, any() - 0.5, any() - 0.5));
    const double radius = 0.02 + 0.05 * any(), turns = 2 + 6 * any();
    for (int n = 0; n <= kSegments; ++n) {
      const double part = static_cast<double>(n) / kSegments, angle = 2 * std::numbers::pi * turns * part;
      points.push_back(middle + 0.8 * (part - 0.5) * way +
                       radius * glm::dvec3(std::cos(angle), std::sin(angle), std::sin(angle + 1)));
      values.push_back(static_cast<float>(part));
    }
    begins.push_back(static_cast<uint32_t>(points.size()));
  }
  auto scene = std::make_shared<SurfaceScene>();
  scene->curves.emplace_back().set =
      std::make_shared<CurveSet>(curveSetOf(points, std::move(begins), std::move(values)));
  return scene;
}

void lines(benchmark::State& state) {
  const auto scene = linesOf(static_cast<size_t>(state.range(0)));
  Camera camera;
  camera.focal_point = {0.5, 0.5, 0.5};
  camera.position = {1.9, -1.4, 1.6};
  camera.parallel_scale = 0.6;
  const ScreenView view = ScreenView::of(camera, kSize, glm::dvec3(1.0), kLowPass, 1e-3);
  const ColourTable colours(TransferFunction::preset("viridis", 0, 1, 1));
  const SceneLook look{colours, {}, {}, 0};
  tbb::task_arena arena(static_cast<int>(state.range(1)));
  arena.execute([&] {
    ScreenVertices memory;
    for (auto _ : state) benchmark::DoNotOptimize(layersOf(*scene, view, {}, look, &memory));
  });
  state.SetItemsProcessed(1000 * state.range(0) * static_cast<int64_t>(state.iterations()));
}
BENCHMARK(lines)
    ->ArgNames({"lines", "threads"})
    ->ArgsProduct({{10, 100, 1000}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

}  // namespace
}  // namespace curvisplat
