// Decides about a splat once its place on the screen is known: beside which layers of the picture it lies,
// its record of the scalar that gives the colours, and whether it can be seen at all.
//
//   LocalLayers::sideOf -> cuts and records (plane_cuts.h, colourOf) -> SplatChooser: what can be seen
//
// A splat is left out only if it could not change the picture. A part of projection.cpp: everything is
// inline, in the loop over a brick's splats. A chooser belongs to one thread; the rest is pure.
#pragma once

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <optional>
#include <vector>

#include "render/colour/classification.h"
#include "render/project/footprint.h"
#include "render/project/gradient_opacity.h"
#include "render/project/light.h"
#include "render/project/painter.h"
#include "render/project/pixel_layers.h"
#include "render/project/plane_cuts.h"
#include "render/project/screen_splat.h"
#include "render/project/screen_view.h"
#include "render/project/shadow_grid.h"
#include "render/project/splat_pieces.h"

namespace curvisplat {

/// The light and opacity that the gradient of a splat's scalar gives it.
struct BySlope {
  Lit lit;
  float opacity = 1;  // factor of the extinction
};

/// How it gives that.
struct SlopeRules {
  std::optional<LocalLight> light;
  const GradientOpacity* gradient;  // null: 1
  glm::vec3 per_scale;
  std::optional<LocalShadows> shadows = std::nullopt;  // of `light`

  BySlope of(const GeometryArrays<const float>& geometry, const VariableArrays<const float>& variable,
             size_t i) const {
    BySlope by_slope;
    if (!light && !gradient) return by_slope;
    const Shape shape = shapeOf(geometry, i);
    const Slope slope = slopeOf(variable, i);
    if (gradient) by_slope.opacity = gradient->of(glm::length(gradientOf(shape, slope, per_scale)));
    if (light) by_slope.lit = light->of(geometry.x[i], geometry.y[i], geometry.z[i], shape, slope);
    if (shadows) {
      const float arriving = shadows->at(geometry.x[i], geometry.y[i], geometry.z[i]);
      by_slope.lit.diffuse *= arriving;
      by_slope.lit.specular *= arriving;
    }
    return by_slope;
  }
};

/// Decides for each projected splat whether it can be seen, and keeps those that can.
class SplatChooser {
 public:
  enum class Fate { kOffScreen, kTransparent, kKept };

  /// The vectors that get what is kept.
  struct Kept {
    std::vector<ScreenSplat>& splats;
    std::vector<float>& depths;
  };
  /// `reach`: largestReach().
  SplatChooser(const ScreenView& view, double reach, PixelShading shading, const ClassificationTable& table,
               const Kept& kept)
      : table_(table),
        width_(static_cast<float>(view.size.width)),
        height_(static_cast<float>(view.size.height)),
        reach_(1.001f * static_cast<float>(reach)),
        largest_scalar_(largestScalar(table)),
        per_pixel_(shading.per_pixel),
        lit_(shading.lit),
        splats_(kept.splats),
        depths_(kept.depths) {}

  /// The largest scalar that painters can look up.
  static float largestScalar(const ClassificationTable& table) {
    return kLargestCells / std::max(table.logScale() ? 1.0f : std::abs(table.scale()), kMinScale);
  }

  /// Inline: handed over through memory, a splat that has just been put together stalls on its way into the
  /// vector, which takes as long as all the rest. `widening`: how much farther than half_width a mean can
  /// be.
  [[gnu::always_inline]] Fate choose(ScreenSplat splat, float depth, const Lit& lit, float widening = 1) {
    const float reach_x = kSupport * splat.l11;
    const float reach_y = kSupport * (std::abs(splat.l21) + splat.l22);
    const bool on_screen = splat.x + reach_x > 0 && splat.x - reach_x < width_ && splat.y + reach_y > 0 &&
                           splat.y - reach_y < height_;
    if (!on_screen) return Fate::kOffScreen;
    if (!per_pixel_) splat.slope0 = splat.slope1 = splat.half_width = splat.along = 0;
    float spread = kSupport * (std::abs(splat.slope0) + std::abs(splat.slope1)) + widening * splat.half_width;
    if (!(std::abs(splat.mean) + spread <= largest_scalar_)) {
      splat.slope0 = splat.slope1 = splat.half_width = splat.along = spread = 0;
      splat.mean = std::clamp(splat.mean, -largest_scalar_, largest_scalar_);
    }
    splat.amplitude = std::min(splat.amplitude, kLargestAmplitude);
    if (!(splat.amplitude > 0) || table_.fullyTransparent(splat.mean - spread, splat.mean + spread))
      return Fate::kTransparent;
    if (lit_) splat.half_width = packLit(splat.half_width, lit);
    splats_.push_back(splat);
    depths_.push_back(depth);
    return Fate::kKept;
  }

