// The work of a frame's worker, from memory on one core: verify, decode, project and sort bricks, each step
// alone and all together. Items are splats.
//
// The bricks are those of the cache that CURVISPLAT_BENCH_CACHE names. Without it, a half annulus of 2 M
// nodes in single precision is converted into the temporary folder first.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/colour/transfer_function.h"
#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "stream/base/checksum.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/cache_reader.h"
#include "stream/codec/brick_codec.h"

namespace curvisplat {
namespace {

/// All leaves, or all inner bricks, of a cache; read once.
class Bricks {
 public:
  static const Bricks& leaves() {
    static const Bricks bricks(true);
    return bricks;
  }
  static const Bricks& inner() {
    static const Bricks bricks(false);
    return bricks;
  }

  struct Bytes {
    uint32_t id;
    std::vector<std::byte> geometry, values;
  };
  std::vector<Bytes> bytes;
  int64_t splats = 0;
  int64_t geometry_bytes = 0, values_bytes = 0;  // of the streams

  static const CacheReader& cache() {
    static const CacheReader reader(path());
    return reader;
  }

 private:
  explicit Bricks(bool leaves) {
    const InputFile geometry(cache().path() / cache().manifest().steps.front().geometry);
    const InputFile values(cache().path() / variableFileName(cache().manifest().variables.front()));
    for (uint32_t id = 0; id < cache().bricks().size() && splats < (int64_t{4} << 20); ++id) {
      const Brick& brick = cache().bricks()[id];
      if (brick.isLeaf() != leaves) continue;
      const Extent& of_values = cache().brickVariables(0)[id].values;
      Bytes& read = bytes.emplace_back();
      read.id = id;
      read.geometry.resize(brick.geometry.length);
      read.values.resize(of_values.length);
      geometry.readAt(brick.geometry.offset, std::span(read.geometry));
      values.readAt(of_values.offset, std::span(read.values));
      splats += brick.splats;
      geometry_bytes += brick.geometry.length;
      values_bytes += of_values.length;
    }
  }

  static std::filesystem::path path() {
    if (const char* named = std::getenv("CURVISPLAT_BENCH_CACHE")) return named;
    const SceneGridSource source(makeScene("half-annulus"), {128, 128, 128}, 4);
    ConvertOptions options;
    options.output = std::filesystem::temp_directory_path() /
                     ("curvisplat-bench-" + std::to_string(::getpid()) + ".splats");
    options.scalars = {0};
    Progress progress;
    convert(source, options, progress);
    static const struct Remover {
      std::filesystem::path path;
      ~Remover() { std::filesystem::remove_all(path); }
    } remover{options.output};
    return options.output;
  }
};

/// A view of all data, and a transfer function.
struct View {
  explicit View(Projection projection)
      : settings{ScreenView::of(camera(projection), {600, 600}, glm::dvec3(1), 1.5, 1e-3)},
        table(ClassificationTable::of(function(), info().min, info().max)) {}

  static const VariableInfo& info() { return Bricks::cache().manifest().variables.front(); }
  static TransferFunction function() {
    return TransferFunction::preset("viridis", info().min, info().max, 1);
  }
  static Camera camera(Projection projection) {
    const Manifest& manifest = Bricks::cache().manifest();
    return Camera::named("iso", manifest.lower, manifest.upper, {600, 600}, projection, 30);
  }

