// CGNS files of the ADF kind, which libcgns reads: tests/fuzz/sanitized_libcgns.sh builds that with the sanitizers, too. Files that
// are HDF5 inside are those of tests/end_to_end/hdf5_attributes_test.py.
#include "preprocess/formats/cgns/cgns_source.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

void fuzzCgnsAdf(std::span<const std::byte> bytes) {
  if (bytes.size() < 32 || !textOf(bytes).substr(4).starts_with("ADF Database Version")) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.cgns", bytes);
  options.temporary_folder = fuzzFolder();
  readData(*openCgns(options));
}

const RegisteredFuzzTarget cgns_adf_target("cgns_adf", fuzzCgnsAdf);

}  // namespace
}  // namespace curvisplat
