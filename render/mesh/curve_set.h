// Lines and points to be drawn as tubes and spheres, with perhaps a scalar and a time at each point; and how to read them
// from text with columns, GeoJSON and shapefiles.
//
// Files come from anyone: the memory taken is at most about 20 times the file's size
// (alongSphere(): about as much again, and 24 MiB). Any thread may call the functions.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stream/model/globe.h"

namespace curvisplat {

/// Lines and points, one line after the other.
struct CurveSet {
  glm::dvec3 origin{0.0};            // of the positions, in the data's coordinates
  std::vector<glm::vec3> positions;  // from the origin; of one line after the other
  std::vector<uint32_t> begins{0};   // [lines + 1], into positions; a line of one point is a sphere
  std::vector<float> values;         // [positions], or none; NaN: no value
  std::vector<double> times = {};    // [positions], or none; they do not decrease along a line
  bool on_sphere = false;            // it was given in degrees on a sphere around 0,0,0: see alongSphere()

  size_t lines() const { return begins.size() - 1; }
  uint64_t bytes() const;
  /// The range of the values; {0, 0} without any.
  std::pair<float, float> range() const;
};

/// Lines as a file has them: `points`, finite, of one line after the other.
CurveSet curveSetOf(const std::vector<glm::dvec3>& points, std::vector<uint32_t> begins,
                    std::vector<float> values, std::vector<double> times = {});

// Degrees beyond these are no places, but fill values.
inline constexpr double kMaxLongitude = 1080, kMaxLatitude = 91, kMaxMetres = 1e12;

/// Throws Error that says how to give a globe to the lines of this file if there is none.
void requireGlobe(const std::optional<Globe>& globe, const std::filesystem::path& path);

/// The lines with each point as a line of one.
CurveSet pointsOf(CurveSet set);
/// The lines of a set that is on_sphere with places between those of long segments, on the great circle, with heights, values and
/// times that change evenly. Segments then run below the sphere by at most 1/50,000 of its radius (127 m on the Earth), or
/// by more where that bound would add more than four places for each one of the set and a million besides.
CurveSet alongSphere(const CurveSet& set);
/// The parts of lines with times in [from, to], ended by the places at these times.
CurveSet partBetween(const CurveSet& set, double from, double to);
/// The place of each line at a time, as a point; of those that have one.
CurveSet placesAt(const CurveSet& set, double time);

/// Text with columns, separated by commas, semicolons or spaces: x, y, z and scalars, which a first line names (x,y,z,speed,id), or
/// without one only x, y and z. In place of these lon, lat, and perhaps depth or height in metres, are placed on `globe`. A
/// line ends where the column id (or line, or trajectory) changes, or at an empty line of the file; a column time has its
/// times. `scalar`: the column whose values are taken; empty: none. Throws Error: the file and its line, what was found,
/// what is expected.
CurveSet parseCurveText(std::string_view text, const std::filesystem::path& path, const std::string& scalar,
                        const std::optional<Globe>& globe = std::nullopt);

/// Longitudes and latitudes, in degrees.
struct GeographicBox {
  glm::dvec2 lower{-kMaxLongitude, -kMaxLatitude}, upper{kMaxLongitude, kMaxLatitude};
};

/// Lines of maps, such as coasts: lines, edges of polygons and points of GeoJSON (RFC 7946), or of a shapefile of degrees.
/// They are placed on `globe` where they lie in `box`. Throws Error that names the file, and what is wrong.
CurveSet parseGeoJson(std::string_view text, const std::filesystem::path& path, const Globe& globe,
                      const GeographicBox& box);
CurveSet parseShapefile(std::string_view bytes, const std::filesystem::path& path, const Globe& globe,
                        const GeographicBox& box);

}  // namespace curvisplat
