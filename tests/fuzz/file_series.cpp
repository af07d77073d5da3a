// ParaView's lists of time steps (.vts.series), beside files that are as they should be: step0.vts, step1.vts.
#include "preprocess/formats/open/file_series.h"

#include "preprocess/formats/open/open_grid.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

bool copySteps() {
  for (const char* name : {"step0.vts", "step1.vts"})
    std::filesystem::copy_file(std::filesystem::path(CURVISPLAT_TEST_DATA) / "vtk" / name,
                               fuzzFolder() / name);
  return true;
}

void fuzzFileSeries(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool copied = copySteps();
  OpenGridOptions options;
  options.grid = fuzzFile("a.vts.series", bytes);
  options.temporary_folder = fuzzFolder();
  const auto first = openFileSeries(options, openData);
  const size_t times = first->description().times.size();
  for (uint32_t step = 0; step < std::min<size_t>(times, 4); ++step) {
    options.time_step = step;
    readData(*openFileSeries(options, openData));
  }
}

const RegisteredFuzzTarget file_series_target("file_series", fuzzFileSeries);

}  // namespace
}  // namespace curvisplat
