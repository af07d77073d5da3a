// The triangles of all surfaces of a scene in one view, and the capsules of its lines and points: their vertices on the
// screen, the samples that pixels see them with, and the tiles of the picture that they may be seen in.
//
//   SurfaceScene -> SceneTriangles: vertices -> TriangleBins: by tile -> rasterizer.h: PixelSamples
//
// The curves of a scene come after its surfaces, as if they were surfaces, too. A capsule has the number of the point at
// which it ends among the points of its curves. Numbers count through all triangles and points, so that samples can name
// them. Vertices take 12 bytes each, points 16, bins at most some 8 bytes a triangle or point. Both are built in parallel,
// on the caller's TBB arena, and are immutable then; any thread.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "render/project/screen_view.h"
#include "render/surface/capsule.h"
#include "render/surface/surface_scene.h"

namespace curvisplat {

/// The vertices of each surface, and the points of each of the curves after them.
using ScreenVertices = std::vector<std::vector<ScreenVertex>>;

/// The part of a triangle behind the near plane: a polygon of 3 or 4 vertices, or none.
struct NearPolygon {
  std::array<ScreenVertex, 4> vertices;
  size_t count = 0;
};

/// Numbers of triangles count through all surfaces, and then those of capsules through all curves.
class SceneTriangles {
 public:
  /// The scene outlives it. Transforms all vertices, in parallel: 12 bytes each, in `memory` that another
  /// one gave back.
  SceneTriangles(const SurfaceScene& scene, const ScreenView& view, double depth_origin,
                 ScreenVertices memory = {});

  /// The memory, for the next picture's triangles. Nothing may be asked of this object afterwards.
  ScreenVertices takeMemory() { return std::move(vertices_); }

  uint32_t count() const { return begins_.back(); }
  const ScreenView& view() const { return view_; }
  const SurfaceScene& scene() const { return scene_; }
  size_t sheets() const { return begins_.size() - 1; }  // surfaces and curves
  bool isCurve(size_t surface) const { return surface >= scene_.surfaces.size(); }
  const Curves& curvesOf(size_t curve) const { return scene_.curves[curve - scene_.surfaces.size()]; }
  bool isOpaque(size_t surface) const;
  /// The surface of a triangle, and its number there; or the curves of a capsule, and the point at which it ends.
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
  static constexpr uint32_t kNoCapsule = std::numeric_limits<uint32_t>::max();
  /// The point at which the capsule begins that ends at `point`; kNoCapsule: none ends there.
  uint32_t beginOf(size_t curve, uint32_t point) const {
    return capsule_begins_[curve - scene_.surfaces.size()][point];
  }
  /// The capsule's part behind the near plane, and not far outside of the picture; NaN: it has none.
  Capsule capsuleOf(size_t curve, uint32_t point) const {
    const std::vector<ScreenVertex>& vertices = vertices_[curve];
    const Capsule whole{vertices[beginOf(curve, point)], vertices[point]};
    const auto isNear = [](const ScreenVertex& at) {
      return std::abs(at.x) <= kGuard && std::abs(at.y) <= kGuard && at.value == at.value;
    };
    return isNear(whole.a) && isNear(whole.b) ? whole : cutCapsule(curve, point);
  }
  /// The parts of the whole capsule at which `cut`, as of capsuleOf(), begins and ends.
  std::pair<float, float> partsOf(size_t curve, uint32_t point, const Capsule& cut) const;
  const CapsuleLook& lookOf(size_t curve) const { return looks_[curve - scene_.surfaces.size()]; }
  /// The depth that PixelLayers has, of a value at a pixel.
  float depthOf(float value, float x, float y) const;

 private:
  Place placeOfSeveral(uint32_t number) const;
  glm::dvec3 inView(size_t surface, uint32_t vertex) const;
  ScreenVertex project(const glm::dvec3& in_view) const;
  void projectAll(const glm::dvec3& origin, const std::vector<glm::vec3>& positions,
                  std::vector<ScreenVertex>& out) const;
  static constexpr float kGuard = 1e5f;  // pixels: a capsule that reaches beyond is cut there

  std::vector<uint32_t> capsuleBegins(size_t curve) const;
  Capsule cutCapsule(size_t curve, uint32_t point) const;
  CapsuleLook makeLook(const Curves& curves) const;
  const glm::dvec3& originOf(size_t surface) const;
  const std::vector<glm::vec3>& positionsOf(size_t surface) const;

