#include "tests/reference/direct_picture.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/common.hpp>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "preprocess/seams/seams.h"
#include "preprocess/shape/merge.h"
#include "render/cpu/cpu_painter.h"
#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "render/surface/scene_layers.h"
#include "tests/reference/splat_compositor.h"
#include "tests/support/with_corrections.h"

namespace curvisplat {
namespace {

struct DirectSplat {
  Splat splat;
  SplatScalar value;
  SplatCodes codes = {};
};

std::vector<DirectSplat> splatsOf(const GridSource& source, uint32_t scalar, const DirectOptions& options) {
  std::vector<DirectSplat> out;
  const auto take = [&](const NodeSplat& node, std::span<const SplatScalar> values) {
    out.push_back(
        {node.splat, values[0], {options.border_parts ? node.border_code : kNoBorder, node.growth_code}});
  };
  SeamMerger seams(1, uint64_t{64} << 20, std::filesystem::temp_directory_path(), options.unlike);
  std::vector<double> for_seams;
  uint64_t first_node = 0;
  const auto& blocks = source.description().blocks;
  for (uint32_t b = 0; b < blocks.size(); ++b) {
    const NodeBox all{0, blocks[b].nj, 0, blocks[b].nk};
    NodeArrays nodes;
    source.read(b, all, std::span(&scalar, 1), nodes);
    NodeScratch scratch;
    NodeSplats splats;
    computeNodeSplats({blocks[b], first_node, all, &nodes}, all, scratch, splats);
    for (size_t n = 0; n < splats.splats.size(); ++n) {
      if (!splats.splats[n].isForSeams() || !options.merge_seams)
        take(splats.splats[n], {&splats.values[n], 1});
    }
    if (options.merge_seams) seams.pack(splats, for_seams);
    first_node += blocks[b].nodes();
  }
  seams.add(for_seams);
  seams.finish(source.description().coordinate_bytes, take);
  return out;
}

std::vector<DirectSplat> mergedIntoVoxels(const std::vector<DirectSplat>& splats,
                                          const DirectOptions& options) {
  std::map<std::tuple<int64_t, int64_t, int64_t>, size_t> voxels;
  const auto voxelOf = [&](const DirectSplat& s) {
    const glm::dvec3 at = glm::floor(s.splat.position / options.voxel);
    return std::tuple(static_cast<int64_t>(at.x), static_cast<int64_t>(at.y), static_cast<int64_t>(at.z));
  };
  for (const DirectSplat& s : splats) voxels.emplace(voxelOf(s), voxels.size());
  VoxelMerger merger(1, voxels.size(), options.spread);
  merger.clear(options.even ? options.voxel : 0);
  for (const DirectSplat& s : splats)
    merger.add(voxels.at(voxelOf(s)), s.splat.position, s.splat, std::span(&s.value, 1), s.codes);
  std::vector<DirectSplat> merged(voxels.size());
  for (size_t n = 0; n < merged.size(); ++n) {
    merged[n].codes = merger.finish(n, merged[n].splat, std::span(&merged[n].value, 1));
    if (!options.variance) merged[n].value.variance = 0;
  }
  return merged;
}

/// Splats in the arrays that are projected.
struct ProjectedArrays {
  glm::dvec3 origin;
  SplatGeometry geometry;
  SplatVariable variable;
};

ProjectedArrays projectedArrays(const std::vector<DirectSplat>& splats, const glm::dvec3& origin) {
  ProjectedArrays arrays{origin, {}, {}};
  arrays.geometry.resize(splats.size());
  arrays.variable.resize(splats.size());
  for (size_t n = 0; n < splats.size(); ++n)
    setSplat({arrays.geometry, arrays.variable}, n, splats[n].splat.position - origin, splats[n].splat,
             splats[n].value, splats[n].codes);
  return arrays;
}

/// The layers of the scene, its slices and isosurfaces those of these splats.
PixelLayers sceneLayers(const DirectOptions& options, const ProjectionSettings& settings,
                        const TransferFunction& function, const ProjectedArrays& splats) {
  constexpr uint64_t kEnough = uint64_t{1} << 32;
  const SurfaceScene& scene = *options.scene;
  const std::vector<float>& means = splats.variable.mean;
  const auto [low, high] = std::minmax_element(means.begin(), means.end());
  std::vector<std::unique_ptr<SliceSampler>> slices;
  const SplatRange all{0, static_cast<uint32_t>(splats.geometry.size())};
  for (const ClipPlane& plane : scene.slices) {
    slices.push_back(std::make_unique<SliceSampler>(settings.view, plane, *low, *high, settings.borders));
    slices.back()->add(splats.origin, arraysOf(splats.geometry), arraysOf(splats.variable), {&all, 1});
  }
  const double depth_origin =
      settings.view.projection == Projection::kPerspective ? 0 : settings.view.viewFromData(splats.origin).z;
  const ColourTable colours(function);
  std::optional<IsoLayers> isosurfaces;
  if (!scene.isovalues.empty()) {
    isosurfaces.emplace(settings.view.size);
    IsoSplats of_values({settings.view,
                         scene.isovalues,
                         settings.borders,
                         settings.clip_planes,
                         depth_origin,
                         {0, isosurfaces->tiles()},
                         kEnough},
                        1);
    of_values.add(0, splats.origin, arraysOf(splats.geometry), arraysOf(splats.variable), nullptr, {&all, 1});
    of_values.sort();
    isosurfaces->draw(of_values, {colours, settings.light, {scene.iso_opacity.factor}}, kEnough);
  }
  SceneLook look{colours, settings.light, settings.clip_planes, depth_origin, &colours};
  if (isosurfaces) look.isosurfaces = {&*isosurfaces, 1};
  return layersOf(scene, settings.view, slices, look);
}

/// A splat's depth, as layers have it.
float distanceOf(const ScreenView& view, const ScreenSplat& splat, float depth, const glm::dvec3& origin) {
  if (view.projection == Projection::kOrthographic) return depth;
  const double z = 1 / (1 / view.orderBase(origin) - double{depth});
  return static_cast<float>(z * std::hypot(1.0, (splat.x - 0.5 * view.size.width) / view.focal_px,
                                           (splat.y - 0.5 * view.size.height) / view.focal_px));
}

/// Whether the layers of its pixel hide a splat's centre; depths from the layers' origin.
bool isBehind(const PixelLayers& layers, const ScreenSplat& splat, float depth) {
  const ImageSize size = layers.size();
  const auto at = layers.at(std::clamp(static_cast<int>(splat.x), 0, size.width - 1),
                            std::clamp(static_cast<int>(splat.y), 0, size.height - 1));
  return !at.empty() && at.back().colour.w >= 1 && depth > at.back().depth;
}

}  // namespace

Image drawDirectly(const GridSource& source, uint32_t scalar, const DirectOptions& options,
                   const TransferFunction& function, const Camera& camera, ImageSize size) {
  const WithCorrections scope({options.nodes, options.slices, options.isosurfaces});
  ProjectionSettings settings;
  std::vector<DirectSplat> splats = splatsOf(source, scalar, options);
  double low = splats.front().value.mean, high = low;  // the data's, which merged splats do not reach
  for (const DirectSplat& splat : splats) {
    low = std::min(low, splat.value.mean);
    high = std::max(high, splat.value.mean);
  }
  if (options.voxel > 0) splats = mergedIntoVoxels(splats, options);
  if (options.cut_splats) {
    settings.clip_planes = options.clip_planes;
  } else {
    std::erase_if(splats, [&](const DirectSplat& s) {
      return std::any_of(options.clip_planes.begin(), options.clip_planes.end(), [&](const ClipPlane& plane) {
        return glm::dot(plane.normal, s.splat.position - plane.point) < 0;
      });
    });
  }
  glm::dvec3 origin = splats.front().splat.position;
  glm::dvec3 farthest = origin;
  for (const DirectSplat& splat : splats) {
    origin = glm::min(origin, splat.splat.position);
    farthest = glm::max(farthest, splat.splat.position);
  }
  const ProjectedArrays arrays = projectedArrays(splats, origin);
  const ClassificationTable table = ClassificationTable::of(function, low, high);
  settings.view = ScreenView::of(camera, size, glm::dvec3(1), options.low_pass_px2, options.near);
  settings.view.slope_low_pass_px2 = options.slope_low_pass_px2;
  settings.view.widest = options.widest;
  settings.per_pixel = options.per_pixel;
  settings.light = options.light;
  settings.light_g0 = options.light_g0;
  std::optional<PixelLayers> layers;
  if (options.scene) layers.emplace(sceneLayers(options, settings, function, arrays));
  if (layers && options.cut_splats) settings.layers = &*layers;
  BrickProjector projector;
  projector.project(settings, table, origin, arrays.geometry, arrays.variable);

  const DepthKeys keys(settings.view, RootCube::around(origin, farthest));
  std::vector<uint32_t> first(projector.splats().size());
  keys.setKeys(projector.mutableSplats(), projector.depths(), origin, {0, ~uint32_t{0}}, first);
  std::vector<ScreenSplat> sorted, records;
  sorted.reserve(projector.splats().size());
  DepthSorter sorter;
  for (const DepthItem& item : sorter.sort(first)) {
    if (options.scene && !options.scene->volume) break;
    ScreenSplat splat = projector.splats()[item.splat];
    // A splat's records come before it.
    if (isRecord(splat)) {
      records.push_back(splat);
      continue;
    }
    const bool is_behind =
        layers && !options.cut_splats &&
        isBehind(*layers, splat, distanceOf(settings.view, splat, projector.depths()[item.splat], origin));
    if (!is_behind) {
      if (!options.hidden_slope) splat.half_width = 0;
      if (!options.secant && camera.projection == Projection::kPerspective)
        splat.amplitude /=
            static_cast<float>(std::hypot(1.0, (splat.x - 0.5 * size.width) / settings.view.focal_px,
                                          (splat.y - 0.5 * size.height) / settings.view.focal_px));
      sorted.insert(sorted.end(), records.begin(), records.end());
      sorted.push_back(splat);
    }
    records.clear();
  }
  CpuPainter painter;
  painter.begin(size, glm::vec4(1), table,
                {options.per_pixel, options.light.has_value(), layers ? &*layers : nullptr});
  painter.draw(sorted);
  return painter.end();
}

}  // namespace curvisplat
