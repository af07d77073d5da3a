// .p3d files, beside a grid and two solutions that are as they should be: a.xyz, a.q, a.f.
#include "preprocess/formats/plot3d/plot3d_meta.h"

#include <bit>
#include <span>
#include <vector>

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

/// Single precision without record markers: `head`, then `values` values.
void writeFile(const char* name, const std::vector<int32_t>& head, size_t values) {
  std::vector<float> words(head.size() + values);
  for (size_t n = 0; n < words.size(); ++n)
    words[n] = n < head.size() ? std::bit_cast<float>(head[n]) : static_cast<float>(n);
  fuzzFile(name, std::as_bytes(std::span(words)));
}

bool writeFiles() {
  constexpr size_t kNodes = 4 * 3 * 2;
  writeFile("a.xyz", {4, 3, 2}, 3 * kNodes);
  writeFile("a.q", {4, 3, 2}, 4 + 5 * kNodes);
  writeFile("a.f", {4, 3, 2, 2}, 2 * kNodes);
  return true;
}

void fuzzPlot3dMeta(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool written = writeFiles();
  OpenGridOptions options;
  options.grid = fuzzFile("a.p3d", bytes);
  options.temporary_folder = fuzzFolder();
  if (!isPlot3dMeta(InputFile(options.grid))) return;
  readGrid(*openPlot3dMeta(options));
}

const RegisteredFuzzTarget plot3d_meta_target("plot3d_meta", fuzzPlot3dMeta);

}  // namespace
}  // namespace curvisplat
