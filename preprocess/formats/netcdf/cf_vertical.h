// The heights of a block's nodes: from the depth or height of levels or of nodes, from a geopotential, from
// pressures, from the thickness of layers, or from the formula of a terrain-following coordinate. Always
// converted to kilometres, positive upwards.
//
//   pressure                  the height of that pressure in the standard atmosphere (cf_coordinates.h)
//   pressure of sea water     the depth of that pressure, below zero
//   formulas of a pressure    atmosphere_sigma_, atmosphere_ln_pressure_, atmosphere_hybrid_sigma_pressure_
//                             coordinate: that pressure's height
//   formulas of a height      atmosphere_hybrid_height_, atmosphere_sleve_, ocean_sigma_, ocean_sigma_z_,
//                             ocean_double_sigma_coordinate, ocean_s_coordinate and generic forms 1 and 2
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

class CfVertical {
 public:
  /// The vertical coordinate of `variable`, whose block has its levels along `axis`; or nullopt and a
  /// reason.
  ///
  /// Tried in this order: the geopotential of every node; a formula of a coordinate along the axis, or one whose
  /// terms have the names that models give them. Then, of lengths first and of pressures after that: the
  /// value of every node; WRF's sums of two fields (PH and PHB, or pressures); of lengths alone, the layers'
  /// interfaces; the value of every level. At last the thickness of the layers; heights and pressures of
  /// nodes by name (met_em's GHT); and lengths of levels whose name and attributes do not say that they are heights.
  static std::pair<std::optional<CfVertical>, std::string> of(const NetcdfFiles& file,
                                                              const NetcdfVariable& variable,
                                                              const CfDimensions& given, size_t axis);

  /// The formula of a coordinate along `axis` that has formula_terms; or nullopt and a reason.
  static std::optional<CfVertical> byFormula(const NetcdfFiles& file, const NetcdfVariable& coordinate,
                                             const CfDimensions& block, size_t axis, std::string& reason);

  /// The index along `axis` in kilometres.
  static CfVertical ofIndex(size_t axis);

  /// The heights of the nodes of `range`, in kilometres. Along axes on which the height does not depend they
  /// have a single value. Throws Error if a file cannot be read.
  CfValues heights(const NetcdfFiles& file, const CfRange& range) const;

  /// Reads the heights to the beginning of `to`, without a buffer, and returns true if the file stores one
  /// for every node in the order of the nodes. Else returns false.
  bool readNodes(const NetcdfFiles& file, const CfRange& range, std::span<double> to) const;

  /// Sets the radius of the globe, which is subtracted from levels that are distances from the Earth's
  /// centre.
  void setRadius(double kilometres) {
    if (offset_ != 0) offset_ = -kilometres;
  }

  /// Sets the face whose heights are read, in a grid of several faces.
  void setFace(uint64_t face);

  const std::string& description() const {
    return description_;
  }  // "depth", "ocean_s_coordinate_g2 of s_rho"
  const std::vector<std::string>& warnings() const { return warnings_; }
  void addWarning(std::string text) { warnings_.push_back(std::move(text)); }

  /// Whether the heights are made of this variable.
  bool uses(const NetcdfVariable& variable) const;

  /// Whether the heights are those of pressures in the standard atmosphere.
  bool ofPressure() const { return kind_ >= Kind::kPressure && kind_ <= Kind::kHybridPressure; }

  /// Whether the heights vary along an axis.
  bool varies(size_t axis) const;

  /// Whether name and unit tell that the variable can serve as heights or pressures of the nodes: met_em's GHT and PRES.
  static bool isNamedForNodes(const NetcdfVariable& variable);

 private:
  enum class Kind {
    kLevels,
    kGeopotential,
    kSigma,
    kS,
    kSG1,
    kSG2,
    kSigmaZ,
    kDoubleSigma,
    kHybridHeight,
    kSleve,
    kSeaPressure,
    kPressure,
    kLogPressure,
    kSigmaPressure,
    kHybridPressure,
    kThickness,
  };
  using Candidates = std::vector<const NetcdfVariable*>;
  using Terms = std::map<std::string, std::string>;

