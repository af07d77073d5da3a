// Reads bricks from the disk without decoding them: the pager, in the order of a cut, compared with a plain
// reader of the same files that reads 256 KiB after 256 KiB with direct I/O, eight reads at once. Bytes are
// those of the streams.
//
// The caches contain random bytes. They are made in CURVISPLAT_BENCH_FOLDER (default: the temporary folder),
// which must be on the disk to be measured and have 700 MB free. "large" has 585 bricks of 0.3 to 1.3 MB,
// "small" 4,681 of 2 to 20 kB.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "stream/base/checksum.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_writer.h"
#include "stream/paging/cut.h"
#include "stream/paging/pager.h"

namespace curvisplat {
namespace {

struct BenchCache {
  explicit BenchCache(bool large)
      : path(folder() /
             ("curvisplat-bench-" + std::to_string(::getpid()) + (large ? "-large" : "-small") + ".splats")) {
    CacheWriter writer(path, false, root, {{0, "f", "", 0, 1}});
    std::mt19937_64 random(1);
    append(writer, random, {}, large);
    Manifest manifest;
    manifest.title = "bench";
    manifest.program = "bench";
    manifest.sources = {"none"};
    manifest.reader = "none";
    manifest.lower = root.min;
    manifest.upper = root.min + root.size;
    manifest.blocks = {{"block 1", 1 << 20, 1, 1}};
    manifest.nodes = 1 << 20;
    writer.finish(manifest);
    reader = std::make_unique<CacheReader>(path);
    for (uint32_t brick = 0; brick < reader->bricks().size(); ++brick)
      bytes += reader->bricks()[brick].geometry.length + reader->brickVariables(0)[brick].values.length;
  }
  ~BenchCache() { std::filesystem::remove_all(path); }

  static const BenchCache& of(bool large) {
    static const BenchCache large_cache(true), small_cache(false);
    return large ? large_cache : small_cache;
  }
  static std::filesystem::path folder() {
    const char* named = std::getenv("CURVISPLAT_BENCH_FOLDER");
    return named ? std::filesystem::path(named) : std::filesystem::temp_directory_path();
  }

  /// The leaves in drawing order for a viewer in the direction of an octant.
  std::vector<uint32_t> cut(int octant) const {
    CutView view;
    view.towards_viewer = {octant & 1 ? 1 : -1, octant & 2 ? 1 : -1, octant & 4 ? 1 : -1};
    const auto bounds = subtreeBounds(reader->bricks(), reader->brickVariables(0));
    CutOptions options;
    options.lod_pixels = 0;
    const CutTree tree{root, reader->bricks(), reader->brickVariables(0), bounds};
    const auto all = [](const ValueBounds&) { return false; };
    std::vector<uint32_t> bricks;
    for (const BrickPart& part : chooseCut(tree, view, all, options).parts) bricks.push_back(part.brick);
    return bricks;
  }

  const std::filesystem::path path;
  const RootCube root{glm::dvec3(0), 1};
  std::unique_ptr<CacheReader> reader;
  uint64_t bytes = 0;

