// The transfer function that the user edits: opacity points, colours from a preset or a file, a range and an
// opacity unit; and a scalar's histogram along its range.
//
// Points have coordinates on [0, 1], which is mapped to the range linearly, on a logarithmic scale
// logarithmically, or by an asinh (in a function chosen from the data). There is always an opacity point at
// 0 and one at 1. A value type: one thread at a time may use an object. histogramOf() reads the cache, and
// is fast for any cache size.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render/colour/function_parts.h"
#include "render/colour/transfer_function.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

class EditedFunction {
 public:
  /// A built-in preset over [low, high]; equal ends are moved apart as in TransferFunction::preset().
  /// `opacity_unit` > 0, in world units. Throws UsageError that lists the presets if there is none of this
  /// name.
  EditedFunction(const std::string& preset, double low, double high, double opacity_unit);
  /// The range goes from the definition's lowest to its highest point. A definition without an opacity unit
  /// gets `default_opacity_unit`. Throws Error if its scale is logarithmic and its range is not above zero.
  EditedFunction(const TransferFunctionDefinition& definition, double default_opacity_unit);

  /// A function that was chosen from the data (render/automatic): the same, with the name kAutomatic.
  static EditedFunction automatic(const FunctionParts& parts);
  static constexpr const char* kAutomatic = "automatic";

  /// Gives a function that was chosen from the data the map that suits the background, where its map is that of the
  /// other one.
  void suitBackground(bool dark);

  /// The same function as options state it.
  explicit EditedFunction(const FunctionParts& parts);
  /// The function as options state it; nullopt if options cannot: colours were edited, the scale is
  /// logarithmic, or a file gave curves. `rounded`: with as few digits as cannot be seen.
  std::optional<FunctionParts> parts(bool rounded = false) const;

  TransferFunction function() const;
  /// The same function with points at scalar values, as in a ParaView preset.
  TransferFunctionDefinition definition() const;
  /// Name of the preset that gives this function over range() and opacityUnit(), or kAutomatic; empty if
  /// points were changed.
  const std::string& preset() const { return preset_; }
  bool isPreset() const { return !preset_.empty() && preset_ != kAutomatic; }
  bool isAutomatic() const { return preset_ == kAutomatic; }
  /// Marks a function that was saved as an automatic one.
  void setAutomatic() { preset_ = kAutomatic; }

  std::pair<double, double> range() const { return range_; }
  /// Returns false and changes nothing unless low < high and, on a logarithmic scale, low > 0.
  bool setRange(double low, double high);
  /// Sets the range of a scalar. Widens an empty range, and switches to a linear scale unless low > 0.
  void fitRange(double low, double high);
  bool logScale() const { return definition_.log_scale; }
  bool asinhScale() const { return asinh_.has_value(); }
  /// The range with its scale.
  ScalarAxis axis() const { return {range_, logScale(), asinh_}; }
  /// The scalar at a coordinate, and the coordinate of a scalar, which may lie outside 0..1.
  double scalarAt(double x) const { return axis().scalarAt(x); }
  double coordinateOf(double scalar) const { return axis().fractionOf(scalar); }
  /// Returns false and changes nothing if the range is not above zero.
  bool setLogScale(bool log_scale);
  void setLinear();
  double opacityUnit() const { return opacity_unit_; }
  void setOpacityUnit(double unit);

  const std::vector<OpacityPoint>& points() const { return definition_.opacities; }
  /// Two or more points, the first at 0 and the last at 1.
  void setOpacities(std::vector<OpacityPoint> points);
  /// Returns the new point's index. A point with the x of an existing one is inserted after it.
  size_t addPoint(double x, double opacity);
  /// Clamps x between the neighbours (0 and 1 for the first and last point) and opacity to 0..1.
  void movePoint(size_t point, double x, double opacity);
  /// Moves all but the first and the last point sideways, until one of them would leave 0..1.
  void movePointsTogether(double by);
  /// Does nothing for the first and the last point.
  void removePoint(size_t point);

  /// Sets the colours of a built-in preset; keeps the opacities.
  void setColours(const std::string& preset);
  /// The colour map whose colours these are; empty if they were edited or come from a file.
  const std::string& map() const { return map_; }

  const std::vector<ColourPoint>& colours() const { return definition_.colours; }
  /// Replaces many colour points by nine, which people can edit. Does nothing if there are at most twelve.
  void thinColours();
  void setColour(size_t point, const glm::dvec3& rgb);
  /// Moves a point, but not beyond its neighbours; does nothing for the first and the last point.
  void moveColour(size_t point, double x);
  /// Adds a point with the colour that is there. Returns its index.
  size_t addColour(double x);
  /// Does nothing for the first and the last point.
  void removeColour(size_t point);
  /// Colour at `x`, 0..1 over the range.
  glm::dvec3 colourAt(double x) const;

 private:
  void edited() { preset_.clear(); }
  void coloursEdited() { preset_.clear(), map_.clear(); }

  TransferFunctionDefinition definition_;  // on [0, 1]
  std::pair<double, double> range_;
  double opacity_unit_ = 1;
  std::string preset_, map_;
  std::optional<AsinhScale> asinh_;  // not with a logarithmic scale
};

/// The histogram of a scalar at the reader's step: the fraction of the data's volume in each of `bins` bins
/// of [0, 1], the scalar's coordinate along the function's range. It comes from the cache's own histogram,
/// which is of the finest splats, where its bins are fine enough for the range. Otherwise it is computed
/// from the coarsest level with at least 20,000 splats, or the finest level, without bricks that are
/// damaged. Throws Error if the disk fails.
std::vector<double> histogramOf(const CacheReader& cache, size_t variable, const EditedFunction& function,
                                size_t bins);

}  // namespace curvisplat
