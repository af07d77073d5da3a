#include "tests/reference/splat_compositor.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <optional>
#include <vector>

#include "render/project/footprint_skew.h"
#include "render/project/kernel.h"
#include "render/project/light.h"

namespace curvisplat {
namespace {

/// The integral of x^power b(x) up to x, b the biweight of ScreenCut: its antiderivative, from the middle on.
double biweight(int power, double x) {
  const double y = x / std::sqrt(7.0), y2 = y * y;
  switch (power) {
    case 0:
      return 15.0 / 16 * y * (1 - 2 * y2 / 3 + y2 * y2 / 5);
    case 1:
      return -5 * std::sqrt(7.0) / 32 * std::pow(1 - y2, 3);
    default:
      return 7 * 15.0 / 16 * y * y2 * (1.0 / 3 - 2 * y2 / 5 + y2 * y2 / 7);
  }
}

/// What is left along the ray at u; `mean` and `variance` of its depths.
struct Remainder {
  double share = 1, mean = 0, variance = 1;
};

/// A window of depth, in the depths of layers.
struct Window {
  double nearer = -INFINITY, farther = INFINITY;
};

struct Cuts {
  std::optional<ScreenCut> cut;
  std::optional<ScreenDepth> depth;
  Window window = {};
  const ScreenSplat* colour = nullptr;

  double correlation() const { return depth ? depth->correlation : cut ? cut->correlation : 0; }
};

Remainder remainderOf(const Cuts& cuts, double u0, double u1) {
  double lo = -std::sqrt(7.0), hi = std::sqrt(7.0);
  if (cuts.depth) {
    const double middle = cuts.depth->middle + cuts.depth->by[0] * u0 + cuts.depth->by[1] * u1;
    lo = std::clamp((cuts.window.nearer - middle) * cuts.depth->per_depth, lo, hi);
    hi = std::clamp((cuts.window.farther - middle) * cuts.depth->per_depth, lo, hi);
  }
  const ScreenCut cut = cuts.cut.value_or(ScreenCut{});
  for (size_t n = 0; n < ScreenCut::kFaces; ++n) {
    const double a = cut.faces[n][0] + cut.faces[n][1] * u0 + cut.faces[n][2] * u1;
    if (cut.far_sides >> n & 1)
      lo = std::max(lo, -a);
    else
      hi = std::min(hi, a);
  }
  Remainder left;
  if (!(lo < hi)) return {0, 0, 0};
  left.share = biweight(0, hi) - biweight(0, lo);
  left.mean = (biweight(1, hi) - biweight(1, lo)) / left.share;
  left.variance = (biweight(2, hi) - biweight(2, lo)) / left.share - left.mean * left.mean;
  return left;
}

/// F(rho) (render/project/kernel.h) of the square of rho, to 4e-8: each quadrature takes a microsecond.
double footprintOfSquare(double rho2) {
  constexpr int kSteps = 1 << 14;
  static const std::vector<double> table = footprintTable(kSteps);
  const double at = rho2 * (kSteps / (kKernelSupport * kKernelSupport));
  if (!(at < kSteps)) return 0;
  const auto step = static_cast<size_t>(at);
  return std::lerp(table[step], table[step + 1], at - static_cast<double>(step));
}

/// A pixel in the coordinates of a splat's footprint.
glm::dvec2 inFootprint(const ScreenSplat& splat, int x, int y) {
  const double u0 = (x + 0.5 - splat.x) / splat.l11;
  return {u0, (y + 0.5 - splat.y - splat.l21 * u0) / splat.l22};
}

/// What one splat adds at a place of its footprint, premultiplied.
glm::dvec4 contribution(const ScreenSplat& splat, const Cuts& cuts, const glm::dvec2& at,
                        const ClassificationTable& table, PixelShading shading) {
  const double u0 = at.x, u1 = at.y;
  const Remainder left = cuts.cut || cuts.depth ? remainderOf(cuts, u0, u1) : Remainder{};
  const double skew = FootprintSkew::unpack(splat.skew).at(u0, u1);
  const double depth = std::abs(splat.amplitude) * footprintOfSquare(u0 * u0 + u1 * u1) * skew * left.share;
  if (depth == 0) return glm::dvec4(0.0);
  const float widest = shading.lit ? unpackHalfWidth(splat.half_width) : splat.half_width;
  const Lit lit = shading.lit ? unpackLit(splat.half_width) : Lit{};
  const auto meanOf = [&](const ClassificationTable& of, const ScreenColour& scalar) {
    if (!shading.per_pixel) return of.mean(scalar.mean, 0);
    const double w = scalar.half_width, deviation = scalar.correlation * w / std::sqrt(3.0);
    return of.mean(
        scalar.mean + double{scalar.slope[0]} * u0 + double{scalar.slope[1]} * u1 + deviation * left.mean,
        std::sqrt(std::max(0.0, w * w - 3 * deviation * deviation * (1 - left.variance))));
  };
  glm::dvec4 mean = meanOf(
      table, {splat.mean, {splat.slope0, splat.slope1}, widest, static_cast<float>(cuts.correlation())});
  if (mean.w == 0) return glm::dvec4(0.0);
  if (cuts.colour)
    mean = glm::dvec4(mean.w * glm::dvec3(meanOf(*shading.colours, ScreenColour::of(*cuts.colour))), mean.w);
  const double alpha = -std::expm1(-mean.w * depth);
  const glm::dvec3 colour = double{lit.diffuse} * glm::dvec3(mean) / mean.w + double{lit.specular};
  return glm::dvec4(colour, 1.0) * alpha;
}

}  // namespace

Image compositeSplats(std::span<const ScreenSplat> splats, const ClassificationTable& table,
                      PixelShading shading, ImageSize size, const glm::vec4& background) {
  Image image(size);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      std::vector<PixelLayer> layers;
      if (shading.layers) layers.assign(shading.layers->at(x, y).begin(), shading.layers->at(x, y).end());
      glm::dvec4 pixel(background);
      for (size_t window = layers.size() + 1; window-- > 0;) {
        if (window < layers.size())
          pixel = glm::dvec4(layers[window].colour) + (1 - double{layers[window].colour.w}) * pixel;
        const Window depths{window > 0 ? double{layers[window - 1].depth} : -INFINITY,
                            window < layers.size() ? double{layers[window].depth} : INFINITY};
        for (size_t n = 0; n < splats.size(); ++n) {
          const ScreenSplat& splat = splats[n];
          if (isRecord(splat)) continue;
          const glm::dvec2 at = inFootprint(splat, x, y);
          if (glm::dot(at, at) >= kKernelSupport * kKernelSupport) continue;  // most splats
          Cuts cuts{{}, {}, depths};
          if (hasCut(splat) || shading.colours) {
            const SplatRecords records = SplatRecords::beside(&splat, 1, shading.colours != nullptr);
            if (records.cut) cuts.cut = ScreenCut::of(*records.cut);
            if (records.depth) cuts.depth = ScreenDepth::of(*records.depth);
            cuts.colour = records.colour;
          }
          if (!cuts.depth && window > 0) continue;
          const glm::dvec4 above = contribution(splat, cuts, at, table, shading);
          pixel = above + (1 - above.w) * pixel;
        }
      }
      for (int channel = 0; channel < 4; ++channel)
        image.pixel(x, y)[channel] = static_cast<float>(pixel[channel]);
    }
  return image;
}

}  // namespace curvisplat
