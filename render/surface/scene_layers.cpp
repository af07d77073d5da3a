#include "render/surface/scene_layers.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "render/surface/pixel_rays.h"
#include "render/surface/rasterizer.h"
#include "render/surface/surface_light.h"

namespace curvisplat {
namespace {

// Samples of one surface belong to one layer if their depths differ by no more than its slope explains, and by no
// more than this many pixels.
constexpr double kSteepest = 4, kNear = 0.25;
constexpr size_t kMaxShaded = 3;  // of a pixel and layer: triangles that do not meet
constexpr float kSmooth = 0.97f;  // of the cosine between normals: what is in a pixel is lit once

/// Colours of the surfaces' triangles at the pixels.
class Shader {
 public:
  Shader(const SceneTriangles& triangles, const SceneLook& look)
      : triangles_(triangles), look_(look), light_(look.light, triangles.view()) {}

  /// What light falls on.
  struct Point {
    glm::vec3 colour{0.0f}, normal{0.0f};
    float opacity = 0;
  };
  /// Of a triangle at a point of the picture.
  Point pointAt(uint32_t number, float x, float y) const {
    const auto [surface_number, triangle] = triangles_.placeOf(number);
    const Surface& surface = triangles_.scene().surfaces[surface_number];
    const TriangleMesh& mesh = *surface.mesh;
    const auto& corners = mesh.triangles[triangle];
    const glm::vec3 share = sharesAt(surface_number, corners, x, y);
    Point point{surface.colour, glm::vec3(0.0f), static_cast<float>(surface.opacity.factor)};
    const glm::vec3 first = mesh.normals[corners[0]];
    for (int n = 0; n < 3; ++n) {
      glm::vec3 of_corner = mesh.normals[corners[static_cast<size_t>(n)]];
      if (glm::dot(of_corner, first) < 0) of_corner = -of_corner;
      point.normal += share[n] * of_corner;
    }
    const auto valueOf = [&](const std::vector<float>& scalars) {
      return scalars.empty() ? NAN
                             : share.x * scalars[corners[0]] + share.y * scalars[corners[1]] +
                                   share.z * scalars[corners[2]];
    };
    const float scalar = surface.by_scalar ? valueOf(mesh.scalars) : NAN;
    const ColourTable& colours = surface.colours ? *surface.colours : look_.colours;
    if (!std::isnan(scalar)) point.colour = colours.at(double{scalar});
    if (!surface.opacity.by_function) return point;
    const bool has_other = !mesh.opacity_scalars.empty() && look_.opacities;
    const float of_opacity = has_other ? valueOf(mesh.opacity_scalars) : scalar;
    if (!std::isnan(of_opacity))
      point.opacity *= (has_other ? *look_.opacities : colours).opacityAt(double{of_opacity});
    return point;
  }
  bool isOpaque(uint32_t number) const {
    return triangles_.scene().surfaces[triangles_.placeOf(number).surface].opacity.opaque();
  }
  glm::vec3 lit(const Point& point, float x, float y) const {
    return light_.lit(point.colour, point.normal, towardsViewer(triangles_.view(), x, y));
  }

  /// Whether two triangles share a vertex. There a surface is smooth, since vertices are doubled at edges, and each of
  /// them tells what it looks like on the other.
  bool meet(uint32_t a, uint32_t b) const {
    const auto [surface, triangle] = triangles_.placeOf(a);
    const auto [other_surface, other_triangle] = triangles_.placeOf(b);
    if (surface != other_surface) return false;
    const TriangleMesh& mesh = *triangles_.scene().surfaces[surface].mesh;
    const auto &x = mesh.triangles[triangle], &y = mesh.triangles[other_triangle];
    bool any = false;
    for (size_t n = 0; n < 3; ++n) any |= (x[n] == y[0]) | (x[n] == y[1]) | (x[n] == y[2]);
    return any;
  }

  /// How much the depth changes over a pixel, at most.
  float steepness(uint32_t number) const {
    const auto [surface, triangle] = triangles_.placeOf(number);
    const auto& corners = triangles_.scene().surfaces[surface].mesh->triangles[triangle];
    const ScreenVertex &a = triangles_.vertex(surface, corners[0]),
                       &b = triangles_.vertex(surface, corners[1]),
                       &c = triangles_.vertex(surface, corners[2]);
    const float area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    const float by_x = (b.value - a.value) * (c.y - a.y) - (c.value - a.value) * (b.y - a.y);
    const float by_y = (c.value - a.value) * (b.x - a.x) - (b.value - a.value) * (c.x - a.x);
    const float steep = (std::abs(by_x) + std::abs(by_y)) / std::abs(area);
    return std::isfinite(steep) ? steep : 1e30f;
  }

