#include "render/frame/layer_drawer.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "render/frame/frame_workers.h"
#include "render/image/too_little_memory.h"
#include "render/mesh/curve_set.h"
#include "render/surface/map_image.h"
#include "render/surface/rasterizer.h"
#include "render/surface/scene_layers.h"
#include "render/surface/slice_sampler.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

constexpr uint64_t kSampleTileBytes = 256 << 10;  // of a thread

/// The memory that the splats of isosurfaces may take; where it is too little they are found in several parts
/// of the picture.
uint64_t isoSplatBytes(const FrameOptions& options) {
  constexpr uint64_t kMinBytes = 4 << 20;
  return std::max(kMinBytes, options.memory_bytes / 8);
}

/// The memory that finding where rays meet isosurfaces may take; where it is too little fewer threads do.
uint64_t isoTracerBytes(const FrameOptions& options) {
  constexpr uint64_t kTracerBytes = 2 << 20;
  return std::max(kTracerBytes * threadsOrCores(options.threads), options.memory_bytes / 16);
}

/// The bricks of a slice that this rank samples.
SlicePlan shareOf(const SlicePlan& slice, const FrameOptions& options) {
  SlicePlan share{slice.plane, {}, slice.complete};
  for (size_t n = options.ranks->rank(); n < slice.parts.size(); n += options.ranks->count())
    share.parts.push_back(slice.parts[n]);
  return share;
}

/// The bricks of some parts, each once.
std::vector<uint32_t> bricksOf(std::span<const BrickPart> parts) {
  std::vector<uint32_t> bricks;
  for (const BrickPart& part : parts) bricks.push_back(part.brick);
  std::sort(bricks.begin(), bricks.end());
  bricks.erase(std::unique(bricks.begin(), bricks.end()), bricks.end());
  return bricks;
}

}  // namespace

uint64_t LayerDrawer::bytes(const FrameOptions& options) const {
  if (!options.scene || options.scene->empty()) return 0;
  const uint64_t slice_bytes = options.scene->slices_by_function ? 144 : 72;  // of two scalars
  const auto is_translucent = [](const auto& surface) { return !surface.opacity.opaque(); };
  const bool peels =
      std::any_of(options.scene->surfaces.begin(), options.scene->surfaces.end(), is_translucent) ||
      std::any_of(options.scene->grid_surfaces.begin(), options.scene->grid_surfaces.end(), is_translucent) ||
      (options.scene->hasIsosurfaces() && !options.scene->iso_opacity.opaque()) ||
      std::any_of(options.scene->curves.begin(), options.scene->curves.end(),
                  [](const Curves& curves) { return curves.opacity < 1; });
  constexpr uint64_t kLayerBytes = 64, kVertexBytes = 16, kTriangleBytes = 8, kPointBytes = 28;
  const uint64_t tile_bytes = kSampleTileBytes + (options.scene->curves.empty() ? 0 : CapsuleQueue::kBytes);
  uint64_t bytes = tile_bytes * (peels ? kMaxPeels : 1) * threadsOrCores(options.threads) +
                   options.size.pixels() * (kLayerBytes + slice_bytes * options.scene->slices.size());
  for (const Surface& surface : options.scene->surfaces)
    bytes += surface.mesh->bytes() + kVertexBytes * surface.mesh->positions.size() +
             kTriangleBytes * surface.mesh->triangles.size() + (surface.map ? surface.map->image.bytes() : 0);
  for (const Curves& curves : options.scene->curves) {
    bytes += curves.set->bytes() + kPointBytes * curves.set->positions.size();
    if (curves.whole && curves.whole != curves.set) bytes += curves.whole->bytes();
  }
  bytes += isoBytes(options);
  if (!options.scene->grid_surfaces.empty())
    bytes += FaceMeshes::bytes(*options.scene, options.size.pixels());
  return bytes;
}

/// Isosurfaces of a scalar are of the grid's cells or of the field of splats, never of both at once; those of the field are found for one
/// scalar after the other. The most is taken where all lie in cells, or all but those of the scalar that takes least there.
uint64_t LayerDrawer::isoBytes(const FrameOptions& options) const {
  constexpr uint64_t kBytesAPixel = 48;
  const uint64_t of_layers = kBytesAPixel * options.size.pixels();
  const uint64_t of_field = of_layers + isoSplatBytes(options) + isoTracerBytes(options);
  uint64_t all = 0, least = UINT64_MAX;
  for (const IsoGroup& group : isoGroups(*options.scene, scalars())) {
    const uint64_t of_cells =
        IsoMeshes::bytes(cache_.manifest(), coloured_by_ || group.other, group.values.size());
    all += std::max(of_cells, of_layers);
    least = std::min(least, std::max(of_cells, of_layers));
  }
  return all == 0 ? 0 : std::max(all, all - least + of_field);
}

