// UGRID, ICON and MPAS files in classic NetCDF, whose header libnetcdf parses once it has been checked. NetCDF-4 is HDF5's.
#include "preprocess/formats/columns/columns_source.h"

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

void fuzzColumns(std::span<const std::byte> bytes) {
  if (!textOf(bytes).starts_with("CDF")) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.nc", bytes);
  options.temporary_folder = fuzzFolder();
  if (isColumnsGrid(options)) readMesh(ColumnsSource(options));
}

const RegisteredFuzzTarget columns_target("columns", fuzzColumns);

}  // namespace
}  // namespace curvisplat
