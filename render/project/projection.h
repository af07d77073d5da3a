// Projects a brick's splats to ellipses on the screen. DESIGN.md, "Projection" and "Classification".
//
// No matrix is inverted: everything is computed from the rows of B = P A, with P two rows of the view
// (orthographic) or of its local affine map at the splat's centre (perspective), and A the splat's factor.
//
//     S2 = B Bᵀ, det S2 = |n|² with n = b0 × b1 (Cauchy-Binet: no cancellation; b0, b1 are the rows of B)
//     (S2 + ε)⁻¹ B w = (b1·(n × w) + ε b0·w, -b0·(n × w) + ε b1·w) / det(S2 + ε)
//
// About 15 ns a splat and core (orthographic).
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/project/light.h"
#include "render/project/pixel_layers.h"
#include "render/project/plane_cuts.h"
#include "render/project/screen_splat.h"
#include "render/project/screen_view.h"
#include "render/project/tile_set.h"
#include "stream/model/border_code.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

class GradientOpacity;
class ShadowGrid;

/// Counts of splats by what became of them; these counts explain an empty picture.
struct ProjectionCounts {
  uint64_t read = 0;         // in the bricks, or the parts of them that are drawn
  uint64_t clipped = 0;      // outside of a clip plane
  uint64_t hidden = 0;       // behind opaque layers
  uint64_t off_screen = 0;   // outside the image, or before the near plane
  uint64_t transparent = 0;  // without extinction in the transfer function, or without weight
  uint64_t drawn = 0;        // of those read
  uint64_t pieces = 0;  // records that the drawn ones were drawn as: more at borders, and where perspective
                        // cuts
};

/// How to project the splats of a frame; the same for all of them.
struct ProjectionSettings {
  ScreenView view;
  bool per_pixel = true;  // false: flat splats; slopes and widths are left out
  std::vector<ClipPlane> clip_planes = {};
  std::optional<Light> light = std::nullopt;
  double light_g0 = 1;                   // LocalLight's threshold: the scalar's unit per stretched unit
  BorderStyle borders = kHalfCellStyle;  // kWholeCellStyle where the data is cell-centred
  const PixelLayers* layers = nullptr;   // surfaces and slices in the picture, which splats are cut at
  std::shared_ptr<const GradientOpacity> gradient = nullptr;  // factor of extinctions; null: 1
  std::shared_ptr<const ShadowGrid> shadows = nullptr;        // factor of what `light` gives; null: 1

  /// Whether splats have light: painters must know.
  bool lit() const { return light.has_value(); }
};

/// The values of a brick's splats: of the scalar that is classified, and in pictures of two scalars of that
/// which gives the colours.
struct BrickValues {
  VariableArrays<const float> scalar;
  std::optional<VariableArrays<const float>> colours = std::nullopt;

  BrickValues(const VariableArrays<const float>& of_scalar) : scalar(of_scalar) {}
  BrickValues(const VariableArrays<float>& of_scalar) : scalar(of_scalar) {}
  BrickValues(const VariableArrays<const float>& of_scalar,
              const std::optional<VariableArrays<const float>>& of_colours)
      : scalar(of_scalar), colours(of_colours) {}
};

/// Projects bricks. Each projector belongs to one thread.
class BrickProjector {
 public:
  /// A brick gives at most kMaxBrickSplats splats, each with a ScreenColour in pictures of two scalars, plus
  /// this many records of pieces. If borders and perspective would make more, cells at borders are drawn as
  /// one splat instead of two. If that is too many as well, they are drawn like any other cell, clip planes
  /// keep or drop whole splats instead of cutting them, and perspective cuts more coarsely and drops more of
  /// the splats that are close to the eye.
  static constexpr size_t kMaxPieces = 65536;
  static constexpr size_t kMaxSplats = kMaxBrickSplats + kMaxPieces;

  /// Allocates all memory that project() will need, apart from the ScreenColours of pictures of two scalars.
  BrickProjector();

  /// Projects the splats of a brick that `ranges` hold; `cell_min` is the minimum corner of its cell. Leaves
  /// out what cannot be seen. Cells at borders are cut or drawn in parts (splat_pieces.h). Splats that reach
  /// behind the near plane or span a wide angle are cut along their longest column into two that merge into
  /// them exactly, until they are small for their distance; what then lies before the near plane is dropped.
  /// Overwrites splats() and depths(). Pure.
  void project(const ProjectionSettings& settings, const ClassificationTable& table,
               const glm::dvec3& cell_min, const GeometryArrays<const float>& geometry,
               const BrickValues& values, std::span<const SplatRange> ranges);
  /// All splats of a brick.
  void project(const ProjectionSettings& settings, const ClassificationTable& table,
               const glm::dvec3& cell_min, const SplatGeometry& geometry, const SplatVariable& variable);

  /// Leaves out what touches none of the tiles. To be called after project(): how splats are cut must not
  /// depend on the tiles.
  void keepTouching(const TileSet& tiles);

  /// The projected splats, in the order of the ranges. A splat's records precede it and have the same depth.
  /// Their keys are not known yet: until DepthKeys::setKeys() their slopes are pixels of depth a pixel.
  const std::vector<ScreenSplat>& splats() const { return splats_; }
  std::span<ScreenSplat> mutableSplats() { return splats_; }
  /// Depths of splats(), one each; larger is farther. In orthographic views, the distance along the view from
  /// the brick's origin; in perspective, 1 / b - 1 / z, where z is the distance along the view from the eye
  /// and b is ScreenView::orderBase(). On the screen both are linear over a plane.
  const std::vector<float>& depths() const { return depths_; }
  const ProjectionCounts& counts() const { return counts_; }

 private:
  std::vector<ScreenSplat> splats_;
  std::vector<float> depths_;
  ProjectionCounts counts_;
};

/// How far, in multiples of the largest slope (BrickVariable), a mean can reach over the footprints of a
/// splat and of its parts at a border, with a low-pass filter of variance `low_pass_px2`; where it is cut the
/// mean moves by up to ScreenCut::kReach deviations more.
double largestReach(double low_pass_px2);

}  // namespace curvisplat
