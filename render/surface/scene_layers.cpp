// The layers of a picture, tile by tile of samples and row by row: SampledLayers makes those of triangles
// from the samples of pixels, PixelSlices those of slices; iso_layers.h has found those of isosurfaces.
#include "render/surface/scene_layers.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "render/project/pixel_layers.h"
#include "render/surface/rasterizer.h"
#include "render/surface/scene_triangles.h"
#include "render/surface/surface_shader.h"

namespace curvisplat {
namespace {

// Samples of one surface belong to one layer if their depths differ by no more than its slope explains, and
// by no more than this many pixels.
constexpr double kSteepest = 4, kNear = 0.25;

/// The layers that the samples of a row of pixels make, from the nearest on.
///
/// Samples of a pixel whose depths hardly differ are one layer. Its triangles are shaded in the middle of
/// their samples: one for those that share a vertex, up to three that do not. The pixels of a row are
/// collected and then shaded together. One thread at a time. Keeps its memory.
class SampledLayers {
 public:
  /// Both outlive it.
  SampledLayers(const SceneTriangles& triangles, const SurfaceShader& shader);

  /// Whether what lies behind a surface may be seen through it.
  bool hasTranslucent() const { return has_translucent_; }

  void clear();
  /// Adds the layers of a pixel's samples. `hidden`: the samples behind something opaque, which are left
  /// out; adds to it.
  void append(const PixelSamples& samples, int x, int y, unsigned& hidden);
  /// Ends a pixel: what is appended next is the next one's.
  void endPixel() { ends_.push_back(unshaded_.size()); }
  /// Shades all samples, after the last pixel.
  void shade();
  /// The layers of a pixel, in the order of append().
  std::span<const PixelLayer> at(size_t pixel) const {
    const size_t begin = pixel > 0 ? ends_[pixel - 1] : 0;
    return std::span(layers_).subspan(begin, ends_[pixel] - begin);
  }

 private:
  /// A sample that sees a triangle.
  struct Seen {
    float value;
    uint32_t number, place;

    bool operator<(const Seen& other) const {
      return value < other.value || (value == other.value && number < other.number);
    }
  };
  struct Unshaded {
    size_t first_spot, spots;
    float x, y;  // the pixel's middle
    float part;  // of the pixel, that it covers
    float depth;
  };

  static std::array<Seen, kSamples> sortedOf(const std::array<Seen, kSamples>& seen, size_t count);
  size_t endOfLayer(const std::array<Seen, kSamples>& seen, size_t begin, size_t count) const;
  void appendLayer(std::span<const Seen> seen, int x, int y, size_t& left, unsigned& hidden);
  size_t appendSpots(std::span<const Seen> seen, float middle_x, float middle_y);
  double pixelOf(float value) const;
  /// An upper bound of toleranceOf(), which takes longer.
  static double mostTolerance(double pixel) { return kSteepest * pixel + kNear * pixel; }
  double toleranceOf(const Seen& sample) const;
  void shadeBlock(size_t first, size_t count);

  const SceneTriangles& triangles_;
  const SurfaceShader& shader_;
  const bool has_translucent_;
  std::vector<SurfaceShader::Spot> spots_;
  std::vector<float> samples_;                // [spots]: how many each stands for
  std::vector<SurfaceShader::Point> points_;  // [spots]
  std::vector<Unshaded> unshaded_;
  std::vector<PixelLayer> layers_;  // [unshaded]
  std::vector<size_t> ends_;        // [pixels]
};

constexpr size_t kMaxShaded = 3;  // of a pixel and layer: triangles that do not meet
constexpr float kSmooth = 0.97f;  // of the cosine between normals: what is in a pixel is lit once

bool hasTranslucentSheet(const SceneTriangles& triangles) {
  for (size_t n = 0; n < triangles.sheets(); ++n)
    if (!triangles.isOpaque(n)) return true;
  return false;
}

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
  if (spread <= kNear * pixel || (spread <= mostTolerance(pixel) && spread <= toleranceOf(seen[nearest]))) {
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
    if (gap <= kNear * pixelOf(seen[end].value)) continue;  // whatever the slope
    if (gap > most) break;                                  // whatever the slope
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
  return std::min(double{shader_.steepness(sample.number)}, kSteepest * pixel) + kNear * pixel;
}

/// The layers that slices make of a pixel.
class PixelSlices {
 public:
  PixelSlices(const SurfaceScene& scene, const ScreenView& view,
              std::span<const std::unique_ptr<SliceSampler>> slices, const SceneLook& look)
      : scene_(scene), view_(view), slices_(slices), look_(look) {}

  bool empty() const { return slices_.empty(); }

  void append(int x, int y, std::vector<PixelLayer>& layers) const {
    for (size_t n = 0; n < slices_.size(); ++n) {
      const auto& slice = slices_[n];
      const auto sample = slice->at(x, y, look_.depth_origin);
      if (!sample) continue;
      const double pixel = pixelSide(view_, view_.viewFromData(sample->at).z);
      const float alpha = sample->coverage * leftOf(n, sample->at, pixel) *
                          static_cast<float>(scene_.slice_opacity) * opacityOf(n, *sample, x, y);
      const glm::vec3 colour = look_.colours.at(sample->scalar);  // unlit: to be compared with the scalar bar
      layers.push_back({sample->depth, glm::vec4(alpha * colour, alpha), static_cast<float>(sample->scalar)});
    }
  }

