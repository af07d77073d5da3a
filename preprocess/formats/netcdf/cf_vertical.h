// The heights of a block's nodes: from the depth or height of levels or of nodes, from a geopotential, or
// from the formula of a terrain-following coordinate. Always converted to kilometres, positive upwards.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/formats/netcdf/netcdf_file.h"

namespace curvisplat {

class CfVertical {
 public:
  /// The vertical coordinate of `variable`, whose block has its levels along `axis`; or nullopt and a reason.
  ///
  /// Tried in this order: a formula of the coordinate along the axis (ocean_sigma_coordinate,
  /// ocean_s_coordinate and its generic forms 1 and 2), the height of every node, WRF's geopotential (PH and
  /// PHB), the height of every level.
  static std::pair<std::optional<CfVertical>, std::string> of(const NetcdfFile& file,
                                                              const NetcdfVariable& variable,
                                                              const CfDimensions& block, size_t axis);

  /// A single value along the axes on which the height does not depend.
  CfValues heights(const NetcdfFile& file, const CfRange& range) const;

  /// If the file stores a height for every node in the order of the nodes: reads them to the beginning of
  /// `to` and returns true, without a buffer. Else returns false.
  bool readNodes(const NetcdfFile& file, const CfRange& range, std::span<double> to) const;

  const std::string& description() const {
    return description_;
  }  // "depth", "ocean_s_coordinate_g2 of s_rho"
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  enum class Kind { kLevels, kGeopotential, kSigma, kS, kSG1, kSG2 };

  static std::optional<CfVertical> byFormula(const NetcdfFile& file, const NetcdfVariable& coordinate,
                                             const CfDimensions& block, size_t axis, std::string& reason);
  static std::optional<CfVertical> byGeopotential(const NetcdfFile& file, const CfDimensions& block);
  static std::optional<CfVertical> byLevels(const NetcdfFile& file, const NetcdfVariable& coordinate,
                                            const CfDimensions& block, size_t axis, std::string& reason);
  double formula(double s, double c, double eta, double depth, double depth_c) const;

  Kind kind_ = Kind::kLevels;
  double scale_ = 1;                           // converts stored values to kilometres upwards
  std::vector<CfTerm> terms_;                  // height: one; geopotential: base and perturbation
  std::optional<CfTerm> s_, c_, eta_, depth_;  // terms of a formula
  double depth_c_ = 0, a_ = 0, b_ = 0;
  std::string description_;
  std::vector<std::string> warnings_;
};

}  // namespace curvisplat