  ProjectionSettings settings;
  ClassificationTable table;
};

void verify(benchmark::State& state) {
  const Bricks& bricks = state.range(0) ? Bricks::leaves() : Bricks::inner();
  for (auto _ : state)
    for (const auto& brick : bricks.bytes)
      benchmark::DoNotOptimize(checksumOf(brick.geometry) ^ checksumOf(brick.values));
  state.SetItemsProcessed(state.iterations() * bricks.splats);
  state.SetBytesProcessed(state.iterations() * (bricks.geometry_bytes + bricks.values_bytes));
}
BENCHMARK(verify)->ArgName("leaves")->Arg(1)->Arg(0)->Unit(benchmark::kMillisecond);

void decodeGeometryBench(benchmark::State& state) {
  const Bricks& bricks = state.range(0) ? Bricks::leaves() : Bricks::inner();
  SplatGeometry geometry;
  for (auto _ : state)
    for (const auto& brick : bricks.bytes)
      decodeGeometry(Bricks::cache().manifest().root, Bricks::cache().bricks()[brick.id], brick.geometry,
                     geometry);
  state.SetItemsProcessed(state.iterations() * bricks.splats);
  state.SetBytesProcessed(state.iterations() * bricks.geometry_bytes);
}
BENCHMARK(decodeGeometryBench)
    ->Name("decodeGeometry")
    ->ArgName("leaves")
    ->Arg(1)
    ->Arg(0)
    ->Unit(benchmark::kMillisecond);

void decodeValues(benchmark::State& state) {
  const Bricks& bricks = state.range(0) ? Bricks::leaves() : Bricks::inner();
  SplatVariable values;
  for (auto _ : state)
    for (const auto& brick : bricks.bytes)
      decodeVariable(Bricks::cache().bricks()[brick.id], Bricks::cache().brickVariables(0)[brick.id],
                     brick.values, values);
  state.SetItemsProcessed(state.iterations() * bricks.splats);
  state.SetBytesProcessed(state.iterations() * bricks.values_bytes);
}
BENCHMARK(decodeValues)->ArgName("leaves")->Arg(1)->Arg(0)->Unit(benchmark::kMillisecond);

/// Projects, or projects and sorts; decoding is not timed if `decode` is false.
void prepare(benchmark::State& state, bool decode, bool sort) {
  const Bricks& bricks = state.range(0) ? Bricks::leaves() : Bricks::inner();
  const View view(state.range(1) ? Projection::kPerspective : Projection::kOrthographic);
  const CacheReader& cache = Bricks::cache();
  std::vector<SplatGeometry> geometry(bricks.bytes.size());
  std::vector<SplatVariable> values(bricks.bytes.size());
  const auto decodeOne = [&](size_t n, size_t to) {
    const auto& brick = bricks.bytes[n];
    decodeGeometry(cache.manifest().root, cache.bricks()[brick.id], brick.geometry, geometry[to]);
    decodeVariable(cache.bricks()[brick.id], cache.brickVariables(0)[brick.id], brick.values, values[to]);
  };
  if (!decode)
    for (size_t n = 0; n < bricks.bytes.size(); ++n) decodeOne(n, n);
  BrickProjector projector;
  const DepthKeys depth_keys(view.settings.view, cache.manifest().root);
  std::vector<uint32_t> keys;
  DepthSorter sorter;
  std::vector<ScreenSplat> out(BrickProjector::kMaxSplats);
  uint64_t drawn = 0;
  for (auto _ : state) {
    drawn = 0;
    for (size_t n = 0; n < bricks.bytes.size(); ++n) {
      const auto& brick = bricks.bytes[n];
      if (decode) {
        benchmark::DoNotOptimize(checksumOf(brick.geometry) ^ checksumOf(brick.values));
        decodeOne(n, 0);
      }
      const size_t from = decode ? 0 : n;
      projector.project(view.settings, view.table,
                        cache.manifest().root.cellMin(cache.bricks()[brick.id].cell), geometry[from],
                        values[from]);
      drawn += projector.counts().drawn;
      if (!sort) continue;
      const Brick& of_index = cache.bricks()[brick.id];
      keys.resize(projector.depths().size());
      depth_keys.setKeys(projector.mutableSplats(), projector.depths(),
                         cache.manifest().root.cellMin(of_index.cell), depth_keys.rangeOf(of_index), keys);
      const auto order = sorter.sort(keys);
      for (size_t i = 0; i < order.size(); ++i) out[i] = projector.splats()[order[i].splat];
      benchmark::DoNotOptimize(out.data());
    }
  }
  state.SetItemsProcessed(state.iterations() * bricks.splats);
  state.counters["drawn"] = static_cast<double>(drawn) / static_cast<double>(bricks.splats);
}
void project(benchmark::State& state) {
  prepare(state, false, false);
}
void projectAndSort(benchmark::State& state) {
  prepare(state, false, true);
}
void decodeProjectAndSort(benchmark::State& state) {
  prepare(state, true, true);
}
#define CURVISPLAT_PREPARE(name)            \
  BENCHMARK(name)                           \
      ->ArgNames({"leaves", "perspective"}) \
      ->ArgsProduct({{1, 0}, {0, 1}})       \
      ->Unit(benchmark::kMillisecond)
CURVISPLAT_PREPARE(project);
CURVISPLAT_PREPARE(projectAndSort);
CURVISPLAT_PREPARE(decodeProjectAndSort);

}  // namespace
}  // namespace curvisplat
