// Converts the horizontal coordinates of a file to longitude and latitude: MapProjection those of a map projection, or of a
// rotated pole. Globe (stream/model/globe.h) places them in the world.
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
#include "stream/model/globe.h"

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

/// The sphere or the flat map on which a grid in degrees lies; a grid in lengths stays flat. `middle_longitude`: of a flat
/// map, in degrees.
Globe globeWith(const GlobeOptions& options, bool degrees, double middle_longitude);

/// A line for users if cells on the sphere bend by more than their layers are thick; else empty. `sagitta_km`: how far the
/// middle of a flat cell lies below the sphere at most. `thickness_km`: of the thinnest layer, as it is drawn.
std::string warningOfSagitta(double sagitta_km, double thickness_km);

}  // namespace curvisplat
