// From the coordinates of a map projection, or of a rotated pole, to longitude and latitude.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

class MapProjection {
 public:
  /// The projection that a variable's grid_mapping describes; or nullopt and a reason. Only the numbers of the
  /// grid mapping are used: texts for PROJ (crs_wkt, proj4) could name files.
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

}  // namespace curvisplat