void LayerDrawer::draw(FramePlan& plan, const FrameOptions& options, const Sample& sample,
                       const std::function<void()>& throw_if_stopped, FrameStatistics& statistics) {
  if (!options.scene || (options.scene->empty() && options.scene->volume)) {
    release();
    return;
  }
  const ScreenView& view = plan.settings.view;
  const auto samplerOf = [&](const SlicePlan& slice, size_t variable) {
    const VariableInfo& info = cache_.manifest().variables[variable];
    return std::make_unique<SliceSampler>(view, slice.plane, info.min, info.max, plan.settings.borders);
  };
  std::vector<std::unique_ptr<SliceSampler>> samplers, of_opacity;
  for (const SlicePlan& slice : plan.slices) {
    samplers.push_back(samplerOf(slice, coloured_by_.value_or(variable_)));
    if (coloured_by_ && options.scene->slices_by_function) of_opacity.push_back(samplerOf(slice, variable_));
    if (!samplers.back()->isSeen()) continue;
    SliceSampler* const opacities = of_opacity.empty() ? nullptr : of_opacity.back().get();
    const SlicePlan share = shareOf(slice, options);
    const auto take = [&](size_t, const glm::dvec3& cell_min, const BrickSource::Splats& splats) {
      samplers.back()->add(cell_min, splats.geometry, splats.second.value_or(splats.values), splats.ranges);
      if (opacities) opacities->add(cell_min, splats.geometry, splats.values, splats.ranges);
    };
    sample({cache_, share.parts, take, options.keep_going});
    samplers.back()->addOthers(*options.ranks);
    if (opacities) opacities->addOthers(*options.ranks);
  }
  const glm::dvec3 middle = 0.5 * (cache_.manifest().lower + cache_.manifest().upper);
  const double depth_origin = view.projection == Projection::kPerspective ? 0 : view.viewFromData(middle).z;
  std::optional<ColourTable> opacities;
  if (options.scene->usesOpacities()) opacities.emplace(planner_.transferFunction());
  const std::vector<IsoGroup> groups = isoGroups(*options.scene, scalars());
  std::erase_if(iso_meshes_, [&](const auto& kept) {
    return std::ranges::find(groups, kept.first, &IsoGroup::variable) == groups.end();
  });
  std::vector<IsoLayers> isosurfaces;
  IsoSurfaces in_cells;
  for (size_t n = 0; n < groups.size(); ++n) {
    const IsoInput input{groups[n], plan.iso_parts.at(n), sample, depth_origin,
                         opacities ? &*opacities : nullptr};
    if (const IsoMeshes::Meshes* const meshes = isoMeshes(input, plan, options, throw_if_stopped, statistics))
      addIsoSurfaces(*meshes, groups[n], {planner_.colours(), input.opacities}, in_cells);
    else
      isosurfaces.push_back(this->isosurfaces(input, plan, options, statistics));
  }
  const StageTimer timer(statistics.surfaces_s, "draw surfaces");
  const SceneLook look{planner_.colours(),
                       options.light,
                       plan.settings.clip_planes,
                       depth_origin,
                       opacities ? &*opacities : nullptr,
                       of_opacity,
                       isosurfaces,
                       in_cells.values,
                       plan.settings.shadows.get(),
                       throw_if_stopped};
  std::shared_ptr<const PixelLayers> layers;
  runOnThreadsOf(options, [&] {
    SurfaceScene scene = face_meshes_.withMeshes(options.scene, view, options.lod_pixels);
    for (Surface& surface : in_cells.surfaces) scene.surfaces.push_back(std::move(surface));
    layers = std::make_shared<PixelLayers>(layersOf(scene, view, samplers, look, &surface_memory_));
  });
  planner_.addLayers(plan, std::move(layers), options);
}

