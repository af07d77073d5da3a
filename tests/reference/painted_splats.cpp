#include "tests/reference/painted_splats.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>

#include "render/project/footprint_skew.h"
#include "render/project/light.h"

namespace curvisplat {

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
                      slope * around(random), 0.2f * unit(random), 0});
  }
  // Half of them skewed, without a change to the numbers above.
  for (size_t n = 0; n < splats.size(); n += 2) {
    FootprintSkew skew;
    for (float& t : skew.t) t = 0.4f * around(random);
    splats[n].skew = skew.pack();
  }
  return splats;
}

std::vector<uint32_t> farthestFirst(std::span<const float> depths) {
  std::vector<uint32_t> order(depths.size());
  std::iota(order.rbegin(), order.rend(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return depths[a] > depths[b]; });
  return order;
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
  if (painter.order() == DrawingOrder::kFrontToBack) std::reverse(ordered.begin(), ordered.end());
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
