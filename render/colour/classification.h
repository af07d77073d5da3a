// A transfer function as a cumulative table: its mean over any interval of the scalar is the difference of
// two look-ups. A step or a narrow peak keeps its exact weight, however wide or narrow the interval.
//
// Per-pixel classification (DESIGN.md, "Classification") takes the mean of extinction, and of colour weighted
// by extinction, over [f - s√3, f + s√3]: the interval whose uniform distribution has the mean f and the
// standard deviation s.
//
// Takes 200 KiB and about 3 ms to build. Immutable; any thread.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "render/colour/transfer_function.h"

namespace curvisplat {

class ClassificationTable {
 public:
  static constexpr int kCells = 4096;
  /// Smaller scalars are clamped to this before the logarithm is taken.
  static constexpr float kMinLogarithmic = 1e-37f;

  /// A table for data in [data_low, data_high]. A splat's mean at a pixel can lie beyond: its tangent overshoots at a
  /// step. There the function is what it is at the end of the data, so that no value is seen that the data does not have.
  static ClassificationTable of(const TransferFunction& transfer_function, double data_low, double data_high);

  /// The same of the colours alone, with extinction 1 everywhere: mean() is the mean colour.
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
  // [kCells + 2]: below the table, its cells, above the table. Each holds the index of the first element from
  // there on that has extinction; kCells + 2 if there is none.
  std::vector<uint32_t> next_opaque_;
};

}  // namespace curvisplat
