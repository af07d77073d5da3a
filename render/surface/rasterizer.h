// Which triangle is seen at each of a pixel's samples.
//
// Vertices are moved to a grid of 1/16 pixel, in which edge functions are exact, in float for small triangles and
// in double for others: triangles that share an edge leave no gap and share no sample. Eight samples a pixel, whose
// mean is its centre. A sample keeps the least (depth, triangle) by an atomic minimum, so the result depends
// neither on the order of the triangles nor on threads.
//
// Costs 64 bytes a pixel: the picture is drawn in bands of rows, and only where triangles may be seen.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <vector>

#include "render/project/screen_view.h"
#include "render/surface/surface_scene.h"

namespace curvisplat {

inline constexpr int kSamples = 8;
/// From the pixel's centre, in 1/16 pixel.
inline constexpr std::array<std::array<int, 2>, kSamples> kSampleOffsets{
    {{1, -3}, {-1, 3}, {5, 1}, {-3, -5}, {-5, 5}, {-7, -1}, {3, 7}, {7, -7}}};

/// A vertex on the screen. `value` increases with the depth and is linear there: orthographic, the depth;
/// perspective, minus the inverse of the view's z.
struct ScreenVertex {
  float x, y, value;
};

/// Triangles of all surfaces of a scene in one view. Numbers count through all surfaces.
class SceneTriangles {
 public:
  /// The scene outlives it. Transforms all vertices, in parallel: 12 bytes each.
  SceneTriangles(const SurfaceScene& scene, const ScreenView& view, double depth_origin);

  uint32_t count() const { return begins_.back(); }
  const ScreenView& view() const { return view_; }
  const SurfaceScene& scene() const { return scene_; }
  /// The surface of a triangle, and its number there.
  struct Place {
    size_t surface;
    uint32_t triangle;
  };
  Place placeOf(uint32_t number) const;
  uint32_t firstOf(size_t surface) const { return begins_[surface]; }
  /// Pixels outside of it, [x0, x1) x [y0, y1), see no triangle.
  struct PixelBox {
    int x0 = std::numeric_limits<int>::max(), y0 = x0, x1 = 0, y1 = 0;
    void add(const ScreenVertex& vertex, ImageSize size);
    void add(const PixelBox& other);
    bool empty() const { return x0 >= x1 || y0 >= y1; }
  };
  const PixelBox& box() const { return box_; }
  const ScreenVertex& vertex(size_t surface, uint32_t vertex) const { return vertices_[surface][vertex]; }
  /// A vertex in view axes, in double.
  glm::dvec3 inView(size_t surface, uint32_t vertex) const;
  /// The depth that PixelLayers has, of a value at a pixel.
  float depthOf(float value, float x, float y) const;
  /// Perspective: the value is NaN before the near plane.
  ScreenVertex project(const glm::dvec3& in_view) const;

 private:
  const SurfaceScene& scene_;
  const ScreenView view_;
  const double depth_origin_;
  std::vector<uint32_t> begins_;  // [surfaces + 1]
  std::vector<std::vector<ScreenVertex>> vertices_;
  PixelBox box_;
};

/// The samples of some rows of the picture.
class SampleBand {
 public:
  static constexpr uint64_t kNothing = ~uint64_t{0};

  SampleBand(ImageSize size, int rows)
      : width_(size.width),
        samples_(static_cast<size_t>(size.width) * static_cast<size_t>(rows) * kSamples) {}
  static int rowsOf(ImageSize size, uint64_t bytes);

  /// Draws all triangles, in parallel on the caller's arena.
  void draw(const SceneTriangles& triangles, int first_row, int rows);

  /// [kSamples]: value and number, or kNothing.
  std::span<const uint64_t> at(int x, int y) const {
    return {&samples_[kSamples * (static_cast<size_t>(y - first_row_) * static_cast<size_t>(width_) +
                                  static_cast<size_t>(x))],
            kSamples};
  }
  static float valueOf(uint64_t sample);
  static uint32_t numberOf(uint64_t sample) { return static_cast<uint32_t>(sample); }

 private:
  struct Setup;
  void drawTriangle(const std::array<ScreenVertex, 3>& corners, uint32_t number);
  void drawGuarded(const std::array<ScreenVertex, 3>& corners, uint32_t number);
  void drawNear(const SceneTriangles& triangles, size_t surface, const std::array<uint32_t, 3>& corners,
                uint32_t number);
  template <typename Real>
  void fill(const Setup& setup, uint32_t number);

  const int width_;
  int first_row_ = 0, rows_ = 0;
  std::vector<uint64_t> samples_;
};

}  // namespace curvisplat
