#include "preprocess/formats/netcdf/globe.h"

#include <cmath>
#include <numbers>

namespace curvisplat {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180;

}  // namespace

Globe::Globe(const GlobeOptions& options, bool degrees, double middle_longitude)
    : sphere_(degrees && options.shape != GlobeOptions::Shape::kFlat),
      degrees_(degrees),
      radius_km_(options.radius_km),
      vertical_scale_(options.vertical_scale),
      middle_longitude_(std::isfinite(middle_longitude) ? middle_longitude : 0) {}

GlobeColumn Globe::column(double longitude, double latitude) const {
  if (!degrees_) return {longitude, latitude, 0};
  if (sphere_) {
    const double east = longitude * kRadiansPerDegree, north = latitude * kRadiansPerDegree;
    return {std::cos(north) * std::cos(east), std::cos(north) * std::sin(east), std::sin(north)};
  }
  // Longitudes relative to the middle of the grid are within ±180 degrees, so that a grid across the date
  // line stays in one piece.
  const double from_middle = std::remainder(longitude - middle_longitude_, 360.0);
  return {radius_km_ * kRadiansPerDegree * (middle_longitude_ + from_middle),
          radius_km_ * kRadiansPerDegree * latitude, 0};
}

}  // namespace curvisplat
