// Scalar -> (colour, extinction). A preset by name, or a ParaView colour-map file. Design section 9.
//
//   opacity o is per unit distance u, capped at 0.9999: extinction κ = -ln(1 - o) / u
//
// A look-up costs well under a microsecond: a table of 64 k values takes milliseconds in any colour space.
#pragma once

#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "render/colour/colour_map.h"
#include "render/colour/opacity_curve.h"

namespace curvisplat {

/// What a transfer function is made of, before it is stretched: as a preset or a file states it. Points in
/// the order of x, which is the scalar; at least two colour points of different x; two opacity points or
/// none.
struct TransferFunctionDefinition {
  std::string name;
  std::string origin;  // where it comes from, for messages: "preset 'grey'", "a.json: preset 'X Ray'"
  ColourSpace colour_space = ColourSpace::kRgb;
  std::vector<ColourPoint> colours;
  std::vector<OpacityPoint> opacities;  // empty: the default ramp, from the first to the last colour
  bool log_scale = false;               // interpolated in the logarithm of the scalar
  double opacity_unit = 0;              // world units; 0: not stated
  glm::dvec3 nan_colour{0.5, 0, 0};     // VTK's default
  std::vector<std::string> notes;       // what a person should be told
};

/// Immutable; any thread may ask.
class TransferFunction {
 public:
  struct Value {
    glm::dvec3 colour{0.0};  // 0..1, display values as ParaView's; blended as they are
    double extinction = 0;   // per world unit
  };

  /// `range` stretches the definition's points, colours and opacities each by their own ends, as ParaView
  /// rescales them (in the logarithm if the scale is logarithmic); without it they are taken as they are.
  /// `opacity_unit` > 0. Throws UsageError where the range does not fit: reversed, or not above zero for a
  /// logarithm; Error where it is not stretched and its own points are not above zero for a logarithm.
  TransferFunction(TransferFunctionDefinition definition, const std::pair<double, double>* range,
                   double opacity_unit);

  /// A built-in preset, stretched over [low, high]. If both are equal, that scalar gets the middle of the
  /// preset. Throws UsageError that lists the names there are.
  static TransferFunction preset(std::string_view name, double low, double high, double opacity_unit);

  /// A ParaView colour-map preset (JSON). `range` stretches it, else it is taken as it is. `opacity_unit` > 0
  /// goes before the file's ScalarOpacityUnitDistance, which goes before `default_opacity_unit`. Throws Error
  /// naming the file and the field.
  static TransferFunction fromFile(const std::filesystem::path& path, const std::pair<double, double>* range,
                                   double opacity_unit, double default_opacity_unit);

  /// Below and above range() the ends' values go on, as in ParaView. NaN has no extinction.
  Value at(double scalar) const;

  /// From the lowest to the highest point, colours and opacities together: outside it nothing changes.
  std::pair<double, double> range() const { return range_; }
  /// Whether interpolation between points is in the logarithm of the scalar.
  bool logScale() const { return log_scale_; }
  const std::string& name() const { return name_; }
  /// World units.
  double opacityUnit() const { return opacity_unit_; }
  /// What a person should be told: "no Points in the file: the default opacity ramp is used".
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  double coordinate(double scalar) const;

  std::string name_;
  ColourMap colours_;       // over coordinate(scalar)
  OpacityCurve opacities_;  // over coordinate(scalar)
  bool log_scale_ = false;
  double opacity_unit_ = 1;
  glm::dvec3 nan_colour_{0.0};
  std::pair<double, double> range_;
  std::vector<std::string> notes_;
};

/// The built-in presets over [0, 1], and their names, separated by commas. presetDefinition() throws
/// UsageError that lists them.
TransferFunctionDefinition presetDefinition(std::string_view name);
std::string presetNames();

/// The interval that a preset is stretched over for a scalar from `low` to `high`: a constant gets one around
/// it.
std::pair<double, double> intervalAround(double low, double high);

/// The ramp of a function that states no opacity, over [low, high].
std::vector<OpacityPoint> defaultOpacityRamp(double low, double high);

/// Reads the first preset of a ParaView colour-map file. Throws Error naming the file and the field.
TransferFunctionDefinition readParaViewPreset(const std::filesystem::path& path);
/// The same from a text; `path` is where it comes from, for messages.
TransferFunctionDefinition parseParaViewPreset(const std::string& text, const std::filesystem::path& path);
/// A colour-map file with this one preset, which readParaViewPreset() and ParaView read.
std::string toParaViewPreset(const TransferFunctionDefinition& definition);

}  // namespace curvisplat
