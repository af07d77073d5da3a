#include "stream/cache/probe.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "stream/base/error.h"
#include "stream/model/border_code.h"
#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

bool reaches(const Brick& brick, const glm::dvec3& point) {
  for (int axis = 0; axis < 3; ++axis)
    if (!(point[axis] >= brick.lower[axis] - brick.largest_radius &&
          point[axis] <= brick.upper[axis] + brick.largest_radius))
      return false;
  return true;
}

/// A⁻¹ d by forward substitution.
glm::dvec3 inFootprint(const SplatGeometry& g, size_t s, const glm::dvec3& d) {
  const double b0 = d.x, b1 = d.y - g.shear10[s] * b0, b2 = d.z - g.shear20[s] * b0 - g.shear21[s] * b1;
  return {b0 / g.axis0[s], b1 / g.axis1[s], b2 / g.axis2[s]};
}

/// Whether a point at `offset` from a splat's centre, in its footprint, is beyond the border where the splat's cell ends. Walls that
/// bend are not the code's planes, so a point within a quarter of a cell beyond it counts as inside.
bool isBeyondBorder(uint32_t border_code, const glm::dvec3& offset) {
  constexpr double kTolerance = 0.5;
  if (border_code == kNoBorder) return false;
  const InwardAxes inward = inwardAxes(border_code);
  for (int n = 0; n < inward.count; ++n)
    if (glm::dot(glm::dvec3(inward.axis[static_cast<size_t>(n)]), offset) < -inward.distance - kTolerance)
      return true;
  return false;
}

/// The nearest splat of a block.
struct NearestOfBlock {
  ReachingSample sample;
  bool is_beyond = false;  // isBeyondBorder()
};

/// The facts about a point so far.
struct Probed {
  std::optional<ProbeResult> nearest;
  std::vector<NearestOfBlock> near;  // [block that has a splat there]
  double weights = 0;
  std::vector<double> values;  // [variable]: sums by weight
};

/// The sample of a splat, as the files' grid has it.
ReachingSample sampleOf(const CacheReader& reader, std::span<const NodeRun> runs, uint32_t splat) {
  const Manifest& manifest = reader.manifest();
  uint64_t first = 0;
  for (const NodeRun& run : runs) {
    if (splat < first + run.count) {
      if (run.block >= manifest.blocks.size())
        throw Error("{}: is damaged: a brick has nodes of block {}, and there are {}", reader.path().string(),
                    run.block + 1, manifest.blocks.size());
      const std::array<uint64_t, 3> index{run.i + (splat - first), run.j, run.k};
      if (manifest.isMesh()) return {run.block, index[0], index[1], 0};
      const auto [i, j, k] = manifest.cells ? manifest.refinement.cellInFiles(run.block, index)
                                            : manifest.refinement.nodeInFiles(run.block, index);
      return {run.block, i, j, k};
    }
    first += run.count;
  }
  return {};
}

/// A leaf, decoded.
struct Leaf {
  uint32_t number;
  SplatGeometry geometry;
  std::vector<NodeRun> runs;
  std::vector<SplatVariable> variables;
};

void addSplat(const CacheReader& reader, const Leaf& leaf, uint32_t s, const glm::dvec3& centre,
              const glm::dvec3& point, Probed& probed) {
  const glm::dvec3 offset = inFootprint(leaf.geometry, s, point - centre);
  const double distance = glm::length(offset);
  if (!(distance < kKernelSupport)) return;
  const double inside = 1 - distance * distance / (kKernelSupport * kKernelSupport), weight = inside * inside;
  const bool is_nearest = !probed.nearest || distance < probed.nearest->distance;
  ReachingSample sample = sampleOf(reader, leaf.runs, s);
  sample.distance = distance;
  const bool is_beyond = isBeyondBorder(leaf.geometry.border_code[s], offset);
  const auto of_block =
      std::find_if(probed.near.begin(), probed.near.end(),
                   [&](const NearestOfBlock& other) { return other.sample.block == sample.block; });
  if (of_block == probed.near.end())
    probed.near.push_back({sample, is_beyond});
  else if (distance < of_block->sample.distance)
    *of_block = {sample, is_beyond};
  if (is_nearest) {
    probed.nearest =
        ProbeResult{leaf.number, s, sample.block, sample.i, sample.j, sample.k, centre, distance, {}, {}};
    probed.nearest->variables.resize(leaf.variables.size());
  }
  probed.weights += weight;
  for (size_t v = 0; v < leaf.variables.size(); ++v) {
    const SplatVariable& values = leaf.variables[v];
    const glm::dvec3 slope(values.slope0[s], values.slope1[s], values.slope2[s]);
    probed.values[v] += weight * (values.mean[s] + glm::dot(slope, offset));
    if (is_nearest) probed.nearest->variables[v].mean = values.mean[s];
  }
}