  /// The records of a splat besides itself; null: none.
  struct Records {
    const ScreenCut* cut = nullptr;
    const ScreenDepth* along_ray = nullptr;
    const ScreenColour* colour = nullptr;
  };
  /// Chooses a splat with records, which are kept before it.
  Fate chooseWith(const Records& records, const ScreenSplat& splat, float depth, const Lit& lit) {
    const size_t before = splats_.size();
    const bool is_cut = records.cut || records.along_ray;
    // A truncated distribution's mean moves by up to kReach deviations; half_width is √3.
    const Fate fate =
        choose(splat, depth, lit, is_cut ? ScreenCut::kReach / std::numbers::sqrt3_v<float> : 1.0f);
    if (splats_.size() == before) return fate;
    ScreenSplat kept = splats_.back();
    if (is_cut) kept.amplitude = -kept.amplitude;
    splats_.pop_back();
    if (records.cut) splats_.push_back(records.cut->record());
    if (records.along_ray) splats_.push_back(records.along_ray->record());
    if (records.colour) splats_.push_back(inBounds(*records.colour).record());
    splats_.push_back(kept);
    depths_.resize(splats_.size(), depth);
    return fate;
  }

  /// Whether every piece of a splat is transparent, wherever the piece lies. `slope` is the slope as drawn.
  bool transparentThroughout(float mean, float slope, float variance) const {
    const float spread = reach_ * slope + ScreenCut::kReach * std::sqrt(slope * slope + variance);
    return table_.fullyTransparent(mean - spread, mean + spread);
  }

 private:
  /// Keeps the record finite, as choose() keeps splats.
  ScreenColour inBounds(ScreenColour colour) const {
    const float spread =
        kSupport * (std::abs(colour.slope[0]) + std::abs(colour.slope[1])) + colour.half_width;
    if (!(std::abs(colour.mean) + spread <= kLargestColour)) {
      colour.slope = {};
      colour.half_width = colour.along = 0;
      colour.mean = std::clamp(colour.mean, -kLargestColour, kLargestColour);
    }
    return colour;
  }

  static constexpr auto kSupport = static_cast<float>(kKernelSupport);
  // Painters compute places in the table and depths in float. Beyond these limits that gives infinities,
  // whose difference is NaN. A splat beyond them is drawn flat, with a scalar far outside of the table.
  static constexpr float kLargestCells = 1e30f, kMinScale = 1e-7f, kLargestAmplitude = 1e30f,
                         kLargestColour = 1e22f;

  const ClassificationTable& table_;
  const float width_, height_;
  const float reach_;
  const float largest_scalar_;
  const bool per_pixel_, lit_;
  std::vector<ScreenSplat>& splats_;
  std::vector<float>& depths_;
};

/// The place of a splat among the layers of a picture: in front of all that its pixels have, behind opaque
/// ones, or somewhere where it has to be cut.
enum class LayerSide : uint8_t { kBefore, kAcross, kBehind };

/// A picture's layers as a brick's splats ask for them. Immutable.
class LocalLayers {
 public:
  /// `layers`: null where there are none. Depths are counted from `origin` where the view is orthographic.
  LocalLayers(const PixelLayers* layers, const ScreenView& view, const glm::dvec3& origin) : layers_(layers) {
    if (layers && view.projection == Projection::kOrthographic)
      offset_ = static_cast<float>(view.viewFromData(origin).z - layers->depthOrigin());
  }

