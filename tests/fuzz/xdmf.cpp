// An XDMF file with arrays in its XML, or in a binary file a.bin that is as it should be. HDF5 files are hdf5_attributes'.
#include "preprocess/formats/xdmf/xdmf_source.h"

#include <numeric>
#include <vector>

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

bool writeNumbers() {
  std::vector<float> numbers(1000);
  std::iota(numbers.begin(), numbers.end(), 0.0f);
  fuzzFile("a.bin", std::as_bytes(std::span(numbers)));
  return true;
}

void fuzzXdmf(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool written = writeNumbers();
  // HDF5's own damage is tried in a process of its own, which takes milliseconds.
  if (textOf(bytes).find(".h5") != std::string_view::npos) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.xmf", bytes);
  options.temporary_folder = fuzzFolder();
  if (isXdmf(InputFile(options.grid))) readGrid(XdmfSource(options));
}

const RegisteredFuzzTarget xdmf_target("xdmf", fuzzXdmf);

}  // namespace
}  // namespace curvisplat