 private:
  void append(CacheWriter& writer, std::mt19937_64& random, const Cell& cell, bool large) const {
    const uint32_t levels = large ? 3 : 4;
    if (cell.level < levels)
      for (int octant = 0; octant < 8; ++octant) append(writer, random, cell.child(octant), large);
    EncodedBrick encoded;
    const size_t least = large ? 250'000 : 1'500, span = large ? 750'000 : 12'000;
    encoded.geometry.resize(least + random() % span);
    encoded.values.emplace_back(least / 4 + random() % (span / 3));
    for (auto* stream : {&encoded.geometry, &encoded.values[0]})
      for (size_t at = 0; at + 8 <= stream->size(); at += 8) {
        const uint64_t word = random();
        std::memcpy(stream->data() + at, &word, 8);
      }
    Brick& brick = encoded.brick;
    brick.cell = cell;
    // As many splats as its bytes could hold.
    brick.octant_splats.fill(static_cast<uint32_t>(encoded.geometry.size() / 200 + 1));
    brick.splats = 8 * brick.octant_splats[0];
    brick.lower = brick.upper = root.cellMin(cell) + 0.5 * root.cellSize(cell.level);
    brick.largest_radius = 0.1f;
    brick.geometry = {0, static_cast<uint32_t>(encoded.geometry.size()), checksumOf(encoded.geometry)};
    BrickVariable& variable = encoded.variables.emplace_back();
    variable.values = {0, static_cast<uint32_t>(encoded.values[0].size()), checksumOf(encoded.values[0])};
    writer.append(std::move(encoded), cell.level < levels ? 1.0f / static_cast<float>(cell.level + 1) : 0);
  }
};

void plainReader(benchmark::State& state, bool large) {
  constexpr uint64_t kPiece = 256 << 10;
  constexpr unsigned kDepth = 8;
  const BenchCache& cache = BenchCache::of(large);
  struct Free {
    void operator()(std::byte* bytes) const { std::free(bytes); }
  };
  const std::unique_ptr<std::byte, Free> buffer(
      static_cast<std::byte*>(std::aligned_alloc(kPageBytes, kDepth * kPiece)));
  const DirectFile geometry(cache.reader->geometryPath()), values(cache.reader->valuesPath(0));
  auto reads = makeUringReads(kDepth);
  if (!reads) reads = makeThreadReads(kDepth);
  uint64_t bytes = 0;
  for (auto _ : state) {
    for (const DirectFile* file : {&geometry, &values}) {
      const uint64_t size = std::filesystem::file_size(file->path());
      uint64_t next = 0;
      unsigned under_way = 0;
      const auto submit = [&](uint64_t slot) {
        reads->submit({file->isDirect() ? file->directFd() : file->bufferedFd(), next,
                       buffer.get() + slot * kPiece, kPiece, slot});
        next += kPiece;
        ++under_way;
      };
      for (uint64_t slot = 0; slot < kDepth && next < size; ++slot) submit(slot);
      while (under_way > 0) {
        const auto end = reads->wait();
        if (!end) continue;
        --under_way;
        bytes += static_cast<uint64_t>(std::max<int64_t>(end->result, 0));
        if (next < size) submit(end->tag);
      }
    }
  }
  state.SetBytesProcessed(static_cast<int64_t>(bytes));
}

void pager(benchmark::State& state, bool large, PagerOptions::Way way) {
  const BenchCache& cache = BenchCache::of(large);
  std::vector<uint32_t> order = cache.cut(static_cast<int>(state.range(0)));
  uint64_t bytes = 0;
  for (const uint32_t brick : order)
    bytes +=
        cache.reader->bricks()[brick].geometry.length + cache.reader->brickVariables(0)[brick].values.length;
  PagerOptions options;
  options.buffer_bytes = static_cast<uint64_t>(state.range(1)) << 20;
  options.way = way;
  BrickPager pager(*cache.reader, 0, options);
  for (auto _ : state) {
    pager.start(order);
    for (size_t n = 0; n < order.size(); ++n) {
      const auto brick = pager.fetch(n);
      if (!brick->readable()) state.SkipWithError("a brick cannot be read");
    }
  }
  const PagerStatistics statistics = pager.statistics();
  state.SetBytesProcessed(static_cast<int64_t>(statistics.bytes));
  state.counters["payload"] = static_cast<double>(bytes) * static_cast<double>(state.iterations()) /
                              static_cast<double>(statistics.bytes);
  state.counters["depth"] = statistics.depth_s / statistics.reading_s;
  state.counters["KiB_a_read"] =
      static_cast<double>(statistics.bytes) / 1024 / static_cast<double>(statistics.requests);
  state.SetLabel(pager.way());
}

#define CURVISPLAT_PAGER(name, large)                                                        \
  BENCHMARK_CAPTURE(plainReader, name, large)->UseRealTime()->Unit(benchmark::kMillisecond); \
  BENCHMARK_CAPTURE(pager, name##_uring, large, PagerOptions::Way::kAutomatic)               \
      ->ArgNames({"octant", "buffer_MiB"})                                                   \
      ->ArgsProduct({{0, 7, 2}, {8, 32}})                                                    \
      ->UseRealTime()                                                                        \
      ->Unit(benchmark::kMillisecond);                                                       \
  BENCHMARK_CAPTURE(pager, name##_threads, large, PagerOptions::Way::kThreads)               \
      ->ArgNames({"octant", "buffer_MiB"})                                                   \
      ->Args({2, 32})                                                                        \
      ->UseRealTime()                                                                        \
      ->Unit(benchmark::kMillisecond)
CURVISPLAT_PAGER(large, true);
CURVISPLAT_PAGER(small, false);

}  // namespace
}  // namespace curvisplat
