// Shades surfaces where they are seen: SurfaceShader finds the colours, normals and opacities of
// triangles at points of the picture, and SurfaceLight lights them, as it lights slices and isosurfaces.
// Clip planes cut all of them along the rays of pixels: towardsViewer(), pixelSide() and coverageAt().
//
// A point has the same bits, whether it is shaded alone or with others. Many are shaded at a time, since the
// arithmetic is in vectors of 64 points. Immutable; any thread.
#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "render/colour/classification.h"
#include "render/project/light.h"
#include "render/project/plane_cuts.h"
#include "render/project/screen_view.h"
#include "render/surface/capsule.h"
#include "render/surface/scene_triangles.h"

namespace curvisplat {

/// Points of surfaces, the components of their vectors apart.
struct LitPoints {
  static constexpr size_t kAtOnce = 64;
  using Vectors = std::array<std::array<float, kAtOnce>, 3>;

  alignas(64) Vectors normal;  // in data coordinates, of any length above 0
  Vectors towards_viewer;      // in stretched space, of length 1
  Vectors colour;
};

/// Light on surfaces: that of the volume (render/project/light.h) with a strength of 1.
class SurfaceLight {
 public:
  /// `light`: none: a light where the viewer is, without highlights, which would whiten what is seen head-on: it has the
  /// colours of the scalar bar.
  SurfaceLight(const std::optional<Light>& light, const ScreenView& view);

  /// `normal` in data coordinates, of any length above 0; `towards_viewer` in stretched space, of length 1.
  glm::vec3 lit(const glm::vec3& colour, const glm::vec3& normal, const glm::vec3& towards_viewer) const;
  /// Lights the colours of the first `count` points, to the same bits.
  void light(LitPoints& points, size_t count) const;

 private:
  template <bool kAtViewer>
  glm::vec3 litBy(const glm::vec3& colour, const glm::vec3& normal, const glm::vec3& towards_viewer) const;
  template <bool kAtViewer>
  void lightBy(LitPoints& points, size_t count) const;

  const Light light_;
  const glm::vec3 per_scale_;
  glm::vec3 towards_{0};
};

/// Shades triangles and capsules where they are seen: colour, normal and opacity at points of the picture.
class SurfaceShader {
 public:
  /// The picture's tables. `opacities`: null, if no surface has the function's.
  struct Tables {
    const ColourTable& colours;
    const ColourTable* opacities = nullptr;
    std::span<const double> isovalues = {};  // of the scene's last surfaces, which are isosurfaces
  };
  /// `light`: none: a light at the viewer. The triangles and the tables outlive it.
  SurfaceShader(const SceneTriangles& triangles, const Tables& tables, const std::optional<Light>& light);

  /// A triangle or capsule, and the point of the picture at which it is seen: that of the triangle next to it, if it
  /// lies beside it.
  struct Spot {
    uint32_t number;
    float x, y;
  };
  /// A point that light falls on.
  struct Point {
    glm::vec3 colour{0.0f}, normal{0.0f};
    float opacity = 0;
    float scalar = 0;  // of an isosurface; else NaN
  };
  /// `points` [spots]: overwritten.
  void shade(std::span<const Spot> spots, std::span<Point> points) const;
  bool isOpaque(uint32_t number) const { return triangles_.isOpaque(triangles_.placeOf(number).surface); }
  const SurfaceLight& light() const { return light_; }

  /// Whether two triangles share a vertex, or capsules a point. There a surface is smooth, since vertices are doubled at edges,
  /// and each of them tells what it looks like on the other.
  bool meet(uint32_t a, uint32_t b) const;
  /// How much the value changes over a pixel, at most.
  float steepness(uint32_t number) const;

 private:
  static constexpr size_t kAtOnce = 64;
  struct Corners;
  struct Mixed;
  /// Barycentric, within the triangle; in perspective of the triangle in space.
  template <bool kPerspective>
  static void mix(const Corners& c, size_t count, Mixed& out);
  void gather(std::span<const Spot> spots, Corners& out) const;
  float isovalueOf(size_t surface) const;
  void shadeBlock(std::span<const Spot> spots, std::span<Point> points) const;
  void shadeTriangles(std::span<const Spot> spots, std::span<Point> points) const;
  void shadeCapsules(std::span<const Spot> spots, std::span<Point> points) const;
  void shadeCapsule(const Spot& spot, CapsulePlace place, Point& point) const;
  glm::dvec3 placeSeen(const Spot& spot) const;
  void shadeMap(const Spot& spot, const PlacedMap& map, Point& point) const;
  void smoothJoints(size_t curve, uint32_t end, CapsulePlace& place) const;

  const SceneTriangles& triangles_;
  const Tables tables_;
  const SurfaceLight light_;
  const bool has_light_;
  bool has_scalars_ = false, has_others_ = false;
};

/// The direction from a point of the picture to the viewer, in stretched space, of length 1. `x`, `y`: the
/// point.
inline glm::vec3 towardsViewer(const ScreenView& view, float x, float y) {
  if (view.projection != Projection::kPerspective) return glm::vec3(-view.forward);
  const double across = (double{x} - 0.5 * view.size.width) / view.focal_px;
  const double down = (double{y} - 0.5 * view.size.height) / view.focal_px;
  return glm::vec3(-glm::normalize(view.forward + across * view.right + down * view.down));
}

/// The side of a pixel in data coordinates, at a distance along the view.
inline double pixelSide(const ScreenView& view, double distance) {
  return (view.projection == Projection::kPerspective ? distance : 1) / view.focal_px /
         std::max({view.scale.x, view.scale.y, view.scale.z});
}

/// The share of a sheet at a point that clip planes leave, smoothed over a pixel.
inline float coverageAt(std::span<const ClipPlane> planes, const glm::dvec3& at, double pixel) {
  double coverage = 1;
  for (const ClipPlane& plane : planes)
    coverage *= std::clamp(0.5 + glm::dot(glm::normalize(plane.normal), at - plane.point) / pixel, 0.0, 1.0);
  return static_cast<float>(coverage);
}

}  // namespace curvisplat
