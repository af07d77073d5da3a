#include "render/surface/scene_layers.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "render/surface/rasterizer.h"
#include "render/surface/surface_light.h"

namespace curvisplat {
namespace {

// Samples of one surface belong to one layer if their depths differ by no more than its slope explains, and by no
// more than this many pixels.
constexpr double kSteepest = 4, kNear = 0.25;
constexpr int kMostShaded = 3;  // triangles of a pixel and layer

/// Colours of the surfaces' triangles at the pixels.
class Shader {
 public:
  Shader(const SceneTriangles& triangles, const SceneLook& look)
      : triangles_(triangles), look_(look), light_(look.light, triangles.view()) {}

  /// Of a triangle at a point of the picture.
  glm::vec3 colourAt(uint32_t number, float x, float y) const {
    const auto [surface_number, triangle] = triangles_.placeOf(number);
    const Surface& surface = triangles_.scene().surfaces[surface_number];
    const TriangleMesh& mesh = *surface.mesh;
    const auto& corners = mesh.triangles[triangle];
    const glm::vec3 share = sharesAt(surface_number, corners, x, y);
    glm::vec3 normal(0.0f);
    float scalar = 0;
    const glm::vec3 first = mesh.normals[corners[0]];
    for (int n = 0; n < 3; ++n) {
      glm::vec3 of_corner = mesh.normals[corners[static_cast<size_t>(n)]];
      if (glm::dot(of_corner, first) < 0) of_corner = -of_corner;
      normal += share[n] * of_corner;
      if (!mesh.scalars.empty()) scalar += share[n] * mesh.scalars[corners[static_cast<size_t>(n)]];
    }
    glm::vec3 colour = surface.colour;
    if (surface.by_scalar && !mesh.scalars.empty() && !std::isnan(scalar))
      colour = (surface.colours ? *surface.colours : look_.colours).at(double{scalar});
    return light_.lit(colour, normal, towardsViewer(x, y));
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

  glm::vec3 towardsViewer(float x, float y) const {
    const ScreenView& view = triangles_.view();
    if (view.projection != Projection::kPerspective) return glm::vec3(-view.forward);
    const double across = (double{x} - 0.5 * view.size.width) / view.focal_px;
    const double down = (double{y} - 0.5 * view.size.height) / view.focal_px;
    return glm::vec3(-glm::normalize(view.forward + across * view.right + down * view.down));
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
      : triangles_(triangles), shader_(shader) {}

  void append(std::span<const uint64_t> samples, int x, int y, std::vector<PixelLayer>& layers) const {
    struct Seen {
      uint64_t sample;
      size_t place;
    };
    std::array<Seen, kSamples> seen;
    size_t count = 0;
    for (size_t n = 0; n < kSamples; ++n)
      if (samples[n] != SampleBand::kNothing) seen[count++] = {samples[n], n};
    if (count == 0) return;
    const bool one = count == kSamples && std::all_of(seen.begin(), seen.end(), [&](const Seen& s) {
                       return SampleBand::numberOf(s.sample) == SampleBand::numberOf(seen[0].sample);
                     });
    // Of so few, faster than std::sort.
    for (size_t n = 1; !one && n < count; ++n) {
      const Seen moved = seen[n];
      size_t to = n;
      for (; to > 0 && moved.sample < seen[to - 1].sample; --to) seen[to] = seen[to - 1];
      seen[to] = moved;
    }
    size_t left = kSamples;
    for (size_t begin = 0; begin < count;) {
      size_t end = one ? count : begin + 1;
      for (; end < count; ++end) {
        const double gap =
            double{SampleBand::valueOf(seen[end].sample)} - double{SampleBand::valueOf(seen[end - 1].sample)};
        if (gap <= kNear * pixelOf(seen[end].sample)) continue;  // whatever the slope
        double tolerance = 0;
        for (size_t n = begin; n <= end; ++n)
          tolerance = std::max(tolerance, toleranceOf(SampleBand::numberOf(seen[n].sample), seen[n].sample));
        if (gap > tolerance) break;
      }
      glm::vec3 colour(0.0f);
      double value = 0;
      float shaded = 0;
      size_t shades = 0;
      for (size_t n = begin; n < end;) {
        const uint32_t number = SampleBand::numberOf(seen[n].sample);
        float at_x = 0, at_y = 0, of_this = 0;
        for (; n < end && SampleBand::numberOf(seen[n].sample) == number; ++n) {
          value += double{SampleBand::valueOf(seen[n].sample)};
          at_x += static_cast<float>(kSampleOffsets[seen[n].place][0]);
          at_y += static_cast<float>(kSampleOffsets[seen[n].place][1]);
          ++of_this;
        }
        if (shades++ >= kMostShaded) continue;
        colour += of_this * shader_.colourAt(number, static_cast<float>(x) + 0.5f + at_x / (16 * of_this),
                                             static_cast<float>(y) + 0.5f + at_y / (16 * of_this));
        shaded += of_this;
      }
      const auto taken = end - begin;
      const float alpha = static_cast<float>(taken) / static_cast<float>(left);
      left -= taken;
      layers.push_back({triangles_.depthOf(static_cast<float>(value / static_cast<double>(taken)),
                                           static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f),
                        glm::vec4(alpha * colour / shaded, alpha)});
      begin = end;
    }
  }

 private:
  /// A pixel's size, in values: perspective, d(-1/z) = dz / z², and a pixel is z / focal.
  double pixelOf(uint64_t sample) const {
    const ScreenView& view = triangles_.view();
    return view.projection == Projection::kPerspective
               ? std::abs(double{SampleBand::valueOf(sample)}) / view.focal_px
               : 1 / view.focal_px;
  }
  double toleranceOf(uint32_t number, uint64_t sample) const {
    const double pixel = pixelOf(sample);
    return std::min(double{shader_.steepness(number)}, kSteepest * pixel) + kNear * pixel;
  }

  const SceneTriangles& triangles_;
  const Shader& shader_;
};

/// What clip planes leave of a slice at a point, smoothed over a pixel.
float coverageAt(std::span<const ClipPlane> planes, const glm::dvec3& at, double pixel) {
  double coverage = 1;
  for (const ClipPlane& plane : planes)
    coverage *= std::clamp(0.5 + glm::dot(glm::normalize(plane.normal), at - plane.point) / pixel, 0.0, 1.0);
  return static_cast<float>(coverage);
}

}  // namespace

PixelLayers layersOf(const SurfaceScene& scene, const ScreenView& view,
                     std::span<const std::unique_ptr<SliceSampler>> slices, const SceneLook& look,
                     uint64_t band_bytes) {
  const SceneTriangles triangles(scene, view, look.depth_origin);
  const Shader shader(triangles, look);
  const PixelSurfaces surfaces(triangles, shader);
  const SurfaceLight slice_light(look.light, view);
  std::vector<PixelLayers::Row> rows(static_cast<size_t>(view.size.height));
  const auto appendSlices = [&](int x, int y, std::vector<PixelLayer>& layers) {
    for (const auto& slice : slices) {
      const auto sample = slice->at(x, y, look.depth_origin);
      if (!sample) continue;
      const glm::dvec3 in_view = view.viewFromData(sample->at);
      const double pixel = (view.projection == Projection::kPerspective ? in_view.z : 1) / view.focal_px /
                           std::max({view.scale.x, view.scale.y, view.scale.z});
      const float alpha = sample->coverage * coverageAt(look.clip_planes, sample->at, pixel) *
                          static_cast<float>(scene.slice_opacity);
      glm::vec3 colour = look.colours.at(sample->scalar);
      if (look.light)
        colour =
            slice_light.lit(colour, glm::vec3(slice->plane().normal),
                            shader.towardsViewer(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f));
      layers.push_back({sample->depth, glm::vec4(alpha * colour, alpha)});
    }
  };
  const SceneTriangles::PixelBox& box = triangles.box();
  const int band_rows = SampleBand::rowsOf(view.size, band_bytes);
  std::optional<SampleBand> band;
  if (!box.empty()) band.emplace(view.size, std::min(band_rows, box.y1 - box.y0));
  const auto drawRows = [&](int first, int end, bool has_surfaces) {
    if (has_surfaces) band->draw(triangles, first, end - first);
    tbb::parallel_for(first, end, [&](int y) {
      PixelLayers::Row& row = rows[static_cast<size_t>(y)];
      row.counts.reserve(static_cast<size_t>(view.size.width));
      for (int x = 0; x < view.size.width; ++x) {
        const size_t before = row.layers.size();
        if (has_surfaces && x >= box.x0 && x < box.x1) surfaces.append(band->at(x, y), x, y, row.layers);
        appendSlices(x, y, row.layers);
        row.endPixel(before);
      }
    });
  };
  if (box.empty()) {
    drawRows(0, view.size.height, false);
  } else {
    drawRows(0, box.y0, false);
    for (int first = box.y0; first < box.y1; first += band_rows)
      drawRows(first, std::min(first + band_rows, box.y1), true);
    drawRows(box.y1, view.size.height, false);
  }
  return {view.size, std::move(rows), look.depth_origin};
}

}  // namespace curvisplat
