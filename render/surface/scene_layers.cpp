// The layers of a picture, tile by tile of samples and row by row: SampledLayers makes those of triangles,
// PixelSlices those of slices; iso_layers.h has found those of isosurfaces.
#include "render/surface/scene_layers.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "render/mesh/curve_set.h"
#include "render/project/pixel_layers.h"
#include "render/surface/rasterizer.h"
#include "render/surface/sampled_layers.h"
#include "render/surface/scene_triangles.h"
#include "render/surface/surface_shader.h"

namespace curvisplat {
namespace {

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

bool usesColours(const SurfaceScene& scene) {
  const auto has = [](const std::vector<double>& values, const std::vector<std::optional<glm::vec3>>& own) {
    return !values.empty() && (own.empty() || std::find(own.begin(), own.end(), std::nullopt) != own.end());
  };
  return scene.volume || !scene.slices.empty() || has(scene.isovalues, scene.iso_colours) ||
         std::ranges::any_of(
             scene.further_isosurfaces,
             [&](const FurtherIsosurfaces& one) { return has(one.values, one.own_colours); }) ||
         std::ranges::any_of(scene.grid_surfaces,
                             [](const GridSurface& surface) { return surface.scalar && !surface.colours; }) ||
         std::ranges::any_of(scene.curves,
                             [](const Curves& one) { return !one.colours && !one.set->values.empty(); });
}

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
