// Grid files: Tecplot, XDMF, CGNS, ParaView's lists of time steps, and files that are compressed as a whole.
#include <numeric>
#include <vector>

#include "preprocess/formats/cgns/cgns_source.h"
#include "preprocess/formats/common/unpacked_file.h"
#include "preprocess/formats/open/indirect_files.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/tecplot/tecplot_source.h"
#include "preprocess/formats/vtk/vtk_legacy.h"
#include "preprocess/formats/xdmf/xdmf_file.h"
#include "preprocess/formats/xdmf/xdmf_source.h"
#include "stream/base/error.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

// A Tecplot file of ordered zones, binary if it begins as one, else text.
void fuzzTecplot(std::span<const std::byte> bytes) {
  OpenGridOptions options;
  options.grid = fuzzFile("a.plt", bytes);
  options.temporary_folder = fuzzFolder();
  if (isTecplot(InputFile(options.grid))) readData(openTecplot(options));
}

const RegisteredFuzzTarget tecplot_target("tecplot", fuzzTecplot);

bool writeNumbers() {
  std::vector<float> numbers(1000);
  std::iota(numbers.begin(), numbers.end(), 0.0f);
  fuzzFile("a.bin", std::as_bytes(std::span(numbers)));
  return true;
}

// An XDMF file with arrays in its XML, or in a binary file a.bin that is as it should be. HDF5 files are
// hdf5_attributes'.
void fuzzXdmf(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool written = writeNumbers();
  // HDF5's own damage is tried in a process of its own, which takes milliseconds.
  if (textOf(bytes).find(".h5") != std::string_view::npos) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.xmf", bytes);
  options.temporary_folder = fuzzFolder();
  if (isXdmf(InputFile(options.grid))) readData(openXdmf(options));
}

const RegisteredFuzzTarget xdmf_target("xdmf", fuzzXdmf);

// CGNS files of the ADF kind, which libcgns reads: tests/fuzz/sanitized_libcgns.sh builds that with the sanitizers, too. Files that
// are HDF5 inside are those of tests/end_to_end/hdf5_attributes_test.py.
void fuzzCgnsAdf(std::span<const std::byte> bytes) {
  if (bytes.size() < 32 || !textOf(bytes).substr(4).starts_with("ADF Database Version")) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.cgns", bytes);
  options.temporary_folder = fuzzFolder();
  readData(openCgns(options));
}

const RegisteredFuzzTarget cgns_adf_target("cgns_adf", fuzzCgnsAdf);

bool copySteps() {
  for (const char* name : {"step0.vts", "step1.vts"})
    std::filesystem::copy_file(std::filesystem::path(CURVISPLAT_TEST_DATA) / "vtk" / name,
                               fuzzFolder() / name);
  return true;
}

// ParaView's lists of time steps (.vts.series), beside files that are as they should be: step0.vts,
// step1.vts.
void fuzzFileSeries(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool copied = copySteps();
  OpenGridOptions options;
  options.grid = fuzzFile("a.vts.series", bytes);
  options.temporary_folder = fuzzFolder();
  const auto first = openFileSeries(options, openData);
  const size_t times = first->description().times.size();
  for (uint32_t step = 0; step < std::min<size_t>(times, 4); ++step) {
    options.time_step = step;
    readData(openFileSeries(options, openData));
  }
}

const RegisteredFuzzTarget file_series_target("file_series", fuzzFileSeries);

std::unique_ptr<DataSource> openInside(const OpenGridOptions& options) {
  const InputFile file(options.grid);
  if (!isVtkLegacy(file)) throw Error("{}: is another file", options.grid.string());
  return openVtkLegacy(options);
}

// Grids compressed as a whole by gzip, xz or zstd: the grid inside is legacy VTK. The libraries decompress;
// ours are the loops around them, and the names in what the reader says. A byte of zstd may stand for 32
// KiB, so that inputs are short.
void fuzzUnpackedFile(std::span<const std::byte> bytes) {
  constexpr size_t kMaxBytes = 2048;
  if (bytes.size() > kMaxBytes) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.vtk.gz", bytes);
  options.temporary_folder = fuzzFolder();
  if (!UnpackedFile::recognises(InputFile(options.grid))) return;
  try {
    readData(openUnpacked(options, openInside));
  } catch (const Error& error) {
    CURVISPLAT_CHECK(std::string(error.what()).find(".unpacked/") == std::string::npos);
    throw;
  }
}

const RegisteredFuzzTarget unpacked_file_target("unpacked_file", fuzzUnpackedFile);

}  // namespace
}  // namespace curvisplat