  struct Wanted {
    size_t axis;
    bool of_nodes, pressure;
  };

  static std::optional<CfVertical> byCandidates(const NetcdfFiles& file, const Candidates& candidates,
                                                const NetcdfVariable& variable, const CfDimensions& block,
                                                const Wanted& wanted, std::string& reason);
  static std::optional<CfVertical> ofTerms(const NetcdfFiles& file, Kind kind, const Terms& terms,
                                           const CfDimensions& block, size_t axis, std::string& lacking);
  static std::optional<CfVertical> byNamesOfTerms(const NetcdfFiles& file, const CfDimensions& block,
                                                  size_t axis, std::string& lacking);
  static std::optional<CfVertical> byNamesOfFields(const NetcdfFiles& file, const CfDimensions& block,
                                                   size_t axis);
  std::string setPlausible(const NetcdfFiles& file, const NetcdfVariable& coordinate,
                           const NetcdfVariable& variable, size_t axis);
  static std::optional<CfVertical> byNodeGeopotential(const NetcdfFiles& file, const CfDimensions& block);
  static std::optional<CfVertical> bySums(const NetcdfFiles& file, const CfDimensions& block, bool pressure);
  static std::optional<CfVertical> byInterfaces(const NetcdfFiles& file, const CfDimensions& block,
                                                size_t axis);
  static std::optional<CfVertical> byThickness(const NetcdfFiles& file, const CfDimensions& block,
                                               size_t axis);
  static std::optional<CfVertical> byLevels(const NetcdfFiles& file, const NetcdfVariable& coordinate,
                                            const NetcdfVariable& variable, const CfTerm& term, size_t axis,
                                            std::string& reason);
  bool setOceanTerms(const NetcdfFiles& file, const Terms& terms, const CfDimensions& block, size_t axis,
                     const char*& lacking);
  bool setAirTerms(const NetcdfFiles& file, const Terms& terms, const CfDimensions& block, size_t axis,
                   const char*& lacking);
  CfValues thicknessHeights(const NetcdfFiles& file, const CfRange& range) const;
  CfValues formulaHeights(const NetcdfFiles& file, const CfRange& range) const;
  bool setSleveTerms(const NetcdfFiles& file, const Terms& terms, const CfDimensions& block, size_t axis,
                     const char*& lacking);
  bool setDoubleSigmaTerms(const NetcdfFiles& file, const Terms& terms, const CfDimensions& block,
                           const char*& lacking);
  /// The terms of a formula at one node.
  struct AtNode {
    double s, c, eta, depth, c2, depth2;
    uint64_t level;
  };
  double formula(const AtNode& node) const;

  Kind kind_ = Kind::kLevels;
  double scale_ = 1;                           // converts stored values to kilometres upwards
  double offset_ = 0;                          // kLevels: kilometres, added after that
  std::vector<CfTerm> terms_;                  // height: one; geopotential: base and perturbation
  std::optional<CfTerm> s_, c_, eta_, depth_;  // terms of a formula; of the air: a, b, -, surface
  std::optional<CfTerm> c2_, depth2_;          // kSleve: b2 and zsurf2
  double z1_ = 0, z2_ = 0;                     // kDoubleSigma
  double levels_of_sigma_ = 0;                 // kSigmaZ: infinite if not known; kDoubleSigma: k_c
  double depth_c_ = 0, a_ = 0, b_ = 0;         // of the air: a_ the reference or top pressure
  bool log_surface_ = false;                   // depth_ is the logarithm of the surface's pressure
  size_t axis_ = 2;                            // kThickness: of the layers
  uint64_t layers_ = 0;                        // kThickness: their number
  bool from_bottom_ = false;                   // kThickness: the first layer is the lowest
  std::string description_;
  std::vector<std::string> warnings_;
};

}  // namespace curvisplat
