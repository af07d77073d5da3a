// What is at a point: the value there, and the node that it comes from. For `info --probe`.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "stream/cache/cache_reader.h"

namespace curvisplat {

struct ProbeVariable {
  float mean = 0;   // of the node's splat
  float value = 0;  // at the point, by the splat's slope
};

struct ProbeResult {
  uint32_t brick = 0;  // in reader.bricks(): a leaf
  uint32_t splat = 0;
  uint32_t block = 0;  // the node: all from 0
  uint64_t i = 0, j = 0, k = 0;
  glm::dvec3 centre{0.0};  // world units
  double distance = 0;     // |A⁻¹(x - μ)|: 0 at the centre, 1.556 at the end of the footprint
  std::vector<ProbeVariable> variables;  // as asked for
};

/// The finest level's splat that is nearest to `point` in its own measure, or nothing if the point is in no
/// splat's footprint. Decodes the leaves that reach the point. Throws Error as reading does.
std::optional<ProbeResult> probe(const CacheReader& reader, std::span<const size_t> variables,
                                 const glm::dvec3& point);

}  // namespace curvisplat
