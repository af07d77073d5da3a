// Finds the sample at a point, and the values there. For `info --probe`, the window, the server and Python.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// A variable at a point.
struct ProbeVariable {
  float mean = 0;  // of the sample's splat, at its centre
  float value =
      0;  // at the point: mean of the linear fields of the splats that reach it, weighted by nearness
};

/// A sample of a block whose splat reaches a point, with its indices in the files' grid. Where the conversion
/// cut cells (Refinement), it is the nearest node, or the cell that was cut; of an unstructured grid, the one of the cut grid.
/// `distance`: as in ProbeResult.
struct ReachingSample {
  uint32_t block = 0;
  uint64_t i = 0, j = 0, k = 0;
  double distance = 0;
};

/// The sample nearest to a point, and the values there.
struct ProbeResult {
  uint32_t brick = 0;  // index in reader.bricks(); a leaf
  uint32_t splat = 0;
  uint32_t block = 0;  // of the node or cell, as in ReachingSample; block, i, j and k count from 0
  uint64_t i = 0, j = 0, k = 0;
  glm::dvec3 centre{0.0};  // of the splat: the middle of the sample's cell, world units
  double distance = 0;     // |A⁻¹(x - μ)|: 0 at the splat's centre, 1.556 at the edge of its support
  std::vector<ProbeVariable> variables;  // in the order of the argument
  std::vector<ReachingSample> near;      // the nearest of each block, the nearest block first
  bool is_beyond = false;  // more than a quarter of a cell beyond the border of every sample in `near`
};

/// [point]: the leaf splat with the smallest `distance` from it; nullopt if no splat's support contains the
/// point. Values are exact where the scalar is linear, and clamped to the manifest's range. Decodes the
/// leaves whose splats may reach a point, each once. `variables`: indices in manifest().variables. Throws as
/// CacheReader.
std::vector<std::optional<ProbeResult>> probeAll(const CacheReader& reader, std::span<const size_t> variables,
                                                 std::span<const glm::dvec3> points);
std::optional<ProbeResult> probe(const CacheReader& reader, std::span<const size_t> variables,
                                 const glm::dvec3& point);

}  // namespace curvisplat
