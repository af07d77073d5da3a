// How high the nodes of a block are: by a depth or height of levels or of nodes, by a geopotential, or by the
// formula of a terrain-following coordinate. Whatever it is in the file, here it is kilometres, upwards.
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
  /// The vertical coordinate of `variable`, whose block has its levels along `axis`; else a reason, in words.
  ///
  /// The first there is of: a formula of the coordinate along the axis (ocean_sigma_coordinate,
  /// ocean_s_coordinate and its generic forms 1 and 2), a height of every node, WRF's geopotential (PH and
  /// PHB), a height of every level.
  static std::pair<std::optional<CfVertical>, std::string> of(const NetcdfFile& file,
                                                              const NetcdfVariable& variable,
                                                              const CfDimensions& block, size_t axis);

  /// One value along the axes that it does not vary along.
  CfValues heights(const NetcdfFile& file, const CfRange& range) const;

  /// Where there is a height of every node, in the nodes' order: reads it to the beginning of `to`, in
  /// kilometres upwards, and returns true. Takes no memory.
  bool readNodes(const NetcdfFile& file, const CfRange& range, std::span<double> to) const;

  const std::string& words() const { return words_; }  // "depth", "ocean_s_coordinate_g2 of s_rho"
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
  double scale_ = 1;                           // kilometres upwards of what is stored
  std::vector<CfTerm> terms_;                  // levels: itself; geopotential: base and perturbation
  std::optional<CfTerm> s_, c_, eta_, depth_;  // of a formula
  double depth_c_ = 0, a_ = 0, b_ = 0;
  std::string words_;
  std::vector<std::string> warnings_;
};

}  // namespace curvisplat
