// Scalar -> (colour, extinction). A preset by name, or a ParaView colour-map file. Design section 9.
#pragma once

#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace curvisplat {

/// Immutable; any thread may ask.
class TransferFunction {
 public:
  struct Value {
    glm::dvec3 colour{0.0};  // 0..1, display values as ParaView's; blended as they are
    double extinction = 0;   // per world unit
  };

  /// A built-in preset, stretched over [low, high]. Throws UsageError that lists the names there are.
  static TransferFunction preset(std::string_view name, double low, double high, double opacity_unit);

  /// A ParaView colour-map preset (JSON). `range` stretches it, else it is taken as it is. `opacity_unit` > 0
  /// goes before the file's ScalarOpacityUnitDistance, which goes before `default_opacity_unit`. Throws Error
  /// naming the file and the field.
  static TransferFunction fromFile(const std::filesystem::path& path, const std::pair<double, double>* range,
                                   double opacity_unit, double default_opacity_unit);

  /// Below and above range() the ends' values go on, as in ParaView. NaN has no extinction.
  Value at(double scalar) const;

  std::pair<double, double> range() const;
  /// Whether interpolation between points is in the logarithm of the scalar.
  bool logScale() const;
  /// What a person should be told: "no Points in the file: the default opacity ramp is used".
  const std::vector<std::string>& notes() const;

 private:
  struct ColourPoint {
    double scalar;
    glm::dvec3 colour;
  };
  struct OpacityPoint {
    double scalar, opacity, midpoint, sharpness;
  };
  std::vector<ColourPoint> colours_;
  std::vector<OpacityPoint> opacities_;
  double opacity_unit_ = 1;
  bool log_scale_ = false;
  std::string colour_space_;
  std::vector<std::string> notes_;
};

}  // namespace curvisplat
