// A case of EnSight Gold: a byte that chooses the kind of its variable, its geometry, with its length in 16 bits before it,
// and the variable's file.
#include "preprocess/formats/ensight/ensight_source.h"

#include <string_view>

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

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
  const auto source = openEnsight(options);
  readData(*source);
  const auto* const mesh = dynamic_cast<const MeshSource*>(source.get());
  if (!mesh) return;
  const uint32_t scalar = 0;
  const MeshPiece& piece = mesh->description().pieces[0];
  MeshPoints points;
  MeshCells cells;
  if (mesh->description().scalars[0].centring == Centring::kNode)
    mesh->readPoints(0, 0, std::min<uint64_t>(piece.points, 4096), std::span(&scalar, 1), points);
  else
    mesh->readCells(0, 0, std::min<uint64_t>(piece.cells, 4096), std::span(&scalar, 1), cells);
}

const RegisteredFuzzTarget ensight_target("ensight", fuzzEnsight);

}  // namespace
}  // namespace curvisplat
