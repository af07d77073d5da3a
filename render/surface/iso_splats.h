// The splats among which isosurfaces may lie: those whose linear field has an isovalue within their support, in some
// tiles of a picture. They are what the rays of iso_rays.h meet.
//
// Their number grows with the area of the surfaces. Where they do not fit into the memory that is given they are
// dropped, and the caller takes fewer tiles: a tile's splats, and their order, are the same then.
#pragma once

#include <atomic>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "render/project/plane_cuts.h"
#include "render/project/screen_view.h"
#include "render/project/splat_pieces.h"
#include "stream/model/border_code.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// Tiles of a picture (tile_set.h), in rows: begin <= number < end.
struct TileRange {
  size_t begin = 0, end = 0;

  size_t count() const { return end - begin; }
};

/// A splat, or a part of one, in view axes: stretched units to the right, down and along the view.
struct IsoSplat {
  glm::dvec3 centre;                        // along the view from the depth origin; perspective: from the eye
  glm::vec3 by_right, by_down, by_forward;  // how the place u in the frame of A changes
  float weight;                             // V / √det S
  float mean;                               // less IsoSplats::base()
  glm::vec3 slope;                          // over u
  float other_mean;                         // of the picture's other scalar; else those of the scalar
  glm::vec3 other_slope;
  float x0, y0, x1, y1;        // pixels that it may touch
  float near;                  // where along the view it may begin
  uint32_t first_face, faces;  // of its brick's
};

class IsoSplats {
 public:
  struct Settings {
    const ScreenView& view;
    std::span<const double> values;  // the isovalues; at least one
    BorderStyle borders;             // how cells at borders are drawn
    std::span<const ClipPlane> clip_planes = {};
    double depth_origin = 0;  // PixelLayers'
    TileRange tiles;
    uint64_t most_bytes = 0;
    bool two_scalars = false;  // the picture's
  };
  /// Holds the splats of `parts` parts of bricks. What `settings` refers to outlives it.
  IsoSplats(const Settings& settings, size_t parts);

  /// Adds the splats of one part. Any thread; each part once. `other`: the picture's other scalar, or null.
  void add(size_t part, const glm::dvec3& cell_min, const GeometryArrays<const float>& geometry,
           const VariableArrays<const float>& variable, const VariableArrays<const float>* other,
           std::span<const SplatRange> ranges);

  /// Whether they take more than the memory: some are missing then.
  bool overflowed() const { return bytes_.load(std::memory_order_relaxed) > settings_.most_bytes; }
  const Settings& settings() const { return settings_; }
  /// The value that means are counted from.
  double base() const { return settings_.values.front(); }

  struct Placed {
    const IsoSplat* splat;
    std::span<const CutFace> faces;
  };
  /// How many splats were added.
  uint64_t count() const;
  /// Sorts the splats into the tiles, after the last add(). Parallel on the caller's TBB arena.
  void sort();
  /// The splats of a tile of the range, and of the pixels around it, by `near`, then in the order of parts.
  std::span<const Placed> inTile(size_t tile) const;

 private:
  struct Part {
    std::vector<IsoSplat> splats;
    std::vector<CutFace> faces;
  };
  struct TileBox {
    size_t x0, y0, x1, y1;  // the last included
  };

  void addPiece(Part& part, const glm::dvec3& cell_min, const SplatPiece& piece, const SplatPiece* other,
                float deviation);
  bool place(const glm::dvec3& centre, const Shape& shape, IsoSplat& splat) const;
  bool mayHold(const SplatPiece& piece, float reach, float deviation) const;
  TileBox tilesOf(const IsoSplat& splat) const;
  template <typename Take>
  size_t forTiles(const IsoSplat& splat, const Take& take) const;

  const Settings settings_;
  size_t columns_;
  std::vector<Part> parts_;
  std::atomic<uint64_t> bytes_ = 0;
  std::vector<size_t> begins_;  // [tiles of the range + 1], into placed_
  std::vector<Placed> placed_;
};

}  // namespace curvisplat