 private:
  /// The share of a slice at a point that clip planes leave. They keep what lies in them: a slice in a clip
  /// plane shows the cut, and coverageAt() would leave half of it.
  float leftOf(size_t slice, const glm::dvec3& at, double pixel) const {
    constexpr double kParallel = 1e-6, kInPlane = 0.01;  // of an angle; pixels
    const glm::dvec3 normal = glm::normalize(scene_.slices[slice].normal);
    float left = 1;
    for (const ClipPlane& plane : look_.clip_planes) {
      const glm::dvec3 inwards = glm::normalize(plane.normal);
      if (glm::length(glm::cross(normal, inwards)) > kParallel)
        left *= coverageAt(std::span(&plane, 1), at, pixel);
      else if (glm::dot(inwards, at - plane.point) < -kInPlane * pixel)
        return 0;
    }
    return left;
  }

  /// The opacity by the function.
  float opacityOf(size_t slice, const SliceSampler::Sample& sample, int x, int y) const {
    if (!scene_.slices_by_function || !look_.opacities) return 1;
    if (look_.opacity_slices.empty()) return look_.opacities->opacityAt(sample.scalar);
    const auto other = look_.opacity_slices[slice]->at(x, y, look_.depth_origin);
    return other ? look_.opacities->opacityAt(other->scalar) : 0;
  }

  const SurfaceScene& scene_;
  const ScreenView& view_;
  const std::span<const std::unique_ptr<SliceSampler>> slices_;
  const SceneLook& look_;
};

/// Appends layers of the pixel, in the shadows of the volume.
void appendShadowed(std::span<const PixelLayer> layers, const SceneLook& look, const ScreenView& view,
                    const glm::dvec2& pixel, std::vector<PixelLayer>& out) {
  const size_t before = out.size();
  out.insert(out.end(), layers.begin(), layers.end());
  if (!look.shadows) return;
  const bool perspective = view.projection == Projection::kPerspective;
  const glm::dvec2 across = (pixel - 0.5 * glm::dvec2(view.size.width, view.size.height)) / view.focal_px;
  const glm::dvec3 beside = across.x * view.right + across.y * view.down;
  for (size_t n = before; n < out.size(); ++n) {
    const double depth = double{out[n].depth} + look.depth_origin;
    const glm::dvec3 from_eye =
        perspective ? depth * glm::normalize(beside + view.forward) : beside + depth * view.forward;
    const float arriving = look.shadows->at((view.eye + from_eye) / view.scale);
    out[n].colour = glm::vec4(arriving * glm::vec3(out[n].colour), out[n].colour.w);
  }
}

}  // namespace

PixelLayers layersOf(const SurfaceScene& scene, const ScreenView& view,
                     std::span<const std::unique_ptr<SliceSampler>> slices, const SceneLook& look,
                     ScreenVertices* memory) {
  SceneTriangles triangles(scene, view, look.depth_origin,
                           memory ? std::exchange(*memory, {}) : ScreenVertices());
  const TriangleBins bins(triangles);
  const SurfaceShader shader(triangles, {look.colours, look.opacities, look.isovalues}, look.light);
  const PixelSlices pixel_slices(scene, view, slices, look);
  const auto columns = static_cast<size_t>(bins.columns());
  std::vector<PixelLayers::Row> rows(columns * static_cast<size_t>(view.size.height));
  // One tile after the other: what is seen first, and through it, what lies behind.
  struct OfThread {
    std::vector<SampleTile> tiles;
    SampledLayers sampled;
  };
  tbb::enumerable_thread_specific<OfThread> of_threads([&] {
    return OfThread{{}, SampledLayers(triangles, shader)};
  });
  tbb::parallel_for(size_t{0}, columns * static_cast<size_t>(bins.rows()), [&](size_t number) {
    auto& [tiles, sampled] = of_threads.local();
    tiles.resize(sampled.hasTranslucent() ? kMaxPeels : 1);
    const auto column = static_cast<int>(number % columns), row = static_cast<int>(number / columns);
    size_t drawn = 0;
    while (drawn < tiles.size() &&
           tiles[drawn].draw(triangles, bins, column, row, drawn > 0 ? &tiles[drawn - 1] : nullptr,
                             look.throw_if_stopped))
      ++drawn;
    const SampleTile& tile = tiles.front();
    for (int y = tile.y0(); y <= tile.y1(); ++y) {
      PixelLayers::Row& out = rows[static_cast<size_t>(y) * columns + number % columns];
      const auto width = static_cast<size_t>(tile.x1() - tile.x0() + 1);
      if (drawn == 0 && pixel_slices.empty() && look.isosurfaces.empty()) {
        out.counts.assign(width, 0);
        continue;
      }
      out.counts.reserve(width);
      out.layers.reserve(width);
      sampled.clear();
      for (int x = tile.x0(); x <= tile.x1(); ++x) {
        unsigned hidden = 0;  // bits of samples
        for (size_t n = 0; n < drawn; ++n) sampled.append(tiles[n].at(x, y), x, y, hidden);
        sampled.endPixel();
      }
      sampled.shade();
      for (int x = tile.x0(); x <= tile.x1(); ++x) {
        const size_t before = out.layers.size();
        const auto of_samples = sampled.at(static_cast<size_t>(x - tile.x0()));
        appendShadowed(of_samples, look, view, {x + 0.5, y + 0.5}, out.layers);
        pixel_slices.append(x, y, out.layers);
        for (const IsoLayers& isosurfaces : look.isosurfaces)
          appendShadowed(isosurfaces.at(x, y), look, view, {x + 0.5, y + 0.5}, out.layers);
        out.endPixel(before);
      }
    }
  });
  if (memory) *memory = triangles.takeMemory();
  return {view.size, std::move(rows), look.depth_origin};
}

}  // namespace curvisplat
