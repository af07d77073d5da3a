// Moment matching: several splats become one that stands for all of them. Design section 3, "Merging".
#pragma once

#include <span>

#include "stream/splats.h"

namespace curvisplat {

/// Collects splats (in the order of the calls: sums depend on it in their last bits) and gives the one that
/// stands for all. Positions are taken from a common origin near them, in world units.
class SplatMerger {
 public:
  explicit SplatMerger(size_t variables);
  void clear();
  /// `position` goes before splat.position. `values` has one element a variable.
  void add(const glm::dvec3& position, const Splat& splat, std::span<const SplatScalar> values);

  size_t count() const { return count_; }
  /// Overwrites `splat` (position from the common origin) and `values`. A single splat comes back as it went
  /// in. If all weights are zero the average is unweighted and the weight is zero. A degenerate axis gets the
  /// floor of node_splats. At least one splat must have been added.
  void finish(Splat& splat, std::span<SplatScalar> values) const;
  /// World units: the square root of the largest eigenvalue of 12 x the covariance of the merged centres (n³
  /// unit cells: √(n² - 1)). 0 for a single splat. What Brick::error is the largest of.
  double detail() const;

 private:
  // sums of weights and moments; to be laid out by the implementation
  size_t count_ = 0;
};

/// A from S = A Aᵀ (lower triangle given: xx, xy, yy, xz, yz, zz), with every singular value floored at
/// kAxisFloor of the largest. A zero matrix gives a factor of `smallest` on its diagonal.
inline constexpr double kAxisFloor = 1e-6;

}  // namespace curvisplat
