// Unstructured grids: OpenFOAM, Gmsh, SU2 and EnSight.
#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "preprocess/formats/ensight/ensight_case.h"
#include "preprocess/formats/ensight/ensight_source.h"
#include "preprocess/formats/gmsh/gmsh_source.h"
#include "preprocess/formats/openfoam/foam_source.h"
#include "preprocess/formats/su2/su2_source.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

constexpr const char* kMeshFiles[] = {"constant/polyMesh/points", "constant/polyMesh/faces",
                                      "constant/polyMesh/owner", "constant/polyMesh/neighbour", "0/p"};

// A case of OpenFOAM: points, faces, owner, neighbour and the field p, each with its length in 16 bits
// before it; what is left over is the field U.
void fuzzOpenfoam(std::span<const std::byte> bytes) {
  for (const char* folder : {"constant/polyMesh", "0"})
    std::filesystem::create_directories(fuzzFolder() / folder);
  FuzzInput input(bytes);
  for (const char* name : kMeshFiles) fuzzFile(name, input.takeBytes(input.take<uint16_t>()));
  fuzzFile("0/U", input.rest());
  OpenGridOptions options;
  options.grid = options.temporary_folder = fuzzFolder();
  readData(openFoam(options));
}

const RegisteredFuzzTarget openfoam_target("openfoam", fuzzOpenfoam);

// A mesh of Gmsh.
void fuzzGmsh(std::span<const std::byte> bytes) {
  OpenGridOptions options;
  options.grid = fuzzFile("a.msh", bytes);
  options.temporary_folder = fuzzFolder();
  if (isGmsh(InputFile(options.grid))) readData(openGmsh(options));
}

const RegisteredFuzzTarget gmsh_target("gmsh", fuzzGmsh);

// A mesh of SU2, with its length in 16 bits before it; what is left over is a restart file.
void fuzzSu2(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  OpenGridOptions options;
  options.grid = fuzzFile("a.su2", input.takeBytes(input.take<uint16_t>()));
  options.temporary_folder = fuzzFolder();
  if (!isSu2(InputFile(options.grid))) return;
  const auto restart = input.rest();
  if (!restart.empty()) options.solutions.push_back(fuzzFile("restart", restart));
  readData(openSu2(options));
}

const RegisteredFuzzTarget su2_target("su2", fuzzSu2);

// A case of EnSight Gold: a byte that chooses the kind of its variable, its geometry, with its length in 16 bits before it,
// and the variable's file.
void fuzzEnsight(std::span<const std::byte> bytes) {
  constexpr std::string_view kKinds[] = {"scalar per node", "scalar per element", "vector per node"};
  FuzzInput input(bytes);
  const std::string_view kind = kKinds[input.take<uint8_t>() % 3];
  fuzzFile("a.geo", input.takeBytes(input.take<uint16_t>()));
  fuzzFile("a.values", input.rest());
  const std::string text =
      "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: a.geo\nVARIABLE\n" + std::string(kind) + ": v a.values\n";
  OpenGridOptions options;
  options.grid = fuzzFile("a.case", std::as_bytes(std::span(text)));
  options.temporary_folder = fuzzFolder();
  readData(openEnsight(options));
}

const RegisteredFuzzTarget ensight_target("ensight", fuzzEnsight);

bool writeMeshFiles() {
  const auto write = [](const char* name, const std::string& text) {
    fuzzFile(name, std::as_bytes(std::span(text)));
  };
  const std::string part = "part\n1\n";
  const std::string points = "0\n1\n0\n0\n0\n0\n1\n0\n0\n0\n0\n1\n";
  const std::string geometry = "a\nb\nnode id off\nelement id off\n" + part +
                               "tetrahedron\ncoordinates\n4\n" + points + "tetra4\n1\n1 2 3 4\n";
  for (const char* name : {"t.geo", "t.geo0", "t.geo1"}) write(name, geometry);
  for (const char* name : {"t.p", "t.p00", "t.p01"}) write(name, "p\n" + part + "coordinates\n1\n2\n3\n4\n");
  write("t.u", "u\n" + part + "coordinates\n" + points);
  write("t.c", "c\n" + part + "tetra4\n5\n");
  return true;
}

// EnSight's case file, beside files that are as they should be: t.geo, t.geo0, t.geo1 (a tetrahedron), t.p,
// t.p00, t.p01 (a value for each node), t.u (a vector for each node) and t.c (a value for the cell).
void fuzzEnsightCase(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool written = writeMeshFiles();
  OpenGridOptions options;
  options.grid = fuzzFile("t.case", bytes);
  options.temporary_folder = fuzzFolder();
  if (!isEnsightCase(InputFile(options.grid))) return;
  auto first = openEnsight(options);
  const auto steps = static_cast<uint32_t>(std::min<size_t>(first->description().times.size(), 4));
  readData(std::move(first));
  for (uint32_t step = 1; step < steps; ++step) {
    options.time_step = step;
    readData(openEnsight(options));
  }
}

const RegisteredFuzzTarget ensight_case_target("ensight_case", fuzzEnsightCase);

}  // namespace
}  // namespace curvisplat
