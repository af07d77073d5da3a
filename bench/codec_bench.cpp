// Encodes and decodes a brick of one scalar on one core: a curved, stretched block in grid order, which is
// what the predictors are made for. Items are splats, bytes are those of the encoded streams.
#include <benchmark/benchmark.h>

#include <cmath>

#include "stream/codec/brick_codec.h"

namespace curvisplat {
namespace {

constexpr uint64_t kSide = 32;
const RootCube kRoot{glm::dvec3(-2), 4};

/// kSide³ nodes of a quarter of an annulus, whose outermost cells are e² times as long as the innermost.
BrickSplats curvedBrick() {
  BrickSplats brick;
  auto& values = brick.variables.emplace_back();
  for (uint64_t k = 0; k < kSide; ++k)
    for (uint64_t j = 0; j < kSide; ++j) {
      brick.runs.push_back({0, 0, j, k, kSide});
      for (uint64_t i = 0; i < kSide; ++i) {
        const double u = double(i) / kSide, v = double(j) / kSide, w = double(k) / kSide;
        const double angle = 1.5 * u, radius = 0.3 + std::expm1(2 * v) / std::expm1(2.0);
        Splat splat;
        splat.position = {radius * std::cos(angle), radius * std::sin(angle), w + 0.1 * std::sin(3 * angle)};
        splat.axis = {1.5 * radius / kSide, 2 * std::exp(2 * v) / std::expm1(2.0) / kSide, 1.0 / kSide};
        splat.shear = {0.1 * std::sin(angle), 0.1 * std::cos(3 * angle), 0.05 * v};
        splat.weight = splat.axis[0] * splat.axis[1] * splat.axis[2];
        brick.positions.push_back(kRoot.fromWorld(splat.position));
        brick.splats.push_back(splat);
        values.push_back({std::sin(5 * u) * v, {0.1 * std::cos(5 * u) / kSide, 0.02, 0}, 0});
      }
    }
  return brick;
}

void report(benchmark::State& state, const EncodedBrick& encoded) {
  const auto runs = static_cast<int64_t>(state.iterations());
  state.SetItemsProcessed(static_cast<int64_t>(encoded.brick.splats) * runs);
  state.SetBytesProcessed(static_cast<int64_t>(encoded.geometry.size() + encoded.values[0].size()) * runs);
}

void codecEncode(benchmark::State& state) {
  const BrickSplats original = curvedBrick();
  EncodedBrick encoded;
  for (auto _ : state) {
    BrickSplats brick = original;
    encoded = encodeBrick(kRoot, brick);
    benchmark::DoNotOptimize(encoded.geometry.data());
  }
  report(state, encoded);
}
BENCHMARK(codecEncode)->Unit(benchmark::kMillisecond);

void codecDecode(benchmark::State& state) {
  BrickSplats brick = curvedBrick();
  const EncodedBrick encoded = encodeBrick(kRoot, brick);
  SplatGeometry geometry;
  SplatVariable values;
  for (auto _ : state) {
    decodeGeometry(kRoot, encoded.brick, encoded.geometry, geometry);
    decodeVariable(encoded.brick, encoded.variables[0], encoded.values[0], values);
    benchmark::DoNotOptimize(geometry.x.data());
  }
  report(state, encoded);
}
BENCHMARK(codecDecode)->Unit(benchmark::kMillisecond);

/// Decodes in double precision, as conversion does to merge bricks.
void codecDecodeForMerging(benchmark::State& state) {
  BrickSplats brick = curvedBrick();
  const EncodedBrick encoded = encodeBrick(kRoot, brick);
  for (auto _ : state)
    benchmark::DoNotOptimize(
        decodeForMerging(kRoot, encoded.brick, encoded.geometry, encoded.variables, encoded.values)
            .splats.data());
  report(state, encoded);
}
BENCHMARK(codecDecodeForMerging)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace curvisplat
