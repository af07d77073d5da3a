#include "tests/reference/global_order.h"

#include <algorithm>
#include <tuple>

#include "render/frame/frame_plan.h"

namespace curvisplat {
namespace {

struct Placed {
  uint32_t key, brick, number;
  ScreenSplat splat;
};

}  // namespace

Image globallySorted(const CacheReader& cache, const TransferFunction& transfer_function, Backend backend,
                     const Camera& camera, const FrameOptions& options) {
  const FramePlanner planner(cache, {0, transfer_function});
  const FramePlan plan = planner.plan(camera, options, DrawingOrder::kFrontToBack);
  std::vector<Placed> placed;
  BrickProjector projector;
  std::vector<uint32_t> keys;
  for (const BrickPart& part : plan.cut.parts) {
    const Brick& brick = cache.bricks()[part.brick];
    SplatGeometry geometry;
    SplatVariable values;
    cache.readGeometry(part.brick, geometry);
    cache.readVariable(part.brick, 0, values);
    const glm::dvec3 corner = cache.manifest().root.cellMin(brick.cell);
    const SplatRanges ranges(brick, part.octants);
    projector.project(plan.settings, planner.table(), corner, arraysOf(geometry), arraysOf(values),
                      {ranges.begin(), ranges.end()});
    keys.resize(projector.depths().size());
    plan.keys.keysOf(projector.depths(), corner, plan.keys.rangeOf(brick), keys);
    for (uint32_t n = 0; n < keys.size(); ++n)
      placed.push_back({keys[n], part.brick, n, projector.splats()[n]});
  }
  std::sort(placed.begin(), placed.end(), [](const Placed& a, const Placed& b) {
    return std::tie(a.key, a.brick, a.number) < std::tie(b.key, b.brick, b.number);
  });
  const auto painting = makeBackend(backend);
  if (painting->order() == DrawingOrder::kBackToFront) std::reverse(placed.begin(), placed.end());
  std::vector<ScreenSplat> splats;
  for (const Placed& each : placed) splats.push_back(each.splat);
  Image image;
  painting->run([&](Painter& painter) {
    painter.begin(options.size, options.background, planner.table(),
                  {plan.settings.per_pixel, plan.settings.light.has_value()});
    painter.draw(splats);
    image = painter.end();
  });
  return image;
}

}  // namespace curvisplat
