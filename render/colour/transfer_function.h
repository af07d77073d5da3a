// Transfer functions: scalar -> (colour, extinction). A preset by name, or a ParaView colour-map file; and
// the list of the built-in colour maps that presets are made of.
//
//   Opacity o accumulates over the opacity unit u, and is capped at 0.9999: extinction κ = -ln(1 - o) / u.
//
// A look-up takes well under a microsecond; a table of 65,536 values takes milliseconds in any colour space.
// Functions and lists are immutable; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "render/colour/control_points.h"
#include "render/colour/scalar_axis.h"

namespace curvisplat {

/// A transfer function as a preset or a file states it, before it is stretched over a range. Points are
/// sorted by x, the scalar. There are two or more colour points with different x, and no opacity points or
/// two or more.
struct TransferFunctionDefinition {
  std::string name;
  std::string origin;  // for messages: "preset 'grey'", "a.json: preset 'X Ray'"
  ColourSpace colour_space = ColourSpace::kRgb;
  std::vector<ColourPoint> colours;
  std::vector<OpacityPoint> opacities;  // empty: the default ramp, from the first to the last colour
  bool log_scale = false;               // interpolate in the logarithm of the scalar
  std::optional<AsinhScale> asinh = std::nullopt;  // what the points come from: people are shown values by it
  double opacity_unit = 0;                         // world units; 0: not stated
  glm::dvec3 nan_colour{0.5, 0, 0};                // VTK's default
  std::vector<std::string> notes;                  // for the user
};

/// A transfer function over a range of the scalar. Immutable; any thread.
class TransferFunction {
 public:
  struct Value {
    glm::dvec3 colour{0.0};  // 0..1, display values as in ParaView; blended without conversion
    double extinction = 0;   // per world unit
  };

  /// `range` (may be null) stretches the points as ParaView rescales them: colours and opacities each from
  /// their own ends, in the logarithm if the scale is logarithmic. Null: the points stay as they are.
  /// `opacity_unit` > 0. Throws UsageError if the range is reversed, or not above zero for a logarithmic
  /// scale; Error if `range` is null and the points of a logarithmic scale are not above zero.
  TransferFunction(TransferFunctionDefinition definition, const std::pair<double, double>* range,
                   double opacity_unit);

  /// A built-in preset, stretched over [low, high]. If both are equal, that scalar gets the preset's middle.
  /// Throws UsageError that lists the presets.
  static TransferFunction preset(std::string_view name, double low, double high, double opacity_unit);

  /// Reads a ParaView colour-map preset (JSON). `range`: as for the constructor. The opacity unit is
  /// `opacity_unit` if that is > 0, else the file's ScalarOpacityUnitDistance, else `default_opacity_unit`.
  /// Throws Error with the file and the field.
  static TransferFunction fromFile(const std::filesystem::path& path, const std::pair<double, double>* range,
                                   double opacity_unit, double default_opacity_unit);

  /// The value at a scalar. Outside of range() it is the value at the nearer end, as in ParaView. NaN has no
  /// extinction.
  Value at(double scalar) const;
  double extinctionAt(double scalar) const;

  /// The range from the lowest to the highest point of colours and opacities.
  std::pair<double, double> range() const { return range_; }
  /// Whether points are interpolated in the logarithm of the scalar.
  bool logScale() const { return log_scale_; }
  /// The range as it is to be shown to people.
  ScalarAxis axis() const { return {range_, log_scale_, asinh_}; }
  const std::string& name() const { return name_; }
  /// The opacity unit, in world units.
  double opacityUnit() const { return opacity_unit_; }
  /// Notes for the user: "no Points in the file: the default opacity ramp is used".
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  double coordinate(double scalar) const;

  std::string name_;
  ColourMap colours_;       // over coordinate(scalar)
  OpacityCurve opacities_;  // over coordinate(scalar)
  bool log_scale_ = false;
  std::optional<AsinhScale> asinh_;
  double opacity_unit_ = 1;
  glm::dvec3 nan_colour_{0.0};
  std::pair<double, double> range_;
  std::vector<std::string> notes_;
};

/// A built-in preset over [0, 1], and the names of all, separated by commas. presetDefinition() throws
/// UsageError that lists them.
TransferFunctionDefinition presetDefinition(std::string_view name);
std::string presetNames();

/// The interval over which a preset is stretched for a scalar from `low` to `high`: around the scalar if it
/// is constant.
std::pair<double, double> intervalAround(double low, double high);

/// The opacities over [low, high] of a function that states none.
std::vector<OpacityPoint> defaultOpacityRamp(double low, double high);

/// Reads the first preset of a ParaView colour-map file. Throws Error with the file and the field.
TransferFunctionDefinition readParaViewPreset(const std::filesystem::path& path);
/// Reads the first preset of such a file's text; `path` is used in messages.
TransferFunctionDefinition parseParaViewPreset(const std::string& text, const std::filesystem::path& path);
/// The text of a colour-map file with this preset, for readParaViewPreset() and ParaView.
std::string toParaViewPreset(const TransferFunctionDefinition& definition);

enum class MapCategory { kSequential, kDiverging, kCyclic };

/// A colour map with the points that its authors published.
struct PublishedMap {
  struct Point {
    double x, red, green, blue;  // each 0..1
  };

  std::string_view name, source;  // "thermal", "cmocean"
  MapCategory category = MapCategory::kSequential;
  bool colour_blind_safe = false;  // told apart with the common forms of colour blindness
  ColourSpace space = ColourSpace::kRgb;
  std::span<const Point> points = {};  // sorted by x, from 0 to 1
};

/// The maps of matplotlib, cmocean and ParaView; published_maps.cpp names versions and licences.
std::span<const PublishedMap> publishedMaps();

/// All maps that --tf knows. The five that transfer_function_presets.cpp defines come first; their `points`
/// are empty.
std::span<const PublishedMap> builtInMaps();

}  // namespace curvisplat
