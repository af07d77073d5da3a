// Grids compressed as a whole by gzip, xz or zstd: the grid inside is legacy VTK. The libraries decompress; ours are the loops
// around them, and the names in what the reader says. A byte of zstd may stand for 32 KiB, so that inputs are short.
#include "preprocess/formats/common/unpacked_file.h"

#include "preprocess/formats/open/unpacked_source.h"
#include "preprocess/formats/vtk/vtk_legacy.h"
#include "stream/base/check.h"
#include "stream/base/error.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

std::unique_ptr<DataSource> openInside(const OpenGridOptions& options) {
  const InputFile file(options.grid);
  if (!isVtkLegacy(file)) throw Error("{}: is another file", options.grid.string());
  return openVtkLegacy(options);
}

void fuzzUnpackedFile(std::span<const std::byte> bytes) {
  constexpr size_t kMaxBytes = 2048;
  if (bytes.size() > kMaxBytes) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.vtk.gz", bytes);
  options.temporary_folder = fuzzFolder();
  if (!UnpackedFile::recognises(InputFile(options.grid))) return;
  try {
    readData(*openUnpacked(options, openInside));
  } catch (const Error& error) {
    CURVISPLAT_CHECK(std::string(error.what()).find(".unpacked/") == std::string::npos);
    throw;
  }
}

const RegisteredFuzzTarget unpacked_file_target("unpacked_file", fuzzUnpackedFile);

}  // namespace
}  // namespace curvisplat
