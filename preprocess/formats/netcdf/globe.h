// Converts longitude, latitude and height to world positions: on a sphere, or on a flat map (equirectangular
// projection). World units are kilometres, horizontally and vertically.
#pragma once

#include "preprocess/formats/common/open_grid_options.h"

namespace curvisplat {

/// The horizontal part of a position: the unit vector of a longitude and a latitude, or a point of the map.
struct GlobeColumn {
  double x = 0, y = 0, z = 0;  // sphere: of length 1; map: x and y in kilometres, z = 0
};

struct GlobePlace {
  double x = 0, y = 0, z = 0;
};

class Globe {
 public:
  /// `middle_longitude`, in degrees: the map is cut on the opposite side.
  Globe(const GlobeOptions& options, bool degrees, double middle_longitude);

  bool sphere() const { return sphere_; }
  bool degrees() const { return degrees_; }

  /// From degrees east and north, or from kilometres if the grid has lengths.
  GlobeColumn column(double longitude, double latitude) const;

  GlobePlace place(const GlobeColumn& column, double height_km) const {
    const double height = height_km * vertical_scale_;
    if (!sphere_) return {column.x, column.y, height};
    const double radius = radius_km_ + height;
    return {radius * column.x, radius * column.y, radius * column.z};
  }

 private:
  bool sphere_, degrees_;
  double radius_km_, vertical_scale_, middle_longitude_;
};

}  // namespace curvisplat
