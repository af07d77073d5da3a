// How longitude, latitude and height become positions in the world, and back. Grids in degrees lie on a sphere, or on a flat
// map (equirectangular projection); grids in lengths stay as they are. World units are kilometres. The globe of a cache
// (Manifest::globe) places lines, cameras and coordinates as the grid was placed. Pure; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <cmath>
#include <numbers>

namespace curvisplat {

struct Globe {
  enum class Shape {
    kSphere,
    kFlat,    // of degrees
    kLengths  // no globe: horizontal coordinates are kilometres
  };
  Shape shape = Shape::kSphere;
  double radius_km = 6371;
  double vertical_scale = 1;    // of heights
  double middle_longitude = 0;  // degrees: the flat map is cut on the opposite side

  bool sphere() const { return shape == Shape::kSphere; }
  bool degrees() const { return shape != Shape::kLengths; }

  /// The horizontal part of a place, given in degrees east and north, or in kilometres: of length 1 on the sphere; of a map x and
  /// y in kilometres, and 0.
  glm::dvec3 column(double longitude, double latitude) const {
    if (!degrees()) return {longitude, latitude, 0};
    if (sphere()) {
      const double east = longitude * kRadians, north = latitude * kRadians;
      return {std::cos(north) * std::cos(east), std::cos(north) * std::sin(east), std::sin(north)};
    }
    // Longitudes relative to the middle of the grid are within ±180 degrees, so that a grid across the date
    // line stays in one piece.
    const double from_middle = std::remainder(longitude - middle_longitude, 360.0);
    return {radius_km * kRadians * (middle_longitude + from_middle), radius_km * kRadians * latitude, 0};
  }

  /// The position at a height above the column's.
  glm::dvec3 place(const glm::dvec3& column, double height_km) const {
    const double height = height_km * vertical_scale;
    if (!sphere()) return {column.x, column.y, height};
    const double radius = radius_km + height;
    return {radius * column.x, radius * column.y, radius * column.z};
  }
  glm::dvec3 placeAt(const glm::dvec3& geographic) const {
    return place(column(geographic.x, geographic.y), geographic.z);
  }

  /// Degrees east and north, or kilometres, and the height in kilometres of a position.
  glm::dvec3 geographic(const glm::dvec3& at) const {
    if (!degrees()) return {at.x, at.y, at.z / vertical_scale};
    if (!sphere())
      return {at.x / (radius_km * kRadians), at.y / (radius_km * kRadians), at.z / vertical_scale};
    const double across = std::hypot(at.x, at.y);
    return {std::atan2(at.y, at.x) / kRadians, std::atan2(at.z, across) / kRadians,
            (std::hypot(across, at.z) - radius_km) / vertical_scale};
  }

  bool operator==(const Globe&) const = default;

 private:
  static constexpr double kRadians = std::numbers::pi / 180;  // of a degree
};

}  // namespace curvisplat
