// Files that name others (.pvts, .pvtu, .vtm, .pvd, .vth, .vthb), beside pieces that are as they should be: ghosts_<n>.vts,
// ghosts_<n>.vti, step<n>.vts, tetrahedron.vtu, and the input itself, a.pvts.
#include "tests/fuzz/vtk_input.h"

namespace curvisplat {
namespace {

constexpr std::string_view kTetrahedron =
    R"(<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="1"><PointData><DataArray type="Float32" Name="p" format="ascii">
1 2 3 4</DataArray></PointData><Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 0 0 1
</DataArray></Points><Cells><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">4</DataArray><DataArray type="UInt8" Name="types" format="ascii">10
</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>)";

bool copyPieces() {
  const std::filesystem::path from = std::filesystem::path(CURVISPLAT_TEST_DATA) / "vtk";
  for (const char* name :
       {"ghosts_0.vts", "ghosts_1.vts", "ghosts_0.vti", "ghosts_1.vti", "step0.vts", "step1.vts"})
    std::filesystem::copy_file(from / name, fuzzFolder() / name);
  fuzzFile("tetrahedron.vtu", std::as_bytes(std::span(kTetrahedron)));
  return true;
}

void fuzzVtkSet(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool copied = copyPieces();
  readVtk("a.pvts", bytes);
}

const RegisteredFuzzTarget vtk_set_target("vtk_set", fuzzVtkSet);

}  // namespace
}  // namespace curvisplat
