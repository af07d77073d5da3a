// Moment matching: several splats become one that stands for all of them. DESIGN.md, "Merging". A merged
// splat also ends at faces: the planes that the splats of its voxel end at, averaged.
//
// Sums are kept about the first splat added, so that a cluster far from the origin loses no digits. They
// depend, in their last bits, on the order of the calls. A cluster of any size takes 228 bytes, 80 for each
// variable and 80 for each face. Nothing here is for several threads at once.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/shape/shape.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// The planes that a voxel's splats end at; normals are unit vectors from the border inwards.
struct VoxelPlanes {
  static constexpr size_t kMax = 4;
  struct Plane {
    glm::dvec3 inward, point;
    double area;      // of the cross-sections of the splats that touch it
    double thickest;  // of these splats, across the plane
    bool face;        // to be cut at
  };
  std::array<Plane, kMax> planes;
  size_t count = 0;
};

/// Whether a splat that ends at all these planes is not cut at `plane`: another one faces it, or it is no
/// face to be cut at (VoxelPlanes::Plane::face).
bool isClosed(const VoxelPlanes::Plane& plane, std::span<const VoxelPlanes::Plane> all);

/// The faces that merged splats end at: gathered from border codes (stream/model/border_code.h) while
/// splats are added to voxels, and kept for the voxels that have any. A face of a voxel is a plane: the
/// mean of its splats' planes, by their cross-sections.
class MergedFaces {
 public:
  explicit MergedFaces(size_t voxels) : first_(voxels, kNone) {}
  void clear();

  /// Adds a splat as VoxelMerger::add() does. Sums depend on the order of the calls.
  void add(size_t voxel, const glm::dvec3& position, const Splat& splat, uint32_t border_code);
  /// The planes of a voxel; similar ones are one plane. Those beyond the first VoxelPlanes::kMax are left
  /// out.
  VoxelPlanes of(size_t voxel) const;

 private:
  static constexpr uint32_t kNone = UINT32_MAX;
  struct Sums {
    glm::dvec3 inward{0.0};  // each times the cross-section
    glm::dvec3 point{0.0};
    double section = 0, area = 0, thickest = 0;
    bool face = true;
    uint32_t next = kNone;  // of the same voxel
  };
  struct SplatFace {
    glm::dvec3 inward;  // in the splat's frame, unit length
    double distance;    // from its middle, in its lengths
    bool cut;           // a face to be cut at
    bool touched;       // the splat ends there, and is not only behind it
  };

  void addFace(size_t voxel, const glm::dvec3& position, const Splat& splat, const SplatFace& face);

  std::vector<uint32_t> first_;  // [voxel]: of its sums
  std::vector<Sums> sums_;
};

/// The unit vector, in the splat's frame, from one to the other of two opposite faces that the splat fills the room between; nullopt if
/// there are none.
std::optional<glm::dvec3> acrossPlate(std::span<const VoxelPlanes::Plane> planes, const glm::dvec3& position,
                                      const Splat& splat);

/// Finds the same of a cell with outer faces on many sides, of which two must clearly be nearer to one another than any other two, so
/// that rounding does not decide. Returns nullopt for a rod or a cube.
std::optional<glm::dvec3> acrossLayer(std::span<const VoxelPlanes::Plane> planes, const glm::dvec3& position,
                                      const Splat& splat);

/// The border code of a merged splat. `position`: as in VoxelMerger::add(). `voxel_size`: the least length of
/// the splats behind it, in world units.
uint32_t mergedBorderCode(const VoxelPlanes& planes, const glm::dvec3& position, const Splat& merged,
                          double voxel_size);

/// Many clusters side by side, in a few flat arrays: the voxels of an inner brick.
class VoxelMerger {
 public:
  /// `spread`: the factor of the centres' covariance in a merged shape. 12 makes n³ unit cells one of
  /// shape n² I; other values are for tests.
  VoxelMerger(size_t variables, size_t voxels, double spread = 12);
  /// Empties every voxel. Writes 12 bytes for each. `voxel_size`: the length of the voxels' edges in world
  /// units, if the voxels form a lattice whose splats are to tile space (finish()); 0 if they do not.
  void clear(double voxel_size = 0);

  /// Adds a splat to cluster `voxel`. `position` is used in place of splat.position: world units from any
  /// origin that is common to the voxel's splats. `values` has one element a variable.
  void add(size_t voxel, const glm::dvec3& position, const Splat& splat, std::span<const SplatScalar> values,
           const SplatCodes& codes = {});

  size_t voxels() const { return clusters_.size(); }
  /// Splats added to `voxel`. finish() and detail() are for voxels that have some.
  uint32_t count(size_t voxel) const { return clusters_[voxel].count; }

  /// Overwrites `splat` (position from the same origin) and `values`, and returns the codes. A single splat
  /// comes back as it went in, to the bit. If all weights are zero the average is unweighted and the weight
  /// is zero. Degenerate axes are floored as in shape.h. In a lattice, a splat merged from
  /// several also gets the blur that belongs to the lattice, and ends at the faces that its splats end at.
  SplatCodes finish(size_t voxel, Splat& splat, std::span<SplatScalar> values) const;

  /// The values alone.
  void finishValues(size_t voxel, std::span<SplatScalar> values) const;

  /// World units: the square root of the largest eigenvalue of 12 x the covariance of the merged centres (n³
  /// unit cells: √(n² - 1)). 0 for a single splat. Brick::error is the largest of these. Returns `least`
  /// if that is more: often a bound shows it, and nothing has to be computed.
  double detail(size_t voxel, double least = 0) const;

 private:
  // Sums about the first splat's position and means: e and d. Each term times the splat's weight.
  struct GeometrySums {
    double weight = 0;
    glm::dvec3 centre{0.0};  // e
    Symmetric3 centre2;      // e e^T
    Symmetric3 shape;        // S
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
  };

  void finishMoments(size_t voxel, Splat& splat, std::span<SplatScalar> values) const;
  /// Blurs a splat of a lattice. Returns its faces.
  VoxelPlanes finishInLattice(size_t voxel, Splat& splat, std::span<SplatScalar> values) const;
  void accumulate(size_t voxel, const glm::dvec3& position, const Splat& splat, const SplatScalar* values);
  void clearSums(size_t voxel);

  size_t variables_;
  double spread_, voxel_size_ = 0;
  std::vector<Cluster> clusters_;
  std::vector<Splat> first_;                 // [voxel], of its first splat
  std::vector<SplatCodes> first_codes_;      // the same
  std::vector<SplatScalar> first_values_;    // [voxel][variable]
  std::vector<GeometrySums> sums_;           // [voxel], valid from the second splat on
  std::vector<VariableSums> variable_sums_;  // [voxel][variable], as sums_
  MergedFaces faces_;
};

/// A VoxelMerger of one cluster.
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