 private:
  /// Barycentric, within the triangle; in perspective of the triangle in space.
  glm::vec3 sharesAt(size_t surface, const std::array<uint32_t, 3>& corners, float x, float y) const {
    const bool perspective = triangles_.view().projection == Projection::kPerspective;
    const ScreenVertex v[3] = {triangles_.vertex(surface, corners[0]), triangles_.vertex(surface, corners[1]),
                               triangles_.vertex(surface, corners[2])};
    const auto cross = [&](const ScreenVertex& a, const ScreenVertex& b) {
      return (a.x - x) * (b.y - y) - (a.y - y) * (b.x - x);
    };
    glm::vec3 share(cross(v[1], v[2]), cross(v[2], v[0]), cross(v[0], v[1]));
    if (share.x + share.y + share.z < 0) share = -share;
    share = glm::max(share, glm::vec3(0.0f));
    if (perspective) share *= glm::vec3(-v[0].value, -v[1].value, -v[2].value);
    const float sum = share.x + share.y + share.z;
    return sum > 0 && std::isfinite(sum) ? share / sum : glm::vec3(1.0f / 3);
  }

  const SceneTriangles& triangles_;
  const SceneLook& look_;
  const SurfaceLight light_;
};

/// The layers that a pixel's samples make.
class PixelSurfaces {
 public:
  PixelSurfaces(const SceneTriangles& triangles, const Shader& shader)
      : triangles_(triangles),
        shader_(shader),
        has_translucent_(std::any_of(triangles.scene().surfaces.begin(), triangles.scene().surfaces.end(),
                                     [](const Surface& surface) { return !surface.opacity.opaque(); })) {}

  /// Whether what lies behind a surface may be seen through it.
  bool hasTranslucent() const { return has_translucent_; }

  /// `hidden`: the samples behind something opaque, which are left out; adds to it.
  void append(const PixelSamples& samples, int x, int y, unsigned& hidden,
              std::vector<PixelLayer>& layers) const {
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
    size_t left = kSamples - static_cast<size_t>(std::popcount(hidden));
    // Most pixels have one layer: its samples need not be in order.
    const double spread = double{farthest} - double{seen[nearest].value};
    if (spread <= kNear * pixelOf(seen[nearest].value) || spread <= toleranceOf(seen[nearest])) {
      layers.push_back(layerOf(std::span(seen).first(count), x, y, left, hidden));
      return;
    }
    std::sort(seen.begin(), seen.begin() + static_cast<ptrdiff_t>(count));
    for (size_t begin = 0; begin < count;) {
      const size_t end = endOfLayer(seen, begin, count);
      layers.push_back(layerOf(std::span(seen).subspan(begin, end - begin), x, y, left, hidden));
      begin = end;
    }
  }

 private:
  /// A sample.
  struct Seen {
    float value;
    uint32_t number, place;

    bool operator<(const Seen& other) const {
      return value < other.value || (value == other.value && number < other.number);
    }
  };

  /// Of sorted samples, the first that is not of the layer that begins at `begin`.
  size_t endOfLayer(const std::array<Seen, kSamples>& seen, size_t begin, size_t count) const {
    double tolerance = 0;
    size_t known = begin;  // the samples before it are in the tolerance
    size_t end = begin + 1;
    for (; end < count; ++end) {
      const double gap = double{seen[end].value} - double{seen[end - 1].value};
      if (gap <= kNear * pixelOf(seen[end].value)) continue;  // whatever the slope
      for (; known <= end; ++known)
        if (known == begin || seen[known].number != seen[known - 1].number)
          tolerance = std::max(tolerance, toleranceOf(seen[known]));
      if (gap > tolerance) break;
    }
    return end;
  }