/// The result from what is known of a point: nothing where no splat reaches it.
std::optional<ProbeResult> resultOf(const CacheReader& reader, std::span<const size_t> variables,
                                    Probed&& probed) {
  if (!probed.nearest) return std::nullopt;
  ProbeResult result = std::move(*probed.nearest);
  result.is_beyond = std::all_of(probed.near.begin(), probed.near.end(),
                                 [](const NearestOfBlock& block) { return block.is_beyond; });
  for (const NearestOfBlock& block : probed.near) result.near.push_back(block.sample);
  std::sort(result.near.begin(), result.near.end(),
            [](const ReachingSample& a, const ReachingSample& b) { return a.distance < b.distance; });
  if (probed.weights == 0) return result;
  for (size_t v = 0; v < variables.size(); ++v) {
    // Slopes lead beyond the data's values where a splat's samples are on one side of the point.
    const VariableInfo& variable = reader.manifest().variables[variables[v]];
    result.variables[v].value = static_cast<float>(
        std::clamp(probed.values[v] / probed.weights, variable.min, std::max(variable.min, variable.max)));
  }
  return result;
}

}  // namespace

std::vector<std::optional<ProbeResult>> probeAll(const CacheReader& reader, std::span<const size_t> variables,
                                                 std::span<const glm::dvec3> points) {
  std::vector<Probed> probed(points.size());
  for (Probed& of_point : probed) of_point.values.resize(variables.size());
  const auto bricks = reader.bricks();
  Leaf leaf;
  leaf.variables.resize(variables.size());
  for (uint32_t n = 0; n < bricks.size(); ++n) {
    if (!bricks[n].isLeaf()) continue;
    std::vector<size_t> near;
    for (size_t p = 0; p < points.size(); ++p)
      if (reaches(bricks[n], points[p])) near.push_back(p);
    if (near.empty()) continue;
    // By x, so that a splat meets those alone that it may reach.
    std::sort(near.begin(), near.end(), [&](size_t a, size_t b) { return points[a].x < points[b].x; });
    leaf.number = n;
    reader.readGeometry(n, leaf.geometry, &leaf.runs);
    for (size_t v = 0; v < variables.size(); ++v) reader.readVariable(n, variables[v], leaf.variables[v]);
    const glm::dvec3 corner = reader.manifest().root.cellMin(bricks[n].cell);
    for (uint32_t s = 0; s < leaf.geometry.size(); ++s) {
      const SplatGeometry& g = leaf.geometry;
      const glm::dvec3 centre = corner + glm::dvec3(g.x[s], g.y[s], g.z[s]);
      const double reach = kKernelSupport * g.axis0[s];
      auto at = std::lower_bound(near.begin(), near.end(), centre.x - reach,
                                 [&](size_t p, double x) { return points[p].x < x; });
      for (; at != near.end() && points[*at].x <= centre.x + reach; ++at)
        addSplat(reader, leaf, s, centre, points[*at], probed[*at]);
    }
  }
  std::vector<std::optional<ProbeResult>> results;
  results.reserve(points.size());
  for (Probed& of_point : probed) results.push_back(resultOf(reader, variables, std::move(of_point)));
  return results;
}

std::optional<ProbeResult> probe(const CacheReader& reader, std::span<const size_t> variables,
                                 const glm::dvec3& point) {
  return std::move(probeAll(reader, variables, {&point, 1}).front());
}

}  // namespace curvisplat
