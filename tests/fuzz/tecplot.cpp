// A Tecplot file of ordered zones, binary if it begins as one, else text.
#include "preprocess/formats/tecplot/tecplot_source.h"

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

void fuzzTecplot(std::span<const std::byte> bytes) {
  OpenGridOptions options;
  options.grid = fuzzFile("a.plt", bytes);
  options.temporary_folder = fuzzFolder();
  if (isTecplot(InputFile(options.grid))) readGrid(TecplotSource(options));
}

const RegisteredFuzzTarget tecplot_target("tecplot", fuzzTecplot);

}  // namespace
}  // namespace curvisplat
