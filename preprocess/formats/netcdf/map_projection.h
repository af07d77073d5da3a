// Converts the horizontal coordinates of a file to positions in the world. MapProjection converts the
// coordinates of a map projection, or of a rotated pole, to longitude and latitude. Globe converts
// longitude, latitude and height to positions on a sphere, or on a flat map (equirectangular projection).
// World units are kilometres, horizontally and vertically.
//
// Any number of threads may convert; PROJ's calls run one after the other.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

/// The projection that a grid mapping of the CF conventions describes, by PROJ, or a rotated pole.
class MapProjection {
 public:
  /// The projection of a variable's grid_mapping; or nullopt and a reason. Only the numbers of the grid
  /// mapping are used: texts for PROJ (crs_wkt, proj4) could name files.
  /// Source: CF conventions 1.10, appendix F.
  static std::pair<std::optional<MapProjection>, std::string> of(const NetcdfFiles& files,
                                                                 const NetcdfVariable& variable);

  /// "lambert_conformal_conic"
  const std::string& name() const { return name_; }
  /// Whether its coordinates are degrees (a rotated pole) instead of lengths.
  bool degrees() const { return degrees_; }

  /// Converts metres, or the degrees of a rotated pole, to degrees east and north; NaN where the map has no
  /// point. Any number of threads may call it; PROJ's calls run one after the other.
  void toGeographic(std::span<double> x, std::span<double> y) const;

 private:
  struct Proj;
  void unrotate(double& longitude, double& latitude) const;

  std::string name_;
  bool degrees_ = false;
  double pole_longitude_ = 0, pole_latitude_ = 90, grid_longitude_ = 0;  // of a rotated pole
  std::shared_ptr<const Proj> proj_;
};

/// The horizontal part of a position: the unit vector of a longitude and a latitude, or a point of the map.
struct GlobeColumn {
  double x = 0, y = 0, z = 0;  // sphere: of length 1; map: x and y in kilometres, z = 0
};

/// A position in the world, in kilometres.
struct GlobePlace {
  double x = 0, y = 0, z = 0;
};

/// The sphere or the flat map on which a grid in degrees lies; a grid in lengths stays flat.
class Globe {
 public:
  /// `middle_longitude`, in degrees: the map is cut on the opposite side.
  Globe(const GlobeOptions& options, bool degrees, double middle_longitude);

  bool sphere() const { return sphere_; }
  bool degrees() const { return degrees_; }

  /// A column from degrees east and north, or from kilometres if the grid has lengths.
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
