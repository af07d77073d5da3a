// Gathered cells, each in the frame of its own middle (sphere_frame.h), for cells on a sphere: what moments and faces are measured
// of. Volumes stay those of the cells as they are, between planes. One thread calls.
#pragma once

#include <span>
#include <vector>

#include "preprocess/gather/corner_gather.h"
#include "preprocess/gather/face_matcher.h"
#include "preprocess/moments/mesh_splats.h"
#include "preprocess/moments/sphere_frame.h"

namespace curvisplat {

class FlattenedCells {
 public:
  enum class Volumes { kKept, kNone };

  /// Takes a batch, in parallel; keeps the capacity. In flat space it copies nothing: `cells` has to stay.
  void assign(const GatheredCells& cells, CellSpace space, Volumes volumes);

  const GatheredCells& cells() const { return *cells_; }
  bool flattened() const { return !frames_.empty(); }
  /// The frame of cell n, if they are flattened().
  const SphereFrame& frame(size_t n) const { return frames_[n]; }
  /// A face of the cells as it lies in space.
  HalfFace inSpace(HalfFace face) const;

 private:
  const GatheredCells* cells_ = nullptr;
  GatheredCells flat_;
  std::vector<SphereFrame> frames_;
};

/// Planes as a splat at `at` has them: in the frame of its place.
void flattenAt(const glm::dvec3& at, std::span<OuterPlane> planes);

}  // namespace curvisplat
