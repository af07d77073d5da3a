#include "render/surface/sampled_layers.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <utility>

namespace curvisplat {
namespace {

// Samples of one surface belong to one layer if their depths differ by no more than its slope explains, and
// by no more than this many pixels.
constexpr double kSteepest = 4, kNearPx = 0.25;
constexpr size_t kMaxShaded = 3;  // of a pixel and layer: triangles that do not meet
constexpr float kSmooth = 0.97f;  // of the cosine between normals: what is in a pixel is lit once

bool hasTranslucentSheet(const SceneTriangles& triangles) {
  for (size_t n = 0; n < triangles.sheets(); ++n)
    if (!triangles.isOpaque(n)) return true;
  return false;
}

/// An upper bound of SampledLayers::toleranceOf(), which takes longer.
double mostTolerance(double pixel) {
  return kSteepest * pixel + kNearPx * pixel;
}

}  // namespace

SampledLayers::SampledLayers(const SceneTriangles& triangles, const SurfaceShader& shader)
    : triangles_(triangles), shader_(shader), has_translucent_(hasTranslucentSheet(triangles)) {}

void SampledLayers::clear() {
  spots_.clear();
  samples_.clear();
  unshaded_.clear();
  ends_.clear();
}

void SampledLayers::append(const PixelSamples& samples, int x, int y, unsigned& hidden) {
  std::array<Seen, kSamples> seen;
  size_t count = 0, nearest = 0;
  float farthest = -INFINITY;
  for (size_t n = 0; n < kSamples; ++n) {
    if (samples.numbers[n] == PixelSamples::kNothing || (hidden >> n & 1) != 0) continue;
    seen[count] = {samples.values[n], samples.numbers[n], static_cast<uint32_t>(n)};
    if (seen[count] < seen[nearest]) nearest = count;
    farthest = std::max(farthest, samples.values[n]);
    ++count;
  }
  if (count == 0) return;
  size_t left = hidden == 0 ? kSamples : kSamples - static_cast<size_t>(std::popcount(hidden));
  // Most pixels have one layer: its samples need not be in order.
  const double spread = double{farthest} - double{seen[nearest].value};
  const double pixel = pixelOf(seen[nearest].value);
  if (spread <= kNearPx * pixel || (spread <= mostTolerance(pixel) && spread <= toleranceOf(seen[nearest]))) {
    appendLayer(std::span(seen).first(count), x, y, left, hidden);
    return;
  }
  const std::array<Seen, kSamples> sorted = sortedOf(seen, count);
  for (size_t begin = 0; begin < count;) {
    const size_t end = endOfLayer(sorted, begin, count);
    appendLayer(std::span(sorted).subspan(begin, end - begin), x, y, left, hidden);
    begin = end;
  }
}

/// The first `count` in their order, by a network of comparisons, which no branch can predict.
std::array<SampledLayers::Seen, kSamples> SampledLayers::sortedOf(const std::array<Seen, kSamples>& seen,
                                                                  size_t count) {
  std::array<uint64_t, kSamples> keys;
  std::array<uint32_t, kSamples> from;
  keys.fill(UINT64_MAX);
  for (uint32_t n = 0; n < kSamples; ++n) from[n] = n;
  for (size_t n = 0; n < count; ++n) {
    // Keys are unsigned integers in the order of the values; adding 0 makes both zeros the same.
    const auto bits = std::bit_cast<uint32_t>(seen[n].value + 0.0f);
    const uint32_t turned = bits ^ ((bits >> 31) != 0 ? 0xffffffffu : 0x80000000u);
    keys[n] = uint64_t{turned} << 32 | seen[n].number;
  }
  const auto exchange = [&](size_t a, size_t b) {
    const bool turns = keys[b] < keys[a];
    const uint64_t low = turns ? keys[b] : keys[a], high = turns ? keys[a] : keys[b];
    const uint32_t of_low = turns ? from[b] : from[a], of_high = turns ? from[a] : from[b];
    keys[a] = low;
    keys[b] = high;
    from[a] = of_low;
    from[b] = of_high;
  };
  static_assert(kSamples == 8);
  constexpr uint8_t kNetwork[][2] = {{0, 2}, {1, 3}, {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6},
                                     {3, 7}, {0, 1}, {2, 3}, {4, 5}, {6, 7}, {2, 4}, {3, 5},
                                     {1, 4}, {3, 6}, {1, 2}, {3, 4}, {5, 6}};
  // Unrolled, so that keys stay in registers.
  [&]<size_t... kAt>(std::index_sequence<kAt...>) {
    (exchange(kNetwork[kAt][0], kNetwork[kAt][1]), ...);
  }
  (std::make_index_sequence<std::size(kNetwork)>());
  std::array<Seen, kSamples> sorted;
  for (size_t n = 0; n < count; ++n) sorted[n] = seen[from[n]];
  return sorted;
}

/// The first of the sorted samples that is not of the layer that begins at `begin`.
size_t SampledLayers::endOfLayer(const std::array<Seen, kSamples>& seen, size_t begin, size_t count) const {
  const double most = mostTolerance(pixelOf(seen[begin].value));  // farther ones have smaller pixels
  double tolerance = 0;
  size_t known = begin;  // the samples before it are in the tolerance
  size_t end = begin + 1;
  for (; end < count; ++end) {
    const double gap = double{seen[end].value} - double{seen[end - 1].value};
    if (gap <= kNearPx * pixelOf(seen[end].value)) continue;  // whatever the slope
    if (gap > most) break;                                    // whatever the slope
    for (; known <= end; ++known)
      if (known == begin || seen[known].number != seen[known - 1].number)
        tolerance = std::max(tolerance, toleranceOf(seen[known]));
    if (gap > tolerance) break;
  }
  return end;
}

/// Appends the samples of one layer. `left`: samples that nothing opaque has hidden so far.
void SampledLayers::appendLayer(std::span<const Seen> seen, int x, int y, size_t& left, unsigned& hidden) {
  size_t opaque = seen.size();
  if (has_translucent_) {
    opaque = 0;
    for (const Seen& sample : seen)
      if (shader_.isOpaque(sample.number)) {
        ++opaque;
        hidden |= 1u << sample.place;
      }
  }
  // Opaque ones hide what is left; translucent ones cover their part of the pixel.
  const float part =
      static_cast<float>(seen.size()) / static_cast<float>(opaque == seen.size() ? left : kSamples);
  left -= opaque;
  double value = 0;
  for (const Seen& sample : seen) value += double{sample.value};
  const float middle_x = static_cast<float>(x) + 0.5f, middle_y = static_cast<float>(y) + 0.5f;
  const size_t first = spots_.size();
  unshaded_.push_back(
      {first, appendSpots(seen, middle_x, middle_y), middle_x, middle_y, part,
       triangles_.depthOf(static_cast<float>(value / static_cast<double>(seen.size())), middle_x, middle_y)});
}

/// The spots where the triangles of a layer are shaded: those that meet an earlier one with it, in the middle
/// of all their samples.
size_t SampledLayers::appendSpots(std::span<const Seen> seen, float middle_x, float middle_y) {
  struct Part {
    uint32_t number, last;  // the first triangle, and the last that was taken
    float x, y, count;
  };
  std::array<Part, kMaxShaded> parts;
  size_t count = 0;
  for (const Seen& sample : seen) {
    size_t n = 0;
    while (n < count && parts[n].number != sample.number && parts[n].last != sample.number) ++n;
    if (n == count) {
      n = 0;
      while (n < count && !shader_.meet(parts[n].number, sample.number)) ++n;
      if (n == kMaxShaded) continue;
      if (n == count) parts[count++] = {sample.number, sample.number, 0, 0, 0};
      parts[n].last = sample.number;
    }
    parts[n].x += static_cast<float>(kSampleOffsets[sample.place][0]);
    parts[n].y += static_cast<float>(kSampleOffsets[sample.place][1]);
    ++parts[n].count;
  }
  for (size_t n = 0; n < count; ++n) {
    const Part& part = parts[n];
    spots_.push_back(
        {part.number, middle_x + part.x / (16 * part.count), middle_y + part.y / (16 * part.count)});
    samples_.push_back(part.count);
  }
  return count;
}

void SampledLayers::shade() {
  points_.resize(spots_.size());
  shader_.shade(spots_, points_);
  layers_.resize(unshaded_.size());
  for (size_t first = 0; first < unshaded_.size(); first += LitPoints::kAtOnce)
    shadeBlock(first, std::min(LitPoints::kAtOnce, unshaded_.size() - first));
}

void SampledLayers::shadeBlock(size_t first, size_t count) {
  const auto put = [](const glm::vec3& value, size_t n, LitPoints::Vectors& to) {
    to[0][n] = value.x;
    to[1][n] = value.y;
    to[2][n] = value.z;
  };
  LitPoints lit;
  uint64_t rough = 0;  // bits of layers whose triangles are lit one by one
  static_assert(LitPoints::kAtOnce == 64);
  const bool perspective = triangles_.view().projection == Projection::kPerspective;
  glm::vec3 towards = towardsViewer(triangles_.view(), 0, 0);
  for (size_t n = 0; n < count; ++n) {
    const Unshaded& layer = unshaded_[first + n];
    if (perspective) towards = towardsViewer(triangles_.view(), layer.x, layer.y);
    SurfaceShader::Point mean;
    float shaded = 0;
    bool smooth = true;
    const glm::vec3 of_first = points_[layer.first_spot].normal;
    for (size_t spot = layer.first_spot; spot < layer.first_spot + layer.spots; ++spot) {
      SurfaceShader::Point& point = points_[spot];
      const float facing = glm::dot(point.normal, of_first);
      if (facing < 0) point.normal = -point.normal;
      smooth = smooth && std::abs(facing) > kSmooth;
      mean.colour += samples_[spot] * point.colour;
      mean.normal += samples_[spot] * point.normal;
      mean.opacity += samples_[spot] * point.opacity;
      mean.scalar += samples_[spot] * point.scalar;
      shaded += samples_[spot];
    }
    mean.colour /= shaded;
    const float alpha = has_translucent_ ? layer.part * mean.opacity / shaded : layer.part;
    layers_[first + n] = {layer.depth, glm::vec4(0, 0, 0, alpha), mean.scalar / shaded};
    put(mean.normal, n, lit.normal);
    put(towards, n, lit.towards_viewer);
    put(mean.colour, n, lit.colour);
    if (smooth) continue;
    rough |= uint64_t{1} << n;
    glm::vec3 colour(0.0f);
    for (size_t spot = layer.first_spot; spot < layer.first_spot + layer.spots; ++spot)
      colour +=
          samples_[spot] / shaded * shader_.light().lit(points_[spot].colour, points_[spot].normal, towards);
    layers_[first + n].colour = glm::vec4(alpha * colour, alpha);
  }
  shader_.light().light(lit, count);
  for (size_t n = 0; n < count; ++n) {
    glm::vec4& colour = layers_[first + n].colour;
    if ((rough >> n & 1) == 0)
      colour =
          glm::vec4(colour.w * glm::vec3(lit.colour[0][n], lit.colour[1][n], lit.colour[2][n]), colour.w);
  }
}

/// A pixel's size, in values: perspective, d(-1/z) = dz / z², and a pixel is z / focal.
double SampledLayers::pixelOf(float value) const {
  const ScreenView& view = triangles_.view();
  return view.projection == Projection::kPerspective ? std::abs(double{value}) / view.focal_px
                                                     : 1 / view.focal_px;
}

double SampledLayers::toleranceOf(const Seen& sample) const {
  const double pixel = pixelOf(sample.value);
  return std::min(double{shader_.steepness(sample.number)}, kSteepest * pixel) + kNearPx * pixel;
}

}  // namespace curvisplat
