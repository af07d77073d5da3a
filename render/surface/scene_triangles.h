// The triangles of all surfaces of a scene in one view: their vertices on the screen.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <utility>
#include <vector>

#include "render/project/screen_view.h"
#include "render/surface/surface_scene.h"

namespace curvisplat {

/// A vertex on the screen. `value` increases with the depth and is linear there: orthographic, the depth;
/// perspective, minus the inverse of the view's z.
struct ScreenVertex {
  float x, y, value;
};

/// The vertices of each surface.
using ScreenVertices = std::vector<std::vector<ScreenVertex>>;

/// What of a triangle lies behind the near plane: a polygon of 3 or 4 vertices, or none.
struct NearPolygon {
  std::array<ScreenVertex, 4> vertices;
  size_t count = 0;
};

/// Numbers of triangles count through all surfaces. Immutable; any thread.
class SceneTriangles {
 public:
  /// The scene outlives it. Transforms all vertices, in parallel: 12 bytes each, in `memory` that another one gave back.
  SceneTriangles(const SurfaceScene& scene, const ScreenView& view, double depth_origin,
                 ScreenVertices memory = {});

  /// For the next picture's. Nothing may be asked of this one afterwards.
  ScreenVertices takeMemory() { return std::move(vertices_); }

  uint32_t count() const { return begins_.back(); }
  const ScreenView& view() const { return view_; }
  const SurfaceScene& scene() const { return scene_; }
  /// The surface of a triangle, and its number there.
  struct Place {
    size_t surface;
    uint32_t triangle;
  };
  Place placeOf(uint32_t number) const {
    return begins_.size() == 2 ? Place{0, number} : placeOfSeveral(number);
  }
  uint32_t firstOf(size_t surface) const { return begins_[surface]; }
  const ScreenVertex& vertex(size_t surface, uint32_t vertex) const { return vertices_[surface][vertex]; }
  /// Perspective: the value of a vertex before the near plane is NaN.
  const std::vector<ScreenVertex>& verticesOf(size_t surface) const { return vertices_[surface]; }
  NearPolygon behindNear(size_t surface, const std::array<uint32_t, 3>& corners) const;
  /// The depth that PixelLayers has, of a value at a pixel.
  float depthOf(float value, float x, float y) const;

 private:
  Place placeOfSeveral(uint32_t number) const;
  glm::dvec3 inView(size_t surface, uint32_t vertex) const;
  ScreenVertex project(const glm::dvec3& in_view) const;
  void projectAll(const TriangleMesh& mesh, std::vector<ScreenVertex>& out) const;

  const SurfaceScene& scene_;
  const ScreenView view_;
  const double depth_origin_;
  std::vector<uint32_t> begins_;  // [surfaces + 1]
  ScreenVertices vertices_;
};

}  // namespace curvisplat
