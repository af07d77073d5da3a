#include "tests/support/cache_summary.h"

#include <fmt/format.h>

#include <glm/geometric.hpp>

#include "render/frame/frame.h"

namespace curvisplat {

std::map<std::string, double> summaryOf(const CacheReader& cache) {
  std::map<std::string, double> sums;
  const Manifest& manifest = cache.manifest();
  SplatGeometry g;
  SplatVariable v;
  std::vector<NodeRun> runs;
  for (uint32_t brick = 0; brick < cache.bricks().size(); ++brick) {
    const Cell& cell = cache.bricks()[brick].cell;
    const auto add = [&](const char* what, double value) {
      sums[fmt::format("level {}: {}", cell.level, what)] += value;
    };
    const glm::dvec3 corner = manifest.root.cellMin(cell);
    cache.readGeometry(brick, g, &runs);
    add("bricks", 1);
    add("splats", static_cast<double>(g.size()));
    for (const NodeRun& run : runs) add("nodes", run.count);
    for (size_t n = 0; n < g.size(); ++n) {
      add("weight", g.weight[n]);
      add("x", corner.x + g.x[n]);
      add("y", corner.y + g.y[n]);
      add("z", corner.z + g.z[n]);
      add("axes", double{g.axis0[n]} + g.axis1[n] + g.axis2[n]);
      add("shears", std::abs(g.shear10[n]) + std::abs(g.shear20[n]) + std::abs(g.shear21[n]));
    }
    for (size_t variable = 0; variable < manifest.variables.size(); ++variable) {
      const std::string& name = manifest.variables[variable].name;
      cache.readVariable(brick, variable, v);
      for (size_t n = 0; n < v.size(); ++n) {
        add((name + ", mean").c_str(), v.mean[n]);
        add((name + ", slope").c_str(), glm::length(glm::dvec3(v.slope0[n], v.slope1[n], v.slope2[n])));
        add((name + ", variance").c_str(), v.variance[n]);
      }
    }
  }
  return sums;
}

Image smallPictureOf(const CacheReader& cache, size_t variable) {
  const Manifest& manifest = cache.manifest();
  const VariableInfo& info = manifest.variables[variable];
  FrameRenderer renderer(cache, variable,
                         TransferFunction::preset("viridis", info.min, info.max,
                                                  glm::length(manifest.upper - manifest.lower) / 30),
                         Backend::kCpu);
  FrameOptions options;
  options.size = {96, 72};
  options.lod_pixels = 0;
  FrameStatistics statistics;
  return renderer.render(
      Camera::named("iso", manifest.lower, manifest.upper, options.size, Projection::kOrthographic, 30),
      options, statistics);
}

}  // namespace curvisplat
