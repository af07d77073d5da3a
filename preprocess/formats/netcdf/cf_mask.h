// The variable that tells which nodes of a grid are water, or hold values at all: land masks and flag
// variables by the names and attributes that models give them.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

class CfMask {
 public:
  /// The mask of the nodes of `block`; nullopt if the files have none. `levels`: the axis of its levels.
  /// `ocean`: the nodes lie below the surface, where land has no values; above it, it does not count.
  ///
  ///   mask_rho, mask_u, ..., tmask, umask, ..., maskC, maskW, ..., wet, sea_binary_mask   0 is land
  ///   hFacC, hFacW, hFacS      the part of the cell that is water; 0 is land
  ///   KMT, KMU                 the number of levels that are water
  ///   land_binary_mask         other than 0 is land
  ///   flag_values, flag_meanings    a meaning of land, hole, blanked, solid, masked, outside, missing
  ///
  /// Its dimensions are the block's, or have their lengths. A mask of a single level counts at all of them.
  static std::optional<CfMask> of(const NetcdfFiles& files, const NetcdfVariable& variable,
                                  const CfDimensions& block, size_t levels, bool ocean);

  /// Whether `variable` is a mask by its name or attributes: it is seldom the scalar of interest.
  static bool isMask(const NetcdfVariable& variable);

  /// "mask_rho is 0", for messages.
  const std::string& description() const { return description_; }

  /// Of a grid of several faces: whose nodes are masked.
  void setFace(uint64_t face) { term_.setFace(face); }

  /// Sets the marks of nodes that the mask hides to 1. `blank`: the nodes of `range`, i fastest.
  void apply(const NetcdfFiles& files, const CfRange& range, std::span<uint8_t> blank) const;

 private:
  enum class Rule { kZero, kNotZero, kLevels, kFlags };

  static std::optional<Rule> ruleOf(const NetcdfVariable& variable, bool ocean);
  bool hides(double value, uint64_t level) const;

  CfTerm term_;
  Rule rule_ = Rule::kZero;
  std::vector<double> hidden_;  // kFlags
  size_t levels_ = 2;
  std::string description_;
};

}  // namespace curvisplat