  const SurfaceScene& scene_;
  const ScreenView view_;
  const double depth_origin_;
  std::vector<uint32_t> begins_;  // [surfaces + curves + 1]
  ScreenVertices vertices_;
  std::vector<std::vector<uint32_t>> capsule_begins_;  // [curves][points]
  std::vector<CapsuleLook> looks_;                     // [curves]
};

/// Pixels: the tiles in which samples are drawn.
inline constexpr int kSampleTileWidth = 128, kSampleTileHeight = 32;
inline constexpr size_t kSamples = 8;
/// The samples' offsets from the pixel's centre, in 1/16 pixel.
inline constexpr std::array<std::array<int, 2>, kSamples> kSampleOffsets{
    {{1, -3}, {-1, 3}, {5, 1}, {-3, -5}, {-5, 5}, {-7, -1}, {3, 7}, {7, -7}}};
/// The offsets in floats, for vectors.
struct SamplePlaces {
  alignas(64) std::array<float, kSamples> x{}, y{};
  constexpr SamplePlaces() {
    for (size_t n = 0; n < kSamples; ++n) {
      x[n] = static_cast<float>(kSampleOffsets[n][0]);
      y[n] = static_cast<float>(kSampleOffsets[n][1]);
    }
  }
};
inline constexpr SamplePlaces kSamplePlaces;

/// The triangles and capsules that the samples of a pixel see: their numbers, and their values there.
struct PixelSamples {
  static constexpr uint32_t kNothing = std::numeric_limits<uint32_t>::max();

  alignas(32) std::array<float, kSamples> values;
  std::array<uint32_t, kSamples> numbers;
};
static_assert(sizeof(PixelSamples) == 64);

/// Consecutive triangles of a surface, or points of curves.
struct TriangleRun {
  uint32_t first, count;
};

/// The triangles and capsules that may be seen in each tile of a picture.
///
/// A triangle or capsule is listed in every tile that its box of pixels touches; those outside of the picture,
/// before the near plane or, of triangles, without a size on the grid of samples are listed nowhere. Batches of triangles
/// are sorted by tile in parallel, each on its own. Consecutive triangles in the same tiles, which meshes
/// mostly have, are one run: 8 bytes a run and tile.
class TriangleBins {
 public:
  explicit TriangleBins(const SceneTriangles& triangles);

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  /// Calls draw(surface, runs of its triangles) for each batch that the tile sees a part of; false if none.
  template <typename Draw>
  bool forTile(int column, int row, const Draw& draw) const {
    bool any = false;
    for (const Batch& batch : batches_) {
      const std::span<const TriangleRun> seen = batch.at(column, row);
      if (seen.empty()) continue;
      any = true;
      draw(batch.surface, seen);
    }
    return any;
  }

 private:
  /// Tiles, the last included.
  struct TileBox {
    int16_t x0 = 0, y0 = 0, x1 = -1, y1 = -1;
    bool empty() const { return x0 > x1 || y0 > y1; }
    bool operator==(const TileBox&) const = default;
  };
  struct Batch {
    size_t surface = 0;
    uint32_t first = 0, count = 0;
    TileBox box;
    std::vector<uint32_t> begins;  // [tiles of the box + 1], into `runs`
    std::vector<TriangleRun> runs;

    std::span<const TriangleRun> at(int column, int row) const {
      if (column < box.x0 || column > box.x1 || row < box.y0 || row > box.y1) return {};
      const auto tile = static_cast<size_t>(row - box.y0) * static_cast<size_t>(box.x1 - box.x0 + 1) +
                        static_cast<size_t>(column - box.x0);
      return {runs.data() + begins[tile], begins[tile + 1] - begins[tile]};
    }
  };
  /// Consecutive triangles that touch the same tiles.
  struct Piece {
    TileBox box;
    TriangleRun run;
  };
  class Pieces;
  TileBox tilesOf(float x0, float y0, float x1, float y1) const;
  void addTriangles(const SceneTriangles& triangles, const Batch& batch, Pieces& pieces) const;
  void addCapsules(const SceneTriangles& triangles, const Batch& batch, Pieces& pieces) const;
  void sort(const SceneTriangles& triangles, Batch& batch) const;

  int columns_, rows_;
  ImageSize size_;
  std::vector<Batch> batches_;
};

}  // namespace curvisplat
