#include "tests/reference/splat_compositor.h"

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "render/project/footprint.h"
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

/// The remainder along the ray at u; `mean` and `variance` of its depths.
struct Remainder {
  double share = 1, mean = 0, variance = 1;
};

/// A window of depth, in the depths of layers.
struct DepthWindow {
  double nearer = -INFINITY, farther = INFINITY;
};

struct Cuts {
  std::optional<ScreenCut> cut;
  std::optional<ScreenDepth> depth;
  DepthWindow window = {};
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

/// F(rho) (render/project/footprint.h) of the square of rho, to 4e-8: each quadrature takes a microsecond.
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

/// How much nearer than its middle a splat is seen, in half widths of its depths, and which part of their variance is
/// seen: DESIGN.md, "What a splat hides of itself".
struct NearSide {
  double nearer = 0, variance = 1;

  explicit NearSide(double tau) {
    if (tau < 1e-3) return;  // the difference of large numbers
    const double x = tau / 2;
    nearer = 1 / std::tanh(x) - 1 / x;
    variance = 3 * (1 / (x * x) - 1 / std::pow(std::sinh(x), 2));
  }
};

/// The depth of a splat's cell along the ray: its amplitude without the low-pass.
double cellDepth(const ScreenSplat& splat, double low_pass) {
  const double l11 = splat.l11, l21 = splat.l21, l22 = splat.l22, whole = l11 * l22;
  const double determinant =
      (l11 * l11 - low_pass) * (l21 * l21 + l22 * l22 - low_pass) - std::pow(l11 * l21, 2);
  return std::abs(splat.amplitude) * whole / std::sqrt(std::max(determinant, 1e-4 * whole * whole));
}

/// The share of one splat at a place of its footprint, premultiplied.
glm::dvec4 contribution(const ScreenSplat& splat, const Cuts& cuts, const glm::dvec2& at,
                        const ClassificationTable& table, PixelShading shading) {
  const double u0 = at.x, u1 = at.y;
  const Remainder left = cuts.cut || cuts.depth ? remainderOf(cuts, u0, u1) : Remainder{};
  const double skew = FootprintSkew::unpack(splat.skew).at(u0, u1);
  const double depth = std::abs(splat.amplitude) * footprintOfSquare(u0 * u0 + u1 * u1) * skew * left.share;
  if (depth == 0) return glm::dvec4(0.0);
  const float widest = shading.lit ? unpackHalfWidth(splat.half_width) : splat.half_width;
  const Lit lit = shading.lit ? unpackLit(splat.half_width) : Lit{};
  // Between layers: by what is left there.
  const double hides = cuts.depth ? std::sqrt(std::max(0.0, left.variance)) : 1,
               of_depth = cuts.depth ? left.share : 1;
  const auto meanOf = [&](const ClassificationTable& of, const ScreenColour& scalar, const NearSide& seen) {
    if (!shading.per_pixel) return of.mean(scalar.mean, 0);
    const double w = scalar.half_width, deviation = scalar.correlation * w / std::sqrt(3.0);
    return of.mean(scalar.mean + double{scalar.slope[0]} * u0 + double{scalar.slope[1]} * u1 +
                       deviation * left.mean - std::sqrt(3.0) * hides * scalar.along * seen.nearer,
                   std::sqrt(std::max(0.0, w * w - 3 * deviation * deviation * (1 - left.variance) -
                                               3 * std::pow(hides * scalar.along, 2) * (1 - seen.variance))));
  };
  const ScreenColour own{
      splat.mean, {splat.slope0, splat.slope1}, widest, static_cast<float>(cuts.correlation()), splat.along};
  glm::dvec4 mean = meanOf(table, own, NearSide(0));
  if (mean.w == 0) return glm::dvec4(0.0);
  const NearSide seen(mean.w * of_depth * cellDepth(splat, shading.low_pass_px2));
  if (cuts.colour) {
    const glm::dvec3 colour(meanOf(*shading.colours, ScreenColour::of(*cuts.colour), seen));
    mean = glm::dvec4(mean.w * colour, mean.w);
  } else if (const glm::dvec4 nearer = meanOf(table, own, seen); nearer.w > 0) {
    mean = glm::dvec4(mean.w / nearer.w * glm::dvec3(nearer), mean.w);
  }
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
        const DepthWindow depths{window > 0 ? double{layers[window - 1].depth} : -INFINITY,
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

ClassificationTable lively(bool log_scale) {
  return {
      [](double f) {
        return TransferFunction::Value{{f, 0.5 + 0.5 * std::sin(9 * f), 1 - f}, f > 0.6 ? 8.0 : 2 * f * f};
      },
      log_scale ? 0.01 : 0.0, 1.0, log_scale};
}

ClassificationTable smooth(bool log_scale) {
  return {[](double f) {
            return TransferFunction::Value{{f, 0.5 + 0.5 * std::sin(4 * f), 1 - f}, 2 * f};
          },
          log_scale ? 0.01 : 0.0, 1.0, log_scale};
}

std::vector<ScreenSplat> randomSplats(int count, uint32_t seed, ImageSize size, float slope, float opacity) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  const auto width = static_cast<float>(size.width), height = static_cast<float>(size.height);
  std::vector<ScreenSplat> splats;
  for (int n = 0; n < count; ++n) {
    float l11 = 1.3f + 12 * unit(random) * unit(random), l22 = 1.3f + 3 * unit(random);
    float l21 = 3 * l11 * around(random);
    if (n % 29 == 0) l11 *= 20, l22 *= 20, l21 *= 20;
    if (n % 31 == 0) l11 = 0.1f, l21 = 0.3f * around(random), l22 = 0.2f;
    splats.push_back({width * (1.4f * unit(random) - 0.2f), height * (1.4f * unit(random) - 0.2f), l11, l21,
                      l22, opacity * unit(random), 1.4f * unit(random) - 0.2f, slope * around(random),
                      slope * around(random), 0.2f * unit(random), 0, 0, 0, 0, 0, 0});
  }
  // Half of them skewed, without a change to the numbers above.
  for (size_t n = 0; n < splats.size(); n += 2) {
    FootprintSkew skew;
    for (float& t : skew.t) t = 0.4f * around(random);
    splats[n].skew = skew.pack();
  }
  return splats;
}

std::vector<ScreenSplat> cutSome(const std::vector<ScreenSplat>& splats, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> around(-1, 1);
  std::vector<ScreenSplat> out;
  for (size_t n = 0; n < splats.size(); ++n) {
    out.push_back(splats[n]);
    if (n % 3 != 0) continue;
    out.back().amplitude *= -1;
    ScreenCut cut;
    for (size_t face = 0; face < 1 + random() % ScreenCut::kFaces; ++face) {
      const float steep = face == 0 && n % 2 == 0 ? 20.0f : 2.0f;
      cut.faces[face] = {2 * around(random), steep * around(random), steep * around(random)};
    }
    cut.far_sides = random() % 8;
    cut.correlation = around(random);
    if (n % 9 == 0) cut.correlation = 0;  // as cells at borders have it
    out.push_back(cut.record());
  }
  return out;
}

std::vector<ScreenSplat> placeSome(const std::vector<ScreenSplat>& splats, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  std::vector<ScreenSplat> out;
  for (size_t n = 0; n < splats.size(); ++n) {
    if (isRecord(splats[n])) continue;
    out.push_back(splats[n]);
    const bool is_cut = hasCut(splats[n]);
    if (n % 3 != 2) {
      out.back().amplitude = -std::abs(out.back().amplitude);
      const float size = n % 4 == 0 ? 1e-4f : 0.3f;
      out.push_back(ScreenDepth{unit(random),
                                {size * around(random), size * around(random)},
                                1 / (size * (0.1f + unit(random))),
                                around(random),
                                is_cut}
                        .record());
    }
    if (is_cut) out.push_back(splats[n + 1]);
  }
  return out;
}

PixelLayers randomLayers(ImageSize size, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<PixelLayers::Row> rows(static_cast<size_t>(size.height));
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      PixelLayers::Row& row = rows[static_cast<size_t>(y)];
      const size_t first = row.layers.size();
      const bool none = x / 32 == 1 && y / 32 == 0;
      for (size_t n = none ? 0 : random() % 6; n > 0; --n) {
        const float alpha = random() % 4 == 0 ? 1.0f : unit(random);
        row.layers.push_back({unit(random), glm::vec4(unit(random), unit(random), unit(random), 1) * alpha});
      }
      row.endPixel(first);
    }
  return {size, std::move(rows), 0};
}

std::vector<ScreenSplat> lit(std::vector<ScreenSplat> splats, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  for (ScreenSplat& splat : splats)
    if (!isRecord(splat)) splat.half_width = packLit(splat.half_width, {unit(random), 0.5f * unit(random)});
  return splats;
}

std::vector<ScreenSplat> hidingSome(std::vector<ScreenSplat> splats, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  for (size_t n = 0; n < splats.size(); ++n) {
    ScreenSplat& splat = splats[n];
    if (isRecord(splat) || n % 4 == 3) continue;
    splat.amplitude *= 20 * unit(random);
    splat.half_width += 0.1f;
    splat.along = splat.half_width * around(random) / std::sqrt(3.0f);
  }
  return splats;
}

std::vector<ScreenSplat> colourAll(const std::vector<ScreenSplat>& splats, uint32_t seed, float slope) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  std::vector<ScreenSplat> out;
  for (const ScreenSplat& splat : splats) {
    out.push_back(splat);
    if (isRecord(splat)) continue;
    const float correlation = around(random);
    out.push_back(ScreenColour{1.4f * unit(random) - 0.2f,
                               {slope * around(random), slope * around(random)},
                               0.2f * unit(random),
                               correlation}
                      .record());
  }
  return out;
}

Image paintFrame(Painter& painter, std::span<const ScreenSplat> splats, const ClassificationTable& table,
                 PixelShading shading, const EmptyPicture& empty, const PaintResources& resources) {
  std::vector<ScreenSplat> ordered(splats.begin(), splats.end());
  std::reverse(ordered.begin(), ordered.end());
  painter.begin(empty.size, empty.background, table, shading, resources);
  painter.draw(ordered);
  return painter.end();
}

double largestDifference(const Image& a, const Image& b) {
  double largest = 0;
  for (size_t n = 0; n < a.rgba.size(); ++n) {
    if (!std::isfinite(a.rgba[n])) return INFINITY;
    largest = std::max<double>(largest, std::abs(a.rgba[n] - b.rgba[n]));
  }
  return largest;
}

}  // namespace curvisplat