/// The isosurfaces in the cells of the grid; null where they are those of the field of splats.
const IsoMeshes::Meshes* LayerDrawer::isoMeshes(const IsoInput& input, const FramePlan& plan,
                                                const FrameOptions& options,
                                                const std::function<void()>& throw_if_stopped,
                                                FrameStatistics& statistics) {
  const IsoGroup& group = input.group;
  IsoMeshes& kept = iso_meshes_[group.variable];
  IsoMeshes::Wanted wanted{{group.values.begin(), group.values.end()}, plan.settings.clip_planes};
  wanted.variable = group.variable;
  wanted.other = group.other;
  wanted.other_is_of_opacities = group.opacities_of_other && !group.colours_of_other;
  wanted.keep_going = options.keep_going;
  const StageTimer timer(statistics.surfaces_s, "find isosurfaces");
  const IsoMeshes::Meshes* const meshes = kept.of(cache_, wanted, throw_if_stopped);
  // Any damaged leaf makes the isosurfaces those of the field, whether its rays meet that leaf or not.
  PrepareStatistics unreadable;
  for (const auto& [brick, reason] : kept.damaged()) unreadable.bricks_unreadable.push_back({brick, reason});
  combine(statistics, unreadable);
  if (!meshes) return nullptr;
  const std::vector<uint32_t> bricks = bricksOf(input.parts);
  statistics.iso_bricks += bricks.size();
  for (const uint32_t brick : bricks) statistics.iso_splats += cache_.bricks()[brick].splats;
  return meshes;
}

/// Returns the scalars to read for the isosurfaces of a group: the picture's where they suffice.
BrickSource::Variables LayerDrawer::readFor(const IsoGroup& group) const {
  const auto is_of_picture = [&](size_t variable) {
    return variable == variable_ || variable == coloured_by_;
  };
  if (is_of_picture(group.variable) && (!group.other || is_of_picture(*group.other)))
    return {variable_, coloured_by_};
  return {group.variable, group.other};
}

/// A part of the picture after the other, each as large as its splats fit into the memory. A tile of 32x32 pixels is
/// the smallest.
IsoLayers LayerDrawer::isosurfaces(const IsoInput& input, const FramePlan& plan, const FrameOptions& options,
                                   FrameStatistics& statistics) const {
  const ProjectionSettings& settings = plan.settings;
  const IsoGroup& group = input.group;
  const SheetOpacity& opacity = group.opacity;
  const IsoLayers::Look look{
      planner_.colours(),
      options.light,
      {opacity.factor, opacity.by_function ? input.opacities : nullptr, group.opacities_of_other},
      group.colours_of_other,
      group.own_colours};
  const BrickSource::Variables read = readFor(group);
  const auto valuesOf = [&](size_t variable, const BrickSource::Splats& splats) {
    return variable == read.first ? &splats.values : &*splats.second;
  };
  IsoLayers layers(settings.view.size);
  statistics.iso_bricks += bricksOf(input.parts).size();
  std::vector<TileRange> left{{0, layers.tiles()}};
  while (!left.empty()) {
    const TileRange tiles = left.back();
    left.pop_back();
    IsoSplats splats({settings.view, group.values, settings.borders, settings.clip_planes, input.depth_origin,
                      tiles, isoSplatBytes(options), group.other.has_value()},
                     input.parts.size());
    const auto take = [&](size_t part, const glm::dvec3& cell_min, const BrickSource::Splats& of_part) {
      splats.add(part, cell_min, of_part.geometry, *valuesOf(group.variable, of_part),
                 group.other ? valuesOf(*group.other, of_part) : nullptr, of_part.ranges);
    };
    input.sample({cache_, input.parts, take, options.keep_going, read});
    if (splats.overflowed()) {
      if (tiles.count() == 1)
        throw TooLittleMemory(
            fmt::format(
                "isosurfaces: too many splats in {0}x{0} pixels (they need more than their {1} KiB of "
                "--memory); increase --memory or --lod-pixels",
                kTileSide, isoSplatBytes(options) >> 10),
            options.size);
      const size_t middle = (tiles.begin + tiles.end) / 2;
      left.push_back({middle, tiles.end});
      left.push_back({tiles.begin, middle});
      continue;
    }
    statistics.iso_splats += splats.count();
    const StageTimer timer(statistics.surfaces_s, "draw isosurfaces");
    runOnThreadsOf(options, [&] {
      splats.sort();
      layers.draw(splats, look, isoTracerBytes(options));
    });
  }
  return layers;
}

}  // namespace curvisplat
