// Moment matching: several splats become one that stands for all of them. Design section 3, "Merging".
//
// Sums are kept about the first splat added, so that a cluster far from the origin loses no digits. They
// depend, in their last bits, on the order of the calls. A cluster of any size takes 216 bytes and 80 a
// variable.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/splats/pieces.h"
#include "preprocess/splats/shape.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Many clusters side by side, in a few flat arrays: the voxels of an inner brick. Not for several threads at
/// once.
class VoxelMerger {
 public:
  /// `spread`: what the covariance of the centres counts in a merged shape. 12 makes n³ unit cells one of
  /// shape n² I; other values are for tests.
  VoxelMerger(size_t variables, size_t voxels, double spread = 12);
  /// Empties every voxel. Costs 8 bytes of writing a voxel.
  void clear();

  /// Adds a splat to cluster `voxel`. `position` goes before splat.position: world units from any origin that
  /// is common to the voxel's splats. `values` has one element a variable.
  void add(size_t voxel, const glm::dvec3& position, const Splat& splat, std::span<const SplatScalar> values);
  /// Adds some of a splat's eight pieces (pieces.h); `position` is the whole splat's.
  void addPieces(size_t voxel, PieceSet pieces, const glm::dvec3& position, const Splat& splat,
                 std::span<const SplatScalar> values);

  size_t voxels() const { return clusters_.size(); }
  /// Splats and groups of pieces added to `voxel`. finish() and detail() are for voxels that have some.
  uint32_t count(size_t voxel) const { return clusters_[voxel].count; }

  /// Overwrites `splat` (position from the same origin) and `values`. A single splat comes back as it went
  /// in, to the bit. If all weights are zero the average is unweighted and the weight is zero. Degenerate
  /// axes are floored as in shape.h.
  void finish(size_t voxel, Splat& splat, std::span<SplatScalar> values) const;

  /// World units: the square root of the largest eigenvalue of what the merged shape has beyond the mean shape of
  /// the splats in it, those of which there are but pieces counted whole. n³ unit cells: √(n² - 1). 0 for a
  /// single splat. What Brick::error is the largest of.
  double detail(size_t voxel) const;

 private:
  // Sums about the first splat's position and means: e and d. Each term times the splat's weight.
  struct GeometrySums {
    double weight = 0;
    glm::dvec3 centre{0.0};  // e
    Symmetric3 centre2;      // e e^T
    Symmetric3 shape;        // S
    Symmetric3 beyond;       // S of whole splats less that of their pieces
  };
  struct VariableSums {
    double mean = 0;        // d
    glm::dvec3 slope{0.0};  // h + 12 e d
    double variance = 0;    // t + d^2
  };
  struct Cluster {
    uint32_t count = 0;
    bool weighted =
        false;  // a weight > 0 has come; until then each splat counts as 1, from then on by its weight
    bool pending = false;  // the first splat is not in the sums yet: it may stay the only one
  };

  void accumulatePending(size_t voxel);
  void accumulate(size_t voxel, const glm::dvec3& position, const Splat& splat, const SplatScalar* values);
  /// `weight` counts if any does, else `share`. `value_of` gives the mean, A w and the variance of a variable.
  template <typename ValueOf>
  void accumulateMoments(size_t voxel, const glm::dvec3& position, double weight, double share,
                         const Symmetric3& shape, const ValueOf& value_of);
  void clearSums(size_t voxel);

  size_t variables_;
  double spread_;
  std::vector<Cluster> clusters_;
  std::vector<Splat> first_;                 // [voxel], of its first splat; position and size of a group
  std::vector<SplatScalar> first_values_;    // [voxel][variable]
  std::vector<GeometrySums> sums_;           // [voxel], valid but while the first splat is pending
  std::vector<VariableSums> variable_sums_;  // [voxel][variable], as sums_
};

/// One cluster. As VoxelMerger.
class SplatMerger {
 public:
  explicit SplatMerger(size_t variables) : one_(variables, 1) {}
  void clear() { one_.clear(); }
  void add(const glm::dvec3& position, const Splat& splat, std::span<const SplatScalar> values) {
    one_.add(0, position, splat, values);
  }
  size_t count() const { return one_.count(0); }
  void finish(Splat& splat, std::span<SplatScalar> values) const { one_.finish(0, splat, values); }
  double detail() const { return one_.detail(0); }

 private:
  VoxelMerger one_;
};

}  // namespace curvisplat
