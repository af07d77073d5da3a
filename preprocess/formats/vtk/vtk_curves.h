// Lines and points of VTK files, to be drawn in a volume: polygonal data (.vtp, legacy .vtk) and unstructured grids
// (.vtu, legacy .vtk), whose other cells are left out.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace curvisplat {

struct VtkCurves {
  std::vector<glm::dvec3> points;   // of one line after the other; 1e38 at most
  std::vector<uint32_t> begins{0};  // [lines + 1], into points
  std::vector<float> values;        // [points], or none
};

/// Whether the file's extension is one of these formats'.
bool isVtkCurveFile(const std::filesystem::path& path);

/// Polylines, or with `as_points` every point as a line of one. `scalar`: an array of the points or the cells, NAME, NAME:x,
/// NAME:mag, ... as convert has them; empty: none. Throws Error if the file is damaged, has none of them, or no such array.
VtkCurves readVtkCurves(const std::filesystem::path& path, const std::string& scalar, bool as_points);

}  // namespace curvisplat
