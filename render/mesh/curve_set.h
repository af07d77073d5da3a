// Lines and points to be drawn as tubes and spheres, with perhaps a scalar at each point; and how to read them from
// text with columns.
//
// Files come from anyone: the memory taken is at most about 20 times the file's size. Any thread may call the functions.
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace curvisplat {

/// Lines and points, one line after the other.
struct CurveSet {
  glm::dvec3 origin{0.0};            // of the positions, in the data's coordinates
  std::vector<glm::vec3> positions;  // from the origin; of one line after the other
  std::vector<uint32_t> begins{0};   // [lines + 1], into positions; a line of one point is a sphere
  std::vector<float> values;         // [positions], or none; NaN: no value

  size_t lines() const { return begins.size() - 1; }
  /// The range of the values; {0, 0} without any.
  std::pair<float, float> range() const;
};

/// Lines as a file has them: `points`, finite, of one line after the other.
CurveSet curveSetOf(const std::vector<glm::dvec3>& points, std::vector<uint32_t> begins,
                    std::vector<float> values);

/// Text with columns, separated by commas, semicolons or spaces: x, y, z and scalars, which a first line names (x,y,z,speed,id), or
/// without one only x, y and z. A line ends where the column id (or line, or trajectory) changes, or at an empty line of the
/// file. `scalar`: the column whose values are taken; empty: none. `as_points`: each point is a line of one. Throws Error:
/// the file and its line, what was found, what is expected.
CurveSet parseCurveText(std::string_view text, const std::filesystem::path& path, const std::string& scalar,
                        bool as_points);

}  // namespace curvisplat
