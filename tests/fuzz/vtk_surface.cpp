// Surfaces of polygons (.vtp) in all encodings. What is read has finite points, and triangles of points that there are.
#include "preprocess/formats/vtk/vtk_surface.h"

#include <cmath>

#include "stream/base/check.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void fuzzVtkSurface(std::span<const std::byte> bytes) {
  const VtkSurface surface = readVtkSurface(fuzzFile("a.vtp", bytes));
  for (const glm::dvec3& point : surface.points)
    CURVISPLAT_CHECK(std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z));
  for (const auto& triangle : surface.triangles)
    for (const uint32_t corner : triangle) CURVISPLAT_CHECK_OP(corner, <, surface.points.size());
}

const RegisteredFuzzTarget vtk_surface_target("vtk_surface", fuzzVtkSurface);

}  // namespace
}  // namespace curvisplat
