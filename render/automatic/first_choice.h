// Chooses a transfer function and a view from the data, so that a picture without options shows something.
// DESIGN.md, "The first picture", gives the rule and its reasons. Everything that is chosen has few digits
// and can be given as options: the same options draw the same picture.
//
// Opening reads a coarse level of the cache: 0.1 to 0.3 s and 50 MB for any cache. Then immutable; any
// thread.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <string>

#include "render/automatic/coarse_samples.h"
#include "render/automatic/opacity_rule.h"
#include "render/automatic/view_rule.h"
#include "render/colour/function_parts.h"

namespace curvisplat {

/// Whether the values differ by so little that only their noise could be drawn: 1e-4 of the largest.
bool isNearlyConstant(const VariableInfo& variable);
/// The position of the first variable of the best kind (ScalarKind) that is not nearly constant; components of vectors that vary by
/// rounding errors alone come last; 0 if all are nearly constant. Requires one or more.
size_t firstVaryingVariable(const Manifest& manifest);

class FirstChoice {
 public:
  /// `scale`: factors that the data's positions are multiplied with. Throws Error as reading does.
  FirstChoice(const CacheReader& cache, size_t variable, const glm::dvec3& scale,
              ChosenFor what = ChosenFor::kStep);

  /// Range, opacities and opacity unit; `map`: a preset, or empty to have one of `maps` chosen. `with_sheets`: slices or faces have
  /// its colours, too, which show values that the volume hides: the range is not narrowed to those that it shows.
  FunctionParts function(const std::string& map = "", const DefaultMaps& maps = kMapsOnDark,
                         bool with_sheets = false) const;
  /// The opacity unit at which the function absorbs 65 % on the average over what it shows (seenArea()). Its
  /// own unit does not matter. A function that is transparent for the data gets 1/100 of its diagonal.
  double opacityUnitOf(const TransferFunction& function) const;
  /// The value below which `part` (0..1) of the volume lies.
  double percentile(double part) const;
  /// The view for a picture of `size` (chooseView()), in which what is in the box [lower, upper] is drawn.
  ViewChoice view(const TransferFunction& function, ImageSize size, Framed framed, const glm::dvec3& lower,
                  const glm::dvec3& upper) const;

 private:
  class Fit;

  FunctionParts constantFunction() const;
  /// Whether little of the data is seen in a picture of the whole of it.
  bool isWithoutContext(const TransferFunction& function) const;
  /// The function, with an opacity for all values that makes the data's mean depth as large as `depth`, or larger.
  FunctionParts inHaze(double depth, FunctionParts parts) const;
  /// How much of the values in each bin is seen.
  BinWeights seenIn(const VolumeHistogram& histogram, const TransferFunction& function) const;

  VariableInfo variable_;
  glm::dvec3 lower_, upper_;  // the data's box, scaled
  CoarseSamples samples_;
  std::optional<ValueDistribution> distribution_;  // nullopt: the cache has no splats
  Silhouette silhouette_;
};

}  // namespace curvisplat
