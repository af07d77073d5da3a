// .p3d files, beside a grid and two solutions that are as they should be: a.xyz, a.q, a.f.
#include "preprocess/plot3d_meta.h"

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

/// Single precision without record markers: `head`, then so many values.
void writeFile(const char* name, const std::vector<int32_t>& head, size_t values) {
  std::vector<std::byte> bytes;
  const auto put = [&](auto value) {
    const auto added = std::as_bytes(std::span(&value, 1));
    bytes.insert(bytes.end(), added.begin(), added.end());
  };
  for (const int32_t number : head) put(number);
  for (size_t n = 0; n < values; ++n) put(1 + static_cast<float>(n));
  fuzzFile(name, bytes);
}

bool writeFiles() {
  constexpr size_t kNodes = 4 * 3 * 2;
  writeFile("a.xyz", {4, 3, 2}, 3 * kNodes);
  writeFile("a.q", {4, 3, 2}, 4 + 5 * kNodes);
  writeFile("a.f", {4, 3, 2, 2}, 2 * kNodes);
  return true;
}

void run(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool written = writeFiles();
  OpenGridOptions options;
  options.grid = fuzzFile("a.p3d", bytes);
  options.temporary_folder = fuzzFolder();
  if (!isPlot3dMeta(InputFile(options.grid))) return;
  readGrid(*openPlot3dMeta(options));
}

const RegisteredFuzzTarget registered("plot3d_meta", run);

}  // namespace
}  // namespace curvisplat
