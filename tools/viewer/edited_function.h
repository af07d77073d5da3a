// A transfer function in a person's hands: opacity points that are dragged, colours from a preset or a file,
// a range, a unit.
//
// Points stand on [0, 1], which is stretched over the range, in the logarithm if the scale is logarithmic.
// There is always an opacity point at 0 and one at 1. Values only; not for several threads at once.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "render/colour/transfer_function.h"

namespace curvisplat {

class EditedFunction {
 public:
  /// A built-in preset over [low, high]. Equal ends are moved apart, as TransferFunction::preset() does.
  /// `opacity_unit` > 0, world units. Throws UsageError that lists the names there are.
  EditedFunction(const std::string& preset, double low, double high, double opacity_unit);
  /// As the definition stands: the range is from its lowest to its highest point. A definition without an
  /// opacity unit has `default_opacity_unit`. Throws Error where a logarithm does not exist.
  EditedFunction(const TransferFunctionDefinition& definition, double default_opacity_unit);

  TransferFunction function() const;
  /// The same function as a definition whose points stand at scalars: what a ParaView preset holds.
  TransferFunctionDefinition definition() const;
  /// The preset that gives this function over range() and opacityUnit(), or empty if points were changed.
  const std::string& preset() const { return preset_; }

  std::pair<double, double> range() const { return range_; }
  /// Ends in the wrong order, equal or, for a logarithm, not above zero are not taken: false.
  bool setRange(double low, double high);
  /// The range of a scalar from `low` to `high`: a constant gets an interval around it, and what is not above
  /// zero no logarithm.
  void fitRange(double low, double high);
  bool logScale() const { return definition_.log_scale; }
  /// False where the range is not above zero.
  bool setLogScale(bool log_scale);
  double opacityUnit() const { return opacity_unit_; }
  void setOpacityUnit(double unit);

  const std::vector<OpacityPoint>& points() const { return definition_.opacities; }
  /// Returns the new point's position; on an old point's x it is put beside it.
  size_t addPoint(double x, double opacity);
  /// Between its neighbours; the first and the last stay at 0 and 1. Opacity within 0..1.
  void movePoint(size_t point, double x, double opacity);
  /// The first and the last are never removed.
  void removePoint(size_t point);

  /// The colours of a built-in preset; opacities stay.
  void setColours(const std::string& preset);
  /// 0..1 over the range.
  glm::dvec3 colourAt(double x) const;

 private:
  void edited() { preset_.clear(); }

  TransferFunctionDefinition definition_;  // on [0, 1]
  std::pair<double, double> range_;
  double opacity_unit_ = 1;
  std::string preset_;
};

}  // namespace curvisplat