  bool empty() const { return !layers_; }
  /// A projected splat's depth, as layers have it.
  float depthOf(float depth) const { return depth + offset_; }

  LayerSide sideOf(float x, float y, const Ellipse& e, float depth, const glm::vec3& depth_row,
                   const Shape& s) const {
    constexpr auto kSupport = static_cast<float>(kKernelSupport);
    const glm::vec3 q(s.axis0 * (depth_row.x + depth_row.y * s.shear10 + depth_row.z * s.shear20),
                      s.axis1 * (depth_row.y + depth_row.z * s.shear21), s.axis2 * depth_row.z);
    const float reach = kDepthReach * glm::length(q);
    const float reach_x = kSupport * e.l11, reach_y = kSupport * (std::abs(e.l21) + e.l22);
    const PixelLayers::Bounds bounds =
        layers_->boundsOver({x - reach_x, y - reach_y, x + reach_x, y + reach_y});
    const float at = depthOf(depth);
    if (at + reach <= bounds.nearest) return LayerSide::kBefore;
    return at - reach >= bounds.hidden ? LayerSide::kBehind : LayerSide::kAcross;
  }

 private:
  const PixelLayers* layers_;
  float offset_ = 0;
};

/// The colours' scalar on the screen, in pictures of two scalars, for a piece that has it as its scalar.
/// `faces`, `across`: what cuts the piece.
template <typename Map>
ScreenColour colourOf(const Map& map, const PlacedPiece& at, const SplatPiece& piece, float variance,
                      bool faces, bool across) {
  Ellipse e = ellipseOf(at.rows, piece.shape, piece.slope, variance, piece.weight * at.volume, map.low_pass);
  e.along *= shareOfAlong(at.rows, piece, map.low_pass.footprint_px2);
  ScreenColour colour{piece.mean, {e.slope0, e.slope1}, e.half_width, 0, e.along};
  if (faces) {
    ScreenCut cut;
    cutAtFaces(at.rows, piece, e, map.low_pass.footprint_px2, cut);
    colour.correlation = cut.correlation;
    if (!across) colour.along = alongLeft(e, cut);
  }
  if (across)
    colour.correlation =
        depthAlongRay(at.rows, at.depth_row, at.depth, piece, e, map.low_pass.footprint_px2).correlation;
  return colour;
}

inline glm::dmat3 factorOf(const Shape& s) {
  return {s.axis0, s.axis0 * s.shear10, s.axis0 * s.shear20, 0, s.axis1, s.axis1 * s.shear21, 0, 0, s.axis2};
}

/// The piece with another scalar: that of `from`, from which it was cut.
inline SplatPiece withScalarOf(const SplatPiece& from, const SplatPiece& piece) {
  SplatPiece out = piece;
  out.mean = from.mean;
  out.slope = from.slope;
  if (piece.position == from.position && std::memcmp(&piece.shape, &from.shape, sizeof(Shape)) == 0)
    return out;
  const glm::dmat3 factor = factorOf(from.shape), inverse = glm::inverse(factor);
  const glm::dvec3 slope(from.slope.w0, from.slope.w1, from.slope.w2);
  const glm::dvec3 moved = inverse * glm::dvec3(piece.position - from.position);
  out.mean = static_cast<float>(from.mean + glm::dot(slope, moved));
  const glm::dvec3 along = glm::transpose(inverse * factorOf(piece.shape)) * slope;
  out.slope = {static_cast<float>(along.x), static_cast<float>(along.y), static_cast<float>(along.z)};
  return out;
}

/// The scalar of the colours of a splat that is drawn as it is.
template <typename Map>
ScreenColour colourOf(const Map& map, const GeometryArrays<const float>& geometry,
                      const VariableArrays<const float>& colours, size_t i) {
  const Ellipse e = ellipseOf(rowsAt(map, geometry.x[i], geometry.y[i], geometry.z[i]), shapeOf(geometry, i),
                              slopeOf(colours, i), colours.variance[i], geometry.weight[i], map.low_pass);
  return {colours.mean[i], {e.slope0, e.slope1}, e.half_width, 0, e.along};
}

}  // namespace curvisplat
