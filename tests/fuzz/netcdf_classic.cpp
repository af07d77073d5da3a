// The header of classic NetCDF files, by which we tell whether one is whole. The rest is libnetcdf's.
#include "preprocess/formats/netcdf/netcdf_classic.h"

#include "preprocess/formats/netcdf/netcdf_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void fuzzNetcdfClassic(std::span<const std::byte> bytes) {
  if (!textOf(bytes).starts_with("CDF")) return;
  const InputFile file(fuzzFile("a.nc", bytes));
  if (NetcdfFile::recognises(file)) checkClassicNetcdf(file);
}

const RegisteredFuzzTarget netcdf_classic_target("netcdf_classic", fuzzNetcdfClassic);

}  // namespace
}  // namespace curvisplat
