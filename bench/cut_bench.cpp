// Chooses the cut of an index of 400,000 bricks on one core. "bricks" counts the bricks that are visited.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "stream/paging/cut.h"

namespace curvisplat {
namespace {

/// An octree in which each level lacks one octant in ten: 400,000 bricks in eight levels, as a cache of about
/// 10 billion nodes has.
struct SyntheticIndex {
  RootCube root{glm::dvec3(-1), 2};
  std::vector<Brick> bricks;
  std::vector<BrickVariable> variables;
  std::vector<ValueBounds> subtrees;

  SyntheticIndex() {
    constexpr size_t kBricks = 400'000;
    std::mt19937 random(1);
    std::uniform_real_distribution<float> unit(0, 1);
    bricks.push_back(brick({}));
    for (size_t id = 0; id < bricks.size(); ++id) {
      const Cell cell = bricks[id].cell;
      if (bricks.size() >= kBricks || cell.level == 7) continue;
      const auto first = static_cast<uint32_t>(bricks.size());
      for (int octant = 0; octant < 8; ++octant) {
        if (unit(random) < 0.1f) continue;
        bricks.push_back(brick(cell.child(octant)));
        bricks.back().parent = static_cast<uint32_t>(id);
      }
      bricks[id].first_child = first;
      bricks[id].child_count = static_cast<uint32_t>(bricks.size()) - first;
    }
    for (Brick& each : bricks) {
      each.error = each.isLeaf() ? 0.0f : static_cast<float>(root.cellSize(each.cell.level) / 32);
      each.octant_splats.fill(4000);
      each.splats = 32000;
      each.geometry.length = 200'000;
      const float low = unit(random);
      variables.push_back({{0, 50'000, 0}, low, low + 0.1f, 0.01f, 0.01f});
    }
    subtrees = subtreeBounds(bricks, variables);
  }

  Brick brick(const Cell& cell) const {
    Brick made;
    made.cell = cell;
    made.lower = root.cellMin(cell);
    made.upper = made.lower + root.cellSize(cell.level);
    made.largest_radius = static_cast<float>(root.cellSize(cell.level) / 20);
    return made;
  }
};

CutView wholeView(bool perspective) {
  CutView view;
  view.perspective = perspective;
  view.eye = {3, 2, 2.5};
  view.towards_viewer = {0.68, 0.46, 0.57};
  view.pixels = 500;
  for (const glm::dvec3& normal : {glm::dvec3(0, 0.78, -0.63), glm::dvec3(0, -0.78, 0.63),
                                   glm::dvec3(0.73, -0.43, -0.53), glm::dvec3(-0.73, 0.43, 0.53)})
    view.planes.push_back({normal, 10});
  return view;
}

void run(benchmark::State& state, const CutOptions& options, bool perspective) {
  static const SyntheticIndex index;
  const CutTree tree{index.root, index.bricks, index.variables, index.subtrees};
  const CutView view = wholeView(perspective);
  // As costly as the renderer's test: two look-ups in a table of where there is extinction.
  std::vector<uint32_t> extinction_before(4097);
  for (size_t n = 0; n < extinction_before.size(); ++n) extinction_before[n] = static_cast<uint32_t>(n);
  const TransparentBounds transparent = [&](const ValueBounds& values) {
    const float spread = 2 * std::hypot(values.largest_slope, values.largest_deviation);
    const auto cell = [](float value) {
      return static_cast<size_t>(std::clamp(2048 * value, 0.0f, 4095.0f));
    };
    return extinction_before[cell(values.min - spread)] == extinction_before[cell(values.max + spread) + 1];
  };
  Cut cut;
  for (auto _ : state) {
    cut = chooseCut(tree, view, transparent, options);
    benchmark::DoNotOptimize(cut.parts.data());
  }
  // All parts and their ancestors: for a cut of n parts in an octree about 8/7 n.
  std::vector<bool> looked_at(index.bricks.size());
  for (const BrickPart& part : cut.parts)
    for (uint32_t id = part.brick; id != kNoBrick && !looked_at[id]; id = index.bricks[id].parent)
      looked_at[id] = true;
  const auto bricks = static_cast<double>(std::count(looked_at.begin(), looked_at.end(), true));
  state.counters["parts"] = static_cast<double>(cut.parts.size());
  state.counters["bricks"] = bricks;
  state.counters["s_per_brick"] =
      benchmark::Counter(bricks * static_cast<double>(state.iterations()),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void cutAllLeaves(benchmark::State& state) {
  CutOptions options;
  options.lod_pixels = 0;
  run(state, options, state.range(0) == 1);
}
BENCHMARK(cutAllLeaves)->ArgName("perspective")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

void cutMaxSplats(benchmark::State& state) {
  CutOptions options;
  options.lod_pixels = 0;
  options.max_splats = static_cast<uint64_t>(state.range(1)) * 1'000'000;
  run(state, options, state.range(0) == 1);
}
BENCHMARK(cutMaxSplats)
    ->ArgNames({"perspective", "million"})
    ->ArgsProduct({{0, 1}, {1, 100, 1'000'000}})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace curvisplat
