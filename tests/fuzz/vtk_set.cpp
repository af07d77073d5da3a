// Files that name others (.pvts, .vtm, .pvd), beside pieces that are as they should be: ghosts_<n>.vts,
// step<n>.vts, and the input itself, a.pvts.
#include "tests/fuzz/vtk_input.h"

namespace curvisplat {
namespace {

bool copyPieces() {
  const std::filesystem::path from = std::filesystem::path(CURVISPLAT_TEST_DATA) / "vtk";
  for (const char* name :
       {"ghosts_0.vts", "ghosts_1.vts", "ghosts_0.vti", "ghosts_1.vti", "step0.vts", "step1.vts"})
    std::filesystem::copy_file(from / name, fuzzFolder() / name);
  return true;
}

void fuzzVtkSet(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool copied = copyPieces();
  readVtk("a.pvts", bytes);
}

const RegisteredFuzzTarget vtk_set_target("vtk_set", fuzzVtkSet);

}  // namespace
}  // namespace curvisplat
