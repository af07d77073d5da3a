// What triangles look like where they are seen: colour, normal and opacity at points of the picture. Many at a time, since
// the arithmetic is in vectors.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>

#include "render/surface/colour_table.h"
#include "render/surface/scene_triangles.h"
#include "render/surface/surface_light.h"

namespace curvisplat {

/// Immutable; any thread.
class SurfaceShader {
 public:
  /// The picture's tables. `opacities`: null, if no surface has the function's.
  struct Tables {
    const ColourTable& colours;
    const ColourTable* opacities = nullptr;
  };
  /// `light`: none: a light at the viewer. The triangles and the tables outlive it.
  SurfaceShader(const SceneTriangles& triangles, const Tables& tables, const std::optional<Light>& light);

  /// A triangle, and the point of the picture at which it is seen: that of the triangle next to it, if it lies beside it.
  struct Spot {
    uint32_t number;
    float x, y;
  };
  /// What light falls on.
  struct Point {
    glm::vec3 colour{0.0f}, normal{0.0f};
    float opacity = 0;
  };
  /// `points` [spots]: overwritten.
  void shade(std::span<const Spot> spots, std::span<Point> points) const;
  bool isOpaque(uint32_t number) const {
    return triangles_.scene().surfaces[triangles_.placeOf(number).surface].opacity.opaque();
  }
  const SurfaceLight& light() const { return light_; }

  /// Whether two triangles share a vertex. There a surface is smooth, since vertices are doubled at edges, and each of
  /// them tells what it looks like on the other.
  bool meet(uint32_t a, uint32_t b) const;
  /// How much the value changes over a pixel, at most.
  float steepness(uint32_t number) const;

 private:
  static constexpr size_t kAtOnce = 64;
  struct Corners;
  struct Mixed;
  /// Barycentric, within the triangle; in perspective of the triangle in space.
  template <bool kPerspective>
  static void mix(const Corners& corners, size_t count, Mixed& mixed);
  void gather(std::span<const Spot> spots, Corners& corners) const;
  void shadeBlock(std::span<const Spot> spots, std::span<Point> points) const;

  const SceneTriangles& triangles_;
  const Tables tables_;
  const SurfaceLight light_;
  bool has_scalars_ = false, has_others_ = false;
};

}  // namespace curvisplat
