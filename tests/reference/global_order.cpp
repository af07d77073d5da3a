#include "tests/reference/global_order.h"

#include <algorithm>
#include <memory>
#include <tuple>

#include "render/frame/frame_plan.h"
#include "render/project/footprint.h"
#include "render/project/tile_key.h"
#include "render/surface/scene_layers.h"
#include "stream/paging/layer_merger.h"

namespace curvisplat {
namespace {

/// The place of a splat or a record in the order.
struct Placed {
  uint32_t key, first, brick, number;
  ScreenSplat splat;
};

void sort(std::vector<Placed>& placed) {
  std::sort(placed.begin(), placed.end(), [](const Placed& a, const Placed& b) {
    return std::tie(a.key, a.first, a.brick, a.number) < std::tie(b.key, b.first, b.brick, b.number);
  });
}

/// The splats in the order of their keys: none leans any more.
std::vector<ScreenSplat> sorted(std::vector<Placed> placed) {
  sort(placed);
  std::vector<ScreenSplat> splats;
  for (const Placed& each : placed) {
    splats.push_back(each.splat);
    if (!isRecord(each.splat)) splats.back().key_slope0 = splats.back().key_slope1 = 0;
  }
  return splats;
}

/// The splats that may touch a tile, with their keys there.
std::vector<Placed> inTile(const std::vector<Placed>& placed, int x, int y) {
  std::vector<Placed> found;
  size_t first_record = 0;  // the records of a splat come before it
  const auto left = static_cast<float>(x), top = static_cast<float>(y);
  for (size_t n = 0; n < placed.size(); ++n) {
    const ScreenSplat& splat = placed[n].splat;
    if (isRecord(splat)) continue;
    const ScreenBox box = footprintBox(splat);
    if (box.x1 >= left && box.x0 <= left + kOrderSide && box.y1 >= top && box.y0 <= top + kOrderSide) {
      const uint32_t key = keyAt(splat, left + 0.5f * kOrderSide, top + 0.5f * kOrderSide);
      for (size_t of = first_record; of <= n; ++of) {
        found.push_back(placed[of]);
        found.back().key = key;
      }
    }
    first_record = n + 1;
  }
  return found;
}

}  // namespace

Image globallySorted(const CacheReader& cache, const DrawnScalars& scalars, Backend backend,
                     const Camera& camera, const FrameOptions& options) {
  const FramePlanner planner(cache, scalars);
  FramePlan plan = planner.plan(camera, options);
  if (options.scene) {
    const glm::dvec3 middle = 0.5 * (cache.manifest().lower + cache.manifest().upper);
    const ScreenView& view = plan.settings.view;
    const double origin = view.projection == Projection::kPerspective ? 0 : view.viewFromData(middle).z;
    plan.layers = std::make_shared<PixelLayers>(layersOf(
        *options.scene, view, {}, {planner.colours(), options.light, plan.settings.clip_planes, origin}));
    plan.settings.layers = plan.layers.get();
  }
  std::vector<Placed> placed;
  BrickProjector projector;
  std::vector<uint32_t> keys;
  for (const SweptPart& swept : plan.parts) {
    const BrickPart& part = swept.part;
    const Brick& brick = cache.bricks()[part.brick];
    SplatGeometry geometry;
    SplatVariable values, colours;
    cache.readGeometry(part.brick, geometry);
    cache.readVariable(part.brick, scalars.opacity.variable, values);
    if (scalars.colour) cache.readVariable(part.brick, scalars.colour->variable, colours);
    SplatRanges ranges(brick, part.octants);
    if (part.merging > 0) {
      LayerMerger().merge(*plan.mergings[part.merging - 1u], brick.largest_radius, geometry, values,
                          scalars.colour ? &colours : nullptr);
      Brick merged;
      merged.splats = static_cast<uint32_t>(geometry.size());
      ranges = {merged, kAllOctants};
    }
    const glm::dvec3 corner = cache.manifest().root.cellMin(brick.cell);
    BrickValues drawn(arraysOf(values));
    if (scalars.colour) drawn.colours = arraysOf(colours);
    projector.project(plan.settings, planner.table(), corner, arraysOf(geometry), drawn,
                      {ranges.begin(), ranges.end()});
    keys.resize(projector.depths().size());
    plan.keys.setKeys(projector.mutableSplats(), projector.depths(), corner, plan.keys.rangeOf(brick), keys);
    for (uint32_t n = 0; n < keys.size(); ++n)
      placed.push_back({keys[n], keys[n], part.brick, n, projector.splats()[n]});
  }
  const bool one_order = std::none_of(placed.begin(), placed.end(), [](const Placed& each) {
    return !isRecord(each.splat) && leans(each.splat);
  });
  const auto painting = makeBackend(backend);
  Image image(options.size);
  painting->run([&](Painter& painter) {
    const auto begin = [&] {
      painter.begin(options.size, options.background, planner.table(),
                    {plan.settings.per_pixel, plan.settings.light.has_value(), plan.settings.layers,
                     planner.colourClasses()});
    };
    if (one_order) {
      begin();
      painter.draw(sorted(placed));
      image = painter.end();
      return;
    }
    const int columns = TileSet::tilesAlong(options.size.width, kOrderSide);
    const size_t tiles = TileSet::tilesOf(options.size, kOrderSide);
    for (size_t tile = 0; tile < tiles; ++tile) {
      const int x = static_cast<int>(tile) % columns * kOrderSide,
                y = static_cast<int>(tile) / columns * kOrderSide;
      // The shared tile around it; what lies beside the order tile is not taken.
      std::vector<uint32_t> owners(TileSet::tilesOf(options.size, kSharedTileSide), 1);
      owners[static_cast<size_t>(y / kSharedTileSide *
                                     TileSet::tilesAlong(options.size.width, kSharedTileSide) +
                                 x / kSharedTileSide)] = 0;
      begin();
      painter.drawOnly(TileSet(options.size, owners, 0));
      painter.draw(sorted(inTile(placed, x, y)));
      const Image drawn = painter.end();
      for (int row = y; row < std::min(y + kOrderSide, options.size.height); ++row)
        for (int column = x; column < std::min(x + kOrderSide, options.size.width); ++column)
          std::copy_n(drawn.pixel(column, row), 4, image.pixel(column, row));
    }
  });
  return image;
}

}  // namespace curvisplat
