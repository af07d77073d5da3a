// Longitude, latitude and height as places in the world: on a sphere, or on a flat map. World units are
// kilometres, so that the horizontal and the vertical are of one measure.
#pragma once

#include "preprocess/formats/common/open_grid_options.h"

namespace curvisplat {

/// Of one direction of the horizontal: the unit vector of a longitude and a latitude, or a place on the map.
struct GlobeColumn {
  double x = 0, y = 0, z = 0;  // on the sphere, of length 1; on the map, in kilometres, and 0
};

struct GlobePlace {
  double x = 0, y = 0, z = 0;
};

class Globe {
 public:
  /// `middle_longitude`: the map is cut opposite of it, in degrees.
  Globe(const GlobeOptions& options, bool degrees, double middle_longitude);

  bool sphere() const { return sphere_; }

  /// Of degrees east and north; of kilometres, if the grid is one of lengths.
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
