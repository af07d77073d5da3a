// The faces that merged splats end at: gathered while splats are added to voxels, from their border codes
// (stream/model/border_code.h), and kept for the voxels that have any. A face of a voxel is a plane: the mean of its
// splats' planes, by their cross-sections.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/splats/shape.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Planes of one voxel; normals are unit vectors from the border inwards.
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

/// Whether a splat that ends at all these planes is not cut at this one: another one faces it, or it is too uneven.
bool isClosed(const VoxelPlanes::Plane& plane, std::span<const VoxelPlanes::Plane> all);

/// Not for several threads at once.
class MergedFaces {
 public:
  explicit MergedFaces(size_t voxels) : first_(voxels, kNone) {}
  void clear();

  /// As VoxelMerger::add(). Sums depend on the order of the calls.
  void add(size_t voxel, const glm::dvec3& position, const Splat& splat, uint32_t border_code);
  /// Similar ones of its splats as one; beyond the first VoxelPlanes::kMax they are left out.
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

  std::vector<uint32_t> first_;  // [voxel]: of its sums
  std::vector<Sums> sums_;
};

/// The border code of a merged splat. `voxel_size`: how long the splats behind it are, at the least.
uint32_t mergedBorderCode(const VoxelPlanes& planes, const glm::dvec3& position, const Splat& merged,
                          double voxel_size);

}  // namespace curvisplat
