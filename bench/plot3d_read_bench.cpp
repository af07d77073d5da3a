// Reads PLOT3D files from the page cache into NodeArrays, on one thread: slabs of whole planes, coordinates
// and one scalar, including the check for blanked samples. Bytes are those of the file, items are values.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <bit>
#include <filesystem>
#include <string>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/node_reader.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

constexpr int32_t kNi = 200, kNj = 200, kNk = 200;
constexpr uint64_t kGridNodes = uint64_t{kNi} * kNj * kNk;

template <typename Stored>
Stored stored(Stored value, bool swap) {
  return loadStored<Stored>(reinterpret_cast<const std::byte*>(&value), swap);
}

/// Writes a C file: dimensions, then `arrays` arrays that each hold a ramp.
template <typename Value>
void writeFile(const std::filesystem::path& path, std::vector<int32_t> header, int arrays, bool swap) {
  OutputFile file(path);
  for (int32_t& number : header) number = stored(number, swap);
  file.append(std::span<const int32_t>(header));
  std::vector<Value> values(kGridNodes);
  for (uint64_t n = 0; n < kGridNodes; ++n)
    values[n] = stored(static_cast<Value>(n) / Value{kGridNodes}, swap);
  for (int array = 0; array < arrays; ++array) file.append(std::span<const Value>(values));
  file.close();
}

template <typename Value>
void readNodes(benchmark::State& state, bool swap) {
  const auto folder = std::filesystem::temp_directory_path();
  const std::string name = "curvisplat-bench-" + std::to_string(::getpid());
  OpenGridOptions options;
  options.grid = folder / (name + ".xyz");
  options.solutions = {folder / (name + ".fun")};
  writeFile<Value>(options.grid, {kNi, kNj, kNk}, 3, swap);
  writeFile<Value>(options.solutions[0], {kNi, kNj, kNk, 1}, 1, swap);
  {
    const auto source = openGrid(options);
    const NodeReader reader(*source, {0}, std::nullopt);
    NodeArrays nodes;
    for (auto _ : state)
      for (uint64_t k = 0; k < kNk; k += 4) {
        reader.read(0, {0, kNj, k, k + 4}, nodes);
        benchmark::DoNotOptimize(nodes.x.data());
      }
  }
  const auto values = static_cast<int64_t>(4 * kGridNodes * state.iterations());
  state.SetItemsProcessed(values);
  state.SetBytesProcessed(values * static_cast<int64_t>(sizeof(Value)));
  std::filesystem::remove(options.grid);
  std::filesystem::remove(options.solutions[0]);
}

void readSingleNative(benchmark::State& state) {
  readNodes<float>(state, false);
}
void readSingleSwapped(benchmark::State& state) {
  readNodes<float>(state, true);
}
void readDoubleNative(benchmark::State& state) {
  readNodes<double>(state, false);
}
void readDoubleSwapped(benchmark::State& state) {
  readNodes<double>(state, true);
}
BENCHMARK(readSingleNative)->Unit(benchmark::kMillisecond);
BENCHMARK(readSingleSwapped)->Unit(benchmark::kMillisecond);
BENCHMARK(readDoubleNative)->Unit(benchmark::kMillisecond);
BENCHMARK(readDoubleSwapped)->Unit(benchmark::kMillisecond);

/// Parses numbers of 18 characters into doubles in a temporary file, including its fsync.
void spoolText(benchmark::State& state) {
  const auto folder = std::filesystem::temp_directory_path();
  const auto path = folder / ("curvisplat-bench-" + std::to_string(::getpid()) + ".txt");
  std::string text;
  for (int n = 0; n < 2'000'000; ++n) text += std::to_string(n * 1.0e-7 + 100.0) + "1234567\n";
  OutputFile(path).append(std::span<const char>(text));
  for (auto _ : state) benchmark::DoNotOptimize(spoolAscii(InputFile(path), folder).count);
  state.SetItemsProcessed(2'000'000 * static_cast<int64_t>(state.iterations()));
  state.SetBytesProcessed(static_cast<int64_t>(text.size()) * static_cast<int64_t>(state.iterations()));
  std::filesystem::remove(path);
}
BENCHMARK(spoolText)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace curvisplat
