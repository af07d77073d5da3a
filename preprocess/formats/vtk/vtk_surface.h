// Surfaces of VTK's XML format for polygons, .vtp: polygons and strips as triangles.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <vector>

namespace curvisplat {

struct VtkSurface {
  std::vector<glm::dvec3> points;                  // finite
  std::vector<std::array<uint32_t, 3>> triangles;  // of points that there are
};

/// Polygons become fans. Lines and vertices are left out. Throws Error if the file is no .vtp file, or damaged, or has
/// no polygons.
VtkSurface readVtkSurface(const std::filesystem::path& path);

}  // namespace curvisplat
