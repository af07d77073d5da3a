// VTK's files: XML in all encodings, legacy ones, those that name others, surfaces and curves.
#include <algorithm>
#include <cmath>

#include "preprocess/formats/vtk/vtk_curves.h"
#include "preprocess/formats/vtk/vtk_legacy.h"
#include "preprocess/formats/vtk/vtk_surface.h"
#include "preprocess/formats/vtk/vtk_xml.h"
#include "stream/base/error.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

void readVtk(std::string_view name, std::span<const std::byte> bytes) {
  OpenGridOptions options;
  options.grid = fuzzFile(name, bytes);
  options.temporary_folder = fuzzFolder();
  if (isVtkXml(InputFile(options.grid)))
    readData(openVtkXml(options));
  else if (isVtkLegacy(InputFile(options.grid)))
    readData(openVtkLegacy(options));
}

// .vts, .vtr and .vti files in all encodings.
const RegisteredFuzzTarget vtk_xml_target("vtk_xml",
                                          [](std::span<const std::byte> bytes) { readVtk("a.vts", bytes); });

// Legacy .vtk files, text and binary.
const RegisteredFuzzTarget vtk_legacy_target("vtk_legacy", [](std::span<const std::byte> bytes) {
  readVtk("a.vtk", bytes);
});

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

// Files that name others (.pvts, .pvtu, .vtm, .pvd, .vth, .vthb), beside pieces that are as they should be:
// ghosts_<n>.vts, ghosts_<n>.vti, step<n>.vts, tetrahedron.vtu, and the input itself, a.pvts.
void fuzzVtkSet(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool copied = copyPieces();
  readVtk("a.pvts", bytes);
}

const RegisteredFuzzTarget vtk_set_target("vtk_set", fuzzVtkSet);

// Surfaces of polygons (.vtp) in all encodings. What is read has finite points, and triangles of points that there are.
void fuzzVtkSurface(std::span<const std::byte> bytes) {
  const VtkSurface surface = readVtkSurface(fuzzFile("a.vtp", bytes));
  for (const glm::dvec3& point : surface.points)
    CURVISPLAT_CHECK(std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z));
  for (const auto& triangle : surface.triangles)
    for (const uint32_t corner : triangle) CURVISPLAT_CHECK_OP(corner, <, surface.points.size());
}

const RegisteredFuzzTarget vtk_surface_target("vtk_surface", fuzzVtkSurface);

// Lines and points of a picture. A byte chooses the file (1: .vtp, 2: .vtu, else .vtk) and, by its fifth bit, points; the scalar is
// p, or none by its sixth. What is read belongs to one line each, and is finite in single precision, differences included.
void fuzzVtkCurves(std::span<const std::byte> bytes) {
  constexpr std::string_view kNames[] = {"a.vtk", "a.vtp", "a.vtu", "a.vtk"};
  FuzzInput input(bytes);
  const auto choice = input.take<uint8_t>();
  const VtkCurves curves = readVtkCurves(fuzzFile(kNames[choice % 4], input.rest()),
                                         (choice & 32) != 0 ? "" : "p", (choice & 16) != 0);
  CURVISPLAT_CHECK_OP(curves.begins.back(), ==, curves.points.size());
  CURVISPLAT_CHECK(std::ranges::is_sorted(curves.begins));
  CURVISPLAT_CHECK(curves.values.empty() || curves.values.size() == curves.points.size());
  for (const glm::dvec3& point : curves.points)
    for (int axis = 0; axis < 3; ++axis)
      CURVISPLAT_CHECK(std::isfinite(static_cast<float>(point[axis] - curves.points.front()[axis])));
}

const RegisteredFuzzTarget vtk_curves_target("vtk_curves", fuzzVtkCurves);

}  // namespace
}  // namespace curvisplat
