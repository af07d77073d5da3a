// Exodus files in classic NetCDF, whose header libnetcdf parses once it has been checked here. NetCDF-4 is HDF5's.
#include "preprocess/formats/exodus/exodus_source.h"

#include "preprocess/formats/netcdf/netcdf_file.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

void fuzzExodus(std::span<const std::byte> bytes) {
  if (!textOf(bytes).starts_with("CDF")) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.exo", bytes);
  options.temporary_folder = fuzzFolder();
  if (isExodus(InputFile(options.grid))) readMesh(ExodusSource(options));
}

const RegisteredFuzzTarget exodus_target("exodus", fuzzExodus);

}  // namespace
}  // namespace curvisplat
