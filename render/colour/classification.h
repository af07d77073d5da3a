// A transfer function as tables, each for a question that is asked too often to evaluate the function
// itself:
//
//   ClassificationTable    means over any interval of the scalar: what painters classify pixels with
//   ClassificationChange   how much the function changes around the values of a brick: what the cut asks
//   ColourTable            colours at single values: what surfaces and slices are painted with
//
// They are built in milliseconds, from a function that need not outlive them, and take up to 200 KiB.
// Immutable; any thread.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "render/colour/transfer_function.h"

namespace curvisplat {

/// A cumulative table: the function's mean over any interval of the scalar is the difference of two
/// look-ups. A step or a narrow peak keeps its exact weight, however wide or narrow the interval.
///
/// Per-pixel classification (DESIGN.md, "Classification") takes the mean of extinction, and of colour
/// weighted by extinction, over [f - s√3, f + s√3]: the interval whose uniform distribution has the mean f
/// and the standard deviation s. Takes 200 KiB and about 3 ms to build.
class ClassificationTable {
 public:
  static constexpr int kCells = 4096;
  /// Smaller scalars are clamped to this before the logarithm is taken.
  static constexpr float kMinLogarithmic = 1e-37f;

  /// A table for data in [data_low, data_high]. A splat's mean at a pixel can lie beyond: its tangent
  /// overshoots at a step. There the function is what it is at the end of the data, so that no value is seen
  /// that the data does not have.
  static ClassificationTable of(const TransferFunction& transfer_function, double data_low, double data_high);

  /// A table of the colours alone, with extinction 1 everywhere: mean() is the mean colour.
  static ClassificationTable ofColours(const TransferFunction& transfer_function, double data_low,
                                       double data_high);

  /// Tabulates the transfer function `at` over [low, high], low < high; outside, it is at(low) and at(high).
  /// `log_scale`: cells are equally wide in log(scalar), and low > 0.
  ClassificationTable(const std::function<TransferFunction::Value(double)>& at, double low, double high,
                      bool log_scale = false);

  /// The mean of colour times extinction (xyz) and of extinction (w) over [centre - half_width, centre +
  /// half_width]. In double precision: the reference for what the painters compute in float. On a log scale
  /// the mean is over the logarithm. An interval narrower than a cell is widened to one cell.
  glm::dvec4 mean(double centre, double half_width) const;

  /// True only if mean() has no extinction for any interval inside [low, high]. May be false where the
  /// nearest extinction is less than a cell outside.
  bool fullyTransparent(float low, float high) const {
    return next_opaque_[element(cellsOf(low) - 1)] > element(cellsOf(high) + 1);
  }

  /// The table as painters read it. x = scale v + bias is in cells, v the scalar or its natural logarithm;
  /// cumulative()[x] is the integral from 0 to x. The integrand is below() for x < 0 and above() for x >
  /// kCells.
  bool logScale() const { return log_scale_; }
  float scale() const { return static_cast<float>(scale_); }
  float bias() const { return static_cast<float>(bias_); }
  std::span<const glm::vec4> cumulative() const { return cumulative_; }   // [kCells + 1]
  std::span<const glm::dvec4> exactCumulative() const { return exact_; }  // the same, in double precision
  glm::vec4 below() const { return glm::vec4(below_); }
  glm::vec4 above() const { return glm::vec4(above_); }

 private:
  double integral(double x, int component) const;
  float cellsOf(float scalar) const {
    return (log_scale_ ? std::log(std::max(scalar, kMinLogarithmic)) : scalar) * scale() + bias();
  }
  /// Index into next_opaque_ for x in cells.
  static uint32_t element(float x) { return static_cast<uint32_t>(std::clamp(x, -1.0f, float{kCells}) + 1); }

  bool log_scale_;
  double scale_, bias_;
  glm::dvec4 below_, above_;
  std::vector<glm::dvec4> exact_;      // [kCells + 1], the cumulative table
  std::vector<glm::vec4> cumulative_;  // the same in float
  // [kCells + 2]: below the table, its cells, above the table. Each holds the index of the first element
  // from there on that has extinction; kCells + 2 if there is none.
  std::vector<uint32_t> next_opaque_;
};

/// How much a transfer function changes around the values of a brick: what a picture may lose where splats
/// know the scalar only to within a deviation. DESIGN.md, "The cut".
///
/// Changes are kept for windows of 2, 4, 8, ... cells of the classification table. They take 90 KiB and well
/// under a millisecond to find.
class ClassificationChange {
 public:
  explicit ClassificationChange(const ClassificationTable& table);

  /// A bound of the change, per world unit, of colour times extinction or of extinction, whichever component
  /// changes more, from any scalar in [low, high] to any within `deviation` of it. The function counts as
  /// linear between the middles of the table's cells. Changes within 3 times the deviation and 4 cells may
  /// be counted; so a step has all of its height wherever it may lie. Costs up to a microsecond.
  double largestChange(float low, float high, float deviation) const;
  /// The largest extinction from low to high, and up to two cells further.
  double largestExtinction(float low, float high) const;

 private:
  double cellsOf(double scalar) const;
  /// The elements that [low, high] may lie in; the deviation in cells.
  std::pair<size_t, size_t> elementsOf(float low, float high) const;
  double deviationInCells(float low, float deviation) const;

  // Element 0 is what lies below the table, its cells follow, the last one is what lies above. Level n has
  // blocks of 2ⁿ elements: the change within each block and two blocks on either side.
  std::vector<std::vector<float>> changes_;
  std::vector<float> extinctions_;
  bool log_scale_;
  double scale_, bias_;
};

/// The colours of a transfer function, and its opacities as those of a sheet: over one opacity unit. Takes a
/// millisecond to build.
class ColourTable {
 public:
  explicit ColourTable(const TransferFunction& function);

  /// The colour at a scalar; outside of the function's range, that at its nearer end. NaN is not allowed.
  glm::vec3 at(double scalar) const { return glm::vec3(valueAt(scalar)); }
  /// The opacity there, as the opacity points state it.
  float opacityAt(double scalar) const { return valueAt(scalar).w; }

 private:
  static constexpr int kCells = 4096;

  glm::vec4 valueAt(double scalar) const;

  bool log_scale_;
  double low_, scale_;
  std::vector<glm::vec4> values_;  // [kCells + 1]
};

}  // namespace curvisplat
