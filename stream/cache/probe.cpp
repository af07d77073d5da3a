#include "stream/cache/probe.h"

#include <cmath>

#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

bool reaches(const Brick& brick, const glm::dvec3& point) {
  for (int axis = 0; axis < 3; ++axis)
    if (point[axis] < brick.lower[axis] - brick.largest_radius ||
        point[axis] > brick.upper[axis] + brick.largest_radius)
      return false;
  return true;
}

/// A⁻¹ d by forward substitution.
glm::dvec3 inFootprint(const SplatGeometry& g, size_t s, const glm::dvec3& d) {
  const double b0 = d.x, b1 = d.y - g.shear10[s] * b0, b2 = d.z - g.shear20[s] * b0 - g.shear21[s] * b1;
  return {b0 / g.axis0[s], b1 / g.axis1[s], b2 / g.axis2[s]};
}

struct Nearest {
  double distance = kKernelSupport;
  bool found = false;
  uint32_t brick = 0, splat = 0;
  glm::dvec3 centre{0.0}, offset{0.0};
  NodeRun node;
};

void findIn(const CacheReader& reader, uint32_t brick, const glm::dvec3& point, Nearest& nearest) {
  SplatGeometry geometry;
  std::vector<NodeRun> runs;
  reader.readGeometry(brick, geometry, &runs);
  const glm::dvec3 corner = reader.manifest().root.cellMin(reader.bricks()[brick].cell);
  const glm::dvec3 local = point - corner;
  bool better = false;
  for (uint32_t s = 0; s < geometry.size(); ++s) {
    const glm::dvec3 centre(geometry.x[s], geometry.y[s], geometry.z[s]);
    const glm::dvec3 offset = inFootprint(geometry, s, local - centre);
    const double distance = glm::length(offset);
    if (!(distance < nearest.distance)) continue;
    better = true;
    nearest = {distance, true, brick, s, corner + centre, offset, {}};
  }
  if (!better) return;
  uint64_t first = 0;
  for (const NodeRun& run : runs) {
    if (nearest.splat < first + run.count) {
      nearest.node = {run.block, run.i + (nearest.splat - first), run.j, run.k, 1};
      break;
    }
    first += run.count;
  }
}

}  // namespace

std::optional<ProbeResult> probe(const CacheReader& reader, std::span<const size_t> variables,
                                 const glm::dvec3& point) {
  Nearest nearest;
  const auto bricks = reader.bricks();
  for (uint32_t n = 0; n < bricks.size(); ++n)
    if (bricks[n].isLeaf() && reaches(bricks[n], point)) findIn(reader, n, point, nearest);
  if (!nearest.found) return std::nullopt;

  const NodeRun& node = nearest.node;
  ProbeResult result{nearest.brick, nearest.splat,  node.block,       node.i, node.j,
                     node.k,        nearest.centre, nearest.distance, {}};
  for (size_t v : variables) {
    SplatVariable values;
    reader.readVariable(nearest.brick, v, values);
    const size_t s = nearest.splat;
    const glm::dvec3 slope(values.slope0[s], values.slope1[s], values.slope2[s]);
    result.variables.push_back(
        {values.mean[s], static_cast<float>(values.mean[s] + glm::dot(slope, nearest.offset))});
  }
  return result;
}

}  // namespace curvisplat
