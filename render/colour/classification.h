// Scalar distributions -> colour and extinction. A transfer function, tabulated so that its mean over any
// interval is two look-ups: per-pixel classification (design section 3) takes the mean of extinction, and of
// colour weighted by extinction, over [f - s√3, f + s√3], the interval that has the distribution's mean f and
// deviation s.
//
// The table is cumulative: a step or a narrow peak of the transfer function keeps its exact weight, however
// wide or narrow the interval. Takes 200 KiB and about 3 ms to build. Immutable; any thread.
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
  /// The least scalar that a logarithm is taken of.
  static constexpr float kMinLogarithmic = 1e-37f;

  /// For scalars in about [data_low, data_high]: the table lies where the transfer function changes and data
  /// can be; a quarter of the data's range is added on either side, since means reach beyond the nodes'.
  static ClassificationTable of(const TransferFunction& transfer_function, double data_low, double data_high);

  /// As the transfer function `at` over [low, high], low < high, which goes on as at(low) and at(high)
  /// outside. `log_scale`: cells are equal in log(scalar), and low > 0.
  ClassificationTable(const std::function<TransferFunction::Value(double)>& at, double low, double high,
                      bool log_scale = false);

  /// Colour times extinction, and extinction (w), averaged over [centre - half_width, centre + half_width],
  /// in double precision: what the painters compute in float. On a log scale the average is over the
  /// logarithm. An interval narrower than a cell counts as one cell wide.
  glm::dvec4 mean(double centre, double half_width) const;

  /// Whether mean() is without extinction for every interval inside [low, high]. May say no where it is
  /// within a cell of saying yes.
  bool fullyTransparent(float low, float high) const {
    return next_opaque_[element(cellsOf(low) - 1)] > element(cellsOf(high) + 1);
  }

  /// What a painter needs. x = scale v + bias, with v the scalar or its natural logarithm, counts in cells;
  /// cumulative()[x] is the integral from 0 to x; below x = 0 the integrand is below(), from kCells on
  /// above().
  bool logScale() const { return log_scale_; }
  float scale() const { return static_cast<float>(scale_); }
  float bias() const { return static_cast<float>(bias_); }
  std::span<const glm::vec4> cumulative() const { return cumulative_; }   // [kCells + 1]
  std::span<const glm::dvec4> exactCumulative() const { return exact_; }  // the same, not rounded
  glm::vec4 below() const { return glm::vec4(below_); }
  glm::vec4 above() const { return glm::vec4(above_); }

 private:
  double integral(double x, int component) const;
  float cellsOf(float scalar) const {
    return (log_scale_ ? std::log(std::max(scalar, kMinLogarithmic)) : scalar) * scale() + bias();
  }
  /// Of next_opaque_, for x in cells.
  static uint32_t element(float x) { return static_cast<uint32_t>(std::clamp(x, -1.0f, float{kCells}) + 1); }

  bool log_scale_;
  double scale_, bias_;
  glm::dvec4 below_, above_;
  std::vector<glm::dvec4> exact_;      // [kCells + 1], the cumulative table
  std::vector<glm::vec4> cumulative_;  // the same in float
  // [kCells + 2]: below the table, its cells, above the table. The first element from here on with
  // extinction; kCells + 2 where there is none.
  std::vector<uint32_t> next_opaque_;
};

}  // namespace curvisplat
