// A brick's splats -> ellipses on the screen. Design section 3, "Projection" and "Classification per pixel".
//
// Nothing is ever inverted: everything comes from rows of B = P A, with P two rows of the view (orthographic)
// or of its local affine map at the splat's centre (perspective), and A the splat's factor. S2 = B Bᵀ; with
// b0, b1 the rows of B and n = b0 × b1, Cauchy-Binet gives det S2 = |n|² without cancellation, and (S2 + ε)⁻¹
// B w = (b1·(n × w) + ε b0·w, -b0·(n × w) + ε b1·w) / det(S2 + ε).
//
// About 15 ns a splat and core (orthographic).
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/project/screen_view.h"
#include "stream/model/border_code.h"
#include "stream/model/brick.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// One splat as the painters take it. With d the offset of a pixel's centre from (x, y) in pixels and u the
/// solution of L u = d, L = | l11 0; l21 l22 | (S2 and the low-pass = L Lᵀ): rho² = |u|², optical depth per
/// unit of extinction = amplitude F(rho), scalar = mean + slope·u, spread evenly over ± half_width around
/// that.
struct ScreenSplat {
  float x, y;            // pixels from the left and the top
  float l11, l21, l22;   // pixels
  float amplitude;       // stretched units of length
  float mean;            // the scalar's unit, and so for the rest
  float slope0, slope1;  // along the columns of L
  float half_width;      // √3 deviations along the ray at rho = 0
};
static_assert(sizeof(ScreenSplat) == 40);

/// The faces that a splat is cut at: comes as a record of its own, directly behind the splat from the
/// farthest to the nearest, and directly before it from the nearest to the farthest. The splat's amplitude is
/// then negative: minus what it would be.
///
/// Along the ray of a pixel the splat lies about its middle with a distribution of deviation 1: the
/// biweight's, b(x) = 15 / (16 √7) (1 - x²/7)², |x| <= √7. A face leaves what is nearer than, or farther
/// than, a = faces[n][0] + (faces[n][1], faces[n][2]) · u deviations before, or behind, the middle; all faces
/// together an interval [lo, hi]. What is left of the optical depth is the interval's share M of the
/// distribution; and with its mean m and variance v, the scalar's mean changes by k m and its variance by -k²
/// (1 - v), where k = correlation half_width / √3.
struct ScreenCut {
  static constexpr int kFaces = 3;

  std::array<std::array<float, 3>, kFaces> faces{{{kNoFace, 0, 0}, {kNoFace, 0, 0}, {kNoFace, 0, 0}}};
  uint32_t far_sides = 0;  // bit n: face n leaves what is farther, x >= -a; else x <= a
  float correlation = 0;   // of scalar and depth along the ray, -1 to 1, as the faces see it

  static constexpr float kNoFace = 4;          // > √7
  static constexpr float kReach = 2.6457513f;  // √7

  /// As a record among splats, which isCut() tells from splats, and back.
  ScreenSplat record() const;
  static ScreenCut of(const ScreenSplat& record);
};

/// Whether a record is a ScreenCut.
inline bool isCut(const ScreenSplat& record) {
  return record.l11 < 0;
}
/// Whether a splat has a ScreenCut.
inline bool hasCut(const ScreenSplat& splat) {
  return splat.amplitude < 0 && !isCut(splat);
}

// l11 holds all that is not a face: -(4 far_sides + 2 + correlation).
inline ScreenSplat ScreenCut::record() const {
  const auto& f = faces;
  return {f[0][0], f[0][1], -(4 * static_cast<float>(far_sides) + 2 + correlation),
          f[0][2], f[1][0], f[1][1],
          f[1][2], f[2][0], f[2][1],
          f[2][2]};
}
inline ScreenCut ScreenCut::of(const ScreenSplat& r) {
  ScreenCut cut;
  cut.faces = {{{r.x, r.y, r.l21}, {r.l22, r.amplitude, r.mean}, {r.slope0, r.slope1, r.half_width}}};
  cut.far_sides = static_cast<uint32_t>(-0.25f * r.l11);
  cut.correlation = -r.l11 - 4 * static_cast<float>(cut.far_sides) - 2;
  return cut;
}

/// In data coordinates, before ScreenView::scale.
struct WorldBox {
  glm::dvec3 lower{0.0}, upper{0.0};
};

/// Where splats went; an empty picture is explained by these.
struct ProjectionCounts {
  uint64_t read = 0;         // in the bricks, or the parts of them that are drawn
  uint64_t clipped = 0;      // centre outside the clip box
  uint64_t off_screen = 0;   // outside the image, or before the near plane
  uint64_t transparent = 0;  // without extinction in the transfer function, or without weight
  uint64_t drawn = 0;        // of those read
  uint64_t pieces = 0;  // records that the drawn ones were drawn as: more at borders, and where perspective
                        // cuts
};

/// What to do with every splat of a frame.
struct ProjectionSettings {
  ScreenView view;
  bool per_pixel = true;  // false: flat splats; slopes and widths are left out
  std::optional<WorldBox> clip_box = std::nullopt;
  BorderStyle borders = kHalfCellStyle;  // kWholeCellStyle where the data is cell-centred
};

/// Projects bricks. One thread each.
class BrickProjector {
 public:
  /// A brick gives at most kMaxBrickSplats splats plus this many records of pieces; where borders and
  /// perspective would make more, borders are drawn as any cell, and perspective cuts coarser and drops more
  /// of what is close to the eye.
  static constexpr size_t kMaxPieces = 65536;
  static constexpr size_t kMaxSplats = kMaxBrickSplats + kMaxPieces;

  /// Takes the memory it will ever need.
  BrickProjector();

  /// Projects the splats of a brick that `ranges` hold; `cell_min` is the minimum corner of its cell. Leaves
  /// out what cannot be seen. Cells at borders are cut or drawn in parts (border_parts.h). Splats that reach
  /// behind the near plane or span a wide angle are cut along their longest column into two that merge into
  /// them exactly, until they are small for their distance; what then lies before the near plane is dropped.
  /// Overwrites splats() and depths(). Pure.
  void project(const ProjectionSettings& settings, const ClassificationTable& table,
               const glm::dvec3& cell_min, const GeometryArrays<const float>& geometry,
               const VariableArrays<const float>& variable, std::span<const SplatRange> ranges);
  /// All splats of a brick.
  void project(const ProjectionSettings& settings, const ClassificationTable& table,
               const glm::dvec3& cell_min, const SplatGeometry& geometry, const SplatVariable& variable);

  /// In the order of the ranges; a ScreenCut, of the same depth, behind its splat.
  const std::vector<ScreenSplat>& splats() const { return splats_; }
  /// [splats()], larger is farther: orthographic, distance along the view from any origin; perspective,
  /// distance from the eye.
  const std::vector<float>& depths() const { return depths_; }
  const ProjectionCounts& counts() const { return counts_; }

 private:
  std::vector<ScreenSplat> splats_;
  std::vector<float> depths_;
  ProjectionCounts counts_;
};

/// How far, in multiples of the largest slope (BrickVariable), a mean can reach over the footprints of a
/// splat and of its parts at a border, under `low_pass_px2`; where it is cut the mean moves by up to
/// ScreenCut::kReach deviations more.
double largestReach(double low_pass_px2);

}  // namespace curvisplat