  /// Of the samples of one layer. `left`: samples that nothing opaque has hidden so far.
  PixelLayer layerOf(std::span<const Seen> seen, int x, int y, size_t& left, unsigned& hidden) const {
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
    const float part_of =
        static_cast<float>(seen.size()) / static_cast<float>(opaque == seen.size() ? left : kSamples);
    left -= opaque;
    // Samples whose triangles meet the first one's: this one is shaded in the middle of them all.
    struct Part {
      uint32_t number, last;  // the first triangle, and the last that was taken
      float x, y, count;
    };
    std::array<Part, kMaxShaded> parts;
    size_t count = 0;
    double value = 0;
    for (const Seen& sample : seen) {
      value += double{sample.value};
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
    const float middle_x = static_cast<float>(x) + 0.5f, middle_y = static_cast<float>(y) + 0.5f;
    std::array<Shader::Point, kMaxShaded> points;
    Shader::Point mean;
    float shaded = 0;
    bool smooth = true;
    for (size_t n = 0; n < count; ++n) {
      const Part& part = parts[n];
      points[n] = shader_.pointAt(part.number, middle_x + part.x / (16 * part.count),
                                  middle_y + part.y / (16 * part.count));
      const float facing = glm::dot(points[n].normal, points[0].normal);
      if (facing < 0) points[n].normal = -points[n].normal;
      smooth = smooth && std::abs(facing) > kSmooth;
      mean.colour += part.count * points[n].colour;
      mean.normal += part.count * points[n].normal;
      mean.opacity += part.count * points[n].opacity;
      shaded += part.count;
    }
    mean.colour /= shaded;
    const float alpha = has_translucent_ ? part_of * mean.opacity / shaded : part_of;
    glm::vec3 colour(0.0f);
    if (smooth)
      colour = shader_.lit(mean, middle_x, middle_y);
    else
      for (size_t n = 0; n < count; ++n)
        colour += parts[n].count / shaded * shader_.lit(points[n], middle_x, middle_y);
    return {
        triangles_.depthOf(static_cast<float>(value / static_cast<double>(seen.size())), middle_x, middle_y),
        glm::vec4(alpha * colour, alpha)};
  }

  /// A pixel's size, in values: perspective, d(-1/z) = dz / z², and a pixel is z / focal.
  double pixelOf(float value) const {
    const ScreenView& view = triangles_.view();
    return view.projection == Projection::kPerspective ? std::abs(double{value}) / view.focal_px
                                                       : 1 / view.focal_px;
  }
  double toleranceOf(const Seen& sample) const {
    const double pixel = pixelOf(sample.value);
    return std::min(double{shader_.steepness(sample.number)}, kSteepest * pixel) + kNear * pixel;
  }

  const SceneTriangles& triangles_;
  const Shader& shader_;
  const bool has_translucent_;
};

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
  /// What clip planes leave of a slice at a point. They keep what lies in them: a slice in a clip plane shows the cut, and
  /// coverageAt() would leave half of it.
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

  /// By the function.
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

}  // namespace

PixelLayers layersOf(const SurfaceScene& scene, const ScreenView& view,
                     std::span<const std::unique_ptr<SliceSampler>> slices, const SceneLook& look,
                     ScreenVertices* memory) {
  SceneTriangles triangles(scene, view, look.depth_origin,
                           memory ? std::exchange(*memory, {}) : ScreenVertices());
  const TriangleBins bins(triangles);
  const Shader shader(triangles, look);
  const PixelSurfaces pixel_surfaces(triangles, shader);
  const PixelSlices pixel_slices(scene, view, slices, look);
  const auto columns = static_cast<size_t>(bins.columns());
  std::vector<PixelLayers::Row> rows(columns * static_cast<size_t>(view.size.height));
  // One tile after the other: what is seen first, and through it, what lies behind.
  tbb::enumerable_thread_specific<std::vector<SampleTile>> tiles_of_threads;
  tbb::parallel_for(size_t{0}, columns * static_cast<size_t>(bins.rows()), [&](size_t number) {
    std::vector<SampleTile>& tiles = tiles_of_threads.local();
    tiles.resize(pixel_surfaces.hasTranslucent() ? PixelLayers::kMaxLayers : 1);
    const auto column = static_cast<int>(number % columns), row = static_cast<int>(number / columns);
    size_t drawn = 0;
    while (drawn < tiles.size() &&
           tiles[drawn].draw(triangles, bins, column, row, drawn > 0 ? &tiles[drawn - 1] : nullptr))
      ++drawn;
    const SampleTile& tile = tiles.front();
    for (int y = tile.y0(); y <= tile.y1(); ++y) {
      PixelLayers::Row& out = rows[static_cast<size_t>(y) * columns + number % columns];
      const auto width = static_cast<size_t>(tile.x1() - tile.x0() + 1);
      if (drawn == 0 && pixel_slices.empty() && !look.isosurfaces) {
        out.counts.assign(width, 0);
        continue;
      }
      out.counts.reserve(width);
      out.layers.reserve(width);
      for (int x = tile.x0(); x <= tile.x1(); ++x) {
        const size_t before = out.layers.size();
        unsigned hidden = 0;  // bits of samples
        for (size_t n = 0; n < drawn; ++n) pixel_surfaces.append(tiles[n].at(x, y), x, y, hidden, out.layers);
        pixel_slices.append(x, y, out.layers);
        if (look.isosurfaces) {
          const auto crossings = look.isosurfaces->at(x, y);
          out.layers.insert(out.layers.end(), crossings.begin(), crossings.end());
        }
        out.endPixel(before);
      }
    }
  });
  if (memory) *memory = triangles.takeMemory();
  return {view.size, std::move(rows), look.depth_origin};
}

}  // namespace curvisplat
