// Capsules: what lies within a radius of a segment. Lines are drawn as capsules that end in one another, points as
// capsules without a length.
//
// A capsule is kept as its two ends on the screen. The ray of each sample meets it exactly, in units of pixels at its
// first end, from which the ray's place is known as precisely as on the screen: lines and radii may be as small
// beside the distance of the eye as they like. In perspective a width in pixels grows with the distance; the radius is
// then that of the place where the ray passes the axis.
// A tube of a width in world units that the near plane cuts goes on as a cylinder before its cut end: sides of it lie behind
// that plane whose axis lies before it.
// Nothing allocates; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>

namespace curvisplat {

/// A vertex on the screen. `value` increases with the depth and is linear there: orthographic, the depth;
/// perspective, minus the inverse of the view's z.
struct ScreenVertex {
  float x, y, value;
};

/// The ends of a capsule. Those of a point are the same.
struct Capsule {
  ScreenVertex a, b;
};

/// The look that all capsules of one curve have in a view.
struct CapsuleLook {
  // A ball whose radius is this part of its distance along the view, or more, may be seen everywhere.
  static constexpr float kNearPart = 0.9f, kEverywhere = 1e9f;
  static constexpr float kNoLength = 1e-6f;   // pixels
  static constexpr float kMinSine2 = 1e-12f;  // of the angle between the axis and the ray

  bool perspective;
  float focal, middle_x, middle_y;  // pixels
  float nearest;                    // perspective: the value of the near plane
  float radius;                     // in pixels, at a distance of 1
  bool in_pixels;                   // at any distance

  /// The radius on the screen, in pixels.
  float radiusAt(float value) const { return perspective && !in_pixels ? -value * radius : radius; }
  /// Whether the near plane has cut a capsule at this end.
  bool isCutAt(const ScreenVertex& end) const { return perspective && !in_pixels && end.value == nearest; }
};

/// Pixels of the screen that contain a capsule; in perspective they may be all.
struct CapsuleBox {
  float x0, y0, x1, y1;
};
CapsuleBox boxOf(const Capsule& capsule, const CapsuleLook& look);

/// The place of a capsule that a point of the screen sees, or of its outline if the point lies beside it.
struct CapsulePlace {
  glm::vec3 normal;  // in view axes, of length 1
  float along;       // 0 at the first end, 1 at the other; beyond these before a cut end
};

/// Points of the screen, the capsules that they see, and the places of these. The arithmetic is in vectors; a point has the same
/// bits, whether it is alone or with others.
class CapsuleSpots {
 public:
  static constexpr size_t kAtOnce = 64;

  size_t size() const { return count_; }
  void clear() { count_ = 0; }
  /// Adds a point, of which there are at most kAtOnce.
  void add(const Capsule& capsule, const CapsuleLook& look, float x, float y);
  /// `look`: of any of the capsules.
  void findPlaces(const CapsuleLook& look) {
    look.perspective ? findPlacesIn<true>(look) : findPlacesIn<false>(look);
  }
  CapsulePlace place(size_t n) const { return {{normal_x_[n], normal_y_[n], normal_z_[n]}, along_[n]}; }

 private:
  template <bool kPerspective>
  void findPlacesIn(const CapsuleLook& look);

  using Row = std::array<float, kAtOnce>;
  size_t count_ = 0;
  alignas(64) Row x_, y_;
  Row ax_, ay_, a_value_, bx_, by_, b_value_;
  Row a_is_cut_, b_is_cut_;  // 1: by the near plane
  Row radius_;               // at the first end
  Row widens_;               // 1: is as many pixels at the other end
  Row normal_x_, normal_y_, normal_z_, along_;
};

/// The direction of a capsule, in view axes, of length 1; 0 without a length.
glm::vec3 axisOf(const Capsule& capsule, const CapsuleLook& look);

}  // namespace curvisplat
