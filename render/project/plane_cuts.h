// Planes that splats are cut at. Clip planes bound half spaces outside of which nothing is drawn: they become
// faces of the pieces that they cross, as borders do, so that edges are crisp at every level of detail. A
// piece with faces has a ScreenCut, which is what they leave along the rays of its pixels, and a ScreenDepth,
// which is where it lies along them.
//
// A plane is kept in data coordinates, then in float relative to a brick's origin (LocalClipPlanes), then in
// the frame of a splat (CutFace). Pure or immutable; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "render/project/footprint.h"
#include "render/project/screen_splat.h"
#include "render/project/splat_pieces.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// A box in data coordinates, before ScreenView::scale.
struct WorldBox {
  glm::dvec3 lower{0.0}, upper{0.0};
};

/// Points with normal · (x - point) >= 0 are drawn. Data coordinates; the normal may have any length but 0.
struct ClipPlane {
  glm::dvec3 point{0.0}, normal{0.0};
};

/// The most clip planes that a picture can have, in addition to the box.
inline constexpr size_t kMaxClipPlanes = 6;

/// Whether the plane has a direction: a normal of finite length above 0.
bool isUsable(const ClipPlane& plane);

/// The planes, and the six faces of the box if there is one, with normals that point inwards.
std::vector<ClipPlane> clipPlanesOf(std::span<const ClipPlane> planes, const std::optional<WorldBox>& box);

/// The part of a box inside a clip box; all of it where that part is empty, or there is no clip box.
WorldBox leftBy(const std::optional<WorldBox>& clip_box, const WorldBox& box);

/// The side of the clip planes on which a splat lies.
enum class ClipSide : uint8_t { kInside, kAcross, kOutside };

/// Clip planes in float, relative to a brick's origin.
class LocalClipPlanes {
 public:
  LocalClipPlanes(std::span<const ClipPlane> planes, const glm::dvec3& origin);

  bool empty() const { return planes_.empty(); }
  /// Writes the sides of splats begin .. begin + count - 1, with their whole support, to sides[0 .. count -
  /// 1].
  void sidesOf(const GeometryArrays<const float>& geometry, size_t begin, size_t count,
               std::span<ClipSide> sides) const;
  /// Whether a point is drawn: it lies inside of all planes.
  bool contains(const glm::vec3& point) const;
  /// Adds the planes that cross the piece to its faces. If there are more than CutFaces can hold, it keeps
  /// those that remove most of the piece.
  void addFaces(SplatPiece& piece) const;

 private:
  struct Plane {
    glm::vec3 normal;  // unit length
    float offset;      // the distance of x is normal · x + offset
  };
  std::vector<Plane> planes_;
};

// Cutting at a face along a ray. With n the face's normal, n · (x - X0) is a linear field like
// the scalar. At a given pixel it therefore has a mean and a deviation, as the scalar has. In the frame of
// A, with q the normal, B the rows of the map times A, and S2' = B Bᵀ + λ (λ is the low-pass, which
// antialiases a face that is seen edge-on):
//
//     mean at the offset d  =  distance + (S2'⁻¹ B q) · d
//     variance              =  σ² (1 - qᵀ Bᵀ S2'⁻¹ B q)
//                           =  σ² (λ² + λ (|b0 × q|² + |b1 × q|²) + (b0 × b1 · q)²) / det S2'
//
// The second form is not subject to cancellation. The depth is such a field as well.

enum class Remains { kNothing, kSome, kAll };

/// Sets `cut` if part of the piece remains. `ellipse` is the ellipse of the piece under `rows`.
Remains cutAtFaces(const ScreenRows& rows, const SplatPiece& piece, const Ellipse& ellipse,
                   float low_pass_px2, ScreenCut& cut);

/// The part of the distribution of depths that the faces leave on the ray through the centre: its share, and its deviation.
struct DepthsLeft {
  float share, deviation;

  static DepthsLeft atCentre(const ScreenCut& cut);
};

/// Returns `along` of a splat that is cut at faces alone: what is left hides less of itself, by both its depths and its optical
/// depth. Painters take the optical depth of all of it. Where it meets layers, they take what each window leaves.
inline float alongLeft(const Ellipse& ellipse, const ScreenCut& cut) {
  const DepthsLeft left = DepthsLeft::atCentre(cut);
  return ellipse.along * left.share * left.deviation;
}

/// A plate loses of its `along` kPlatesBehind times the tangent, less kPlatesFrom, of the angle between the ray and its normal, in the
/// frame of the kernel and with the low-pass' widening: by sums along rays through plates of optical depths of 1 to 10.
inline constexpr float kPlatesBehind = 0.38f, kPlatesFrom = 0.1f;

/// Returns the share of its `along` that a piece has. Plates beside one another that are seen obliquely lie behind one another in
/// a pixel, so a part of what is nearer than the middle of all is shown by their order already; 1 for other pieces.
float shareOfAlong(const ScreenRows& rows, const SplatPiece& piece, float low_pass_px2);

/// `depth_row`: the depth per unit of the data. `depth`: of the piece's centre.
ScreenDepth depthAlongRay(const ScreenRows& rows, const glm::vec3& depth_row, float depth,
                          const SplatPiece& piece, const Ellipse& ellipse, float low_pass_px2);

/// No part of a splat lies farther from its centre along the view than this times the length of
/// `depth_row`'s image in the frame of A: the support across and the distribution along the ray, at right
/// angles.
inline constexpr float kDepthReach = 1.96f;

}  // namespace curvisplat
