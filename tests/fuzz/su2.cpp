// A mesh of SU2, with its length in 16 bits before it; what is left over is a restart file.
#include "preprocess/formats/su2/su2_source.h"

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

void fuzzSu2(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  OpenGridOptions options;
  options.grid = fuzzFile("a.su2", input.takeBytes(input.take<uint16_t>()));
  options.temporary_folder = fuzzFolder();
  if (!isSu2(InputFile(options.grid))) return;
  const auto restart = input.rest();
  if (!restart.empty()) options.solutions.push_back(fuzzFile("restart", restart));
  const Su2Source source(options);
  readMesh(source);
  MeshPoints points;
  for (uint32_t n = 0; n < source.description().scalars.size(); ++n)
    source.readPoints(0, 0, source.description().pieces[0].points, std::span(&n, 1), points);
}

const RegisteredFuzzTarget su2_target("su2", fuzzSu2);

}  // namespace
}  // namespace curvisplat
