// The frame of a place on a sphere about the origin, in which layers around it are level. Cells of meshes on the Earth are wide
// and thin: the moments of a prism 300 km wide, between planes, lie 2 km below its corners, however thin its layer is. In the
// frame of its middle the corners lie level, and moments are those of the layer.
//
//        flat:   x -> r d_across + up |x|           d = x / |x|;  d_across = d - up (up d);  r, up: of the frame's place
//
// Heights stay, and lines away from the Earth's middle are parallel. Frames of two places differ by the least rotation that
// takes the one's `up` to the other's. Pure: any thread.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <span>

#include "preprocess/shape/shape.h"

namespace curvisplat {

/// Whether cells lie in space as they are, or on a sphere about the origin.
enum class CellSpace { kFlat, kSphere };

class SphereFrame {
 public:
  /// A frame in which all stays as it is.
  SphereFrame() = default;
  /// The frame of a place; as the above if that is the origin.
  explicit SphereFrame(const glm::dvec3& at);
  /// The frame of the middle of some corners; as the first if one of them is too far from it (60 degrees).
  static SphereFrame ofMiddle(std::span<const glm::dvec3> corners);

  /// Whether all stays as it is.
  bool isFlat() const { return up_ == glm::dvec3(0.0); }

  glm::dvec3 flat(const glm::dvec3& x) const;
  /// Inverts flat(). Beyond a quarter of the sphere: the nearest place within it.
  glm::dvec3 bent(const glm::dvec3& x) const;
  /// The rotation that takes vectors of this frame to the other's.
  glm::dmat3 turnTo(const SphereFrame& other) const;

 private:
  glm::dvec3 up_{0.0};  // of length 1; 0 of the first frame
  double radius_ = 0;
};

/// R S Rᵀ.
Symmetric3 turned(const Symmetric3& shape, const glm::dmat3& by);

}  // namespace curvisplat
