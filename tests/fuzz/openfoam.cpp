// A case of OpenFOAM: points, faces, owner, neighbour and the field p, each with its length in 16 bits before it; what is
// left over is the field U.
#include "preprocess/formats/openfoam/foam_source.h"

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

constexpr const char* kMeshFiles[] = {"constant/polyMesh/points", "constant/polyMesh/faces",
                                      "constant/polyMesh/owner", "constant/polyMesh/neighbour", "0/p"};

void fuzzOpenfoam(std::span<const std::byte> bytes) {
  for (const char* folder : {"constant/polyMesh", "0"})
    std::filesystem::create_directories(fuzzFolder() / folder);
  FuzzInput input(bytes);
  for (const char* name : kMeshFiles) fuzzFile(name, input.takeBytes(input.take<uint16_t>()));
  fuzzFile("0/U", input.rest());
  OpenGridOptions options;
  options.grid = options.temporary_folder = fuzzFolder();
  readMesh(FoamSource(options));
}

const RegisteredFuzzTarget openfoam_target("openfoam", fuzzOpenfoam);

}  // namespace
}  // namespace curvisplat
