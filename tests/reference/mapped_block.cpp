#include "tests/reference/mapped_block.h"

#include <glm/geometric.hpp>

#include <cmath>

#include "tests/support/with_corrections.h"

namespace curvisplat {

MappedBlock::MappedBlock(uint64_t ni, uint64_t nj, uint64_t nk, const Mapping& mapping)
    : block{"block", ni, nj, nk, true} {
  for (uint64_t k = 0; k < nk; ++k) {
    for (uint64_t j = 0; j < nj; ++j) {
      for (uint64_t i = 0; i < ni; ++i) {
        const glm::dvec3 p = mapping(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
        nodes.x.push_back(p.x);
        nodes.y.push_back(p.y);
        nodes.z.push_back(p.z);
      }
    }
  }
  nodes.blank.assign(block.nodes(), 0);
}

void MappedBlock::addScalar(const std::function<double(const glm::dvec3&)>& f) {
  auto& values = nodes.scalars.emplace_back();
  for (size_t n = 0; n < block.nodes(); ++n)
    values.push_back(static_cast<float>(f({nodes.x[n], nodes.y[n], nodes.z[n]})));
}

void MappedBlock::roundToFloat() {
  for (auto* values : {&nodes.x, &nodes.y, &nodes.z})
    for (double& value : *values) value = static_cast<float>(value);
}

NodeSplats MappedBlock::splats(const SplatCorrections& corrections, const SplatRules& rules) const {
  const WithCorrections scope({corrections, {}, {}});
  NodeScratch scratch;
  NodeSplats out;
  computeNodeSplats(window(), {0, block.nj, 0, block.nk}, scratch, out, rules);
  return out;
}

double totalWeight(const NodeSplats& splats) {
  double sum = 0;
  for (const NodeSplat& splat : splats.splats) sum += splat.splat.weight;
  return sum;
}

bool allFinite(const NodeSplats& splats) {
  for (const NodeSplat& node : splats.splats) {
    const Splat& s = node.splat;
    for (int n = 0; n < 3; ++n)
      if (!std::isfinite(s.position[n]) || !std::isfinite(s.axis[n]) || !(s.axis[n] > 0) ||
          !std::isfinite(s.shear[n]))
        return false;
    if (!std::isfinite(s.weight) || s.weight < 0 || !std::isfinite(node.spacing)) return false;
  }
  for (const SplatScalar& value : splats.values)
    if (!std::isfinite(value.mean) || !std::isfinite(glm::length(value.slope)) || !(value.variance >= 0))
      return false;
  return true;
}

glm::dmat3 randomRotation(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const auto vector = [&] { return glm::dvec3(normal(random), normal(random), normal(random)); };
  const glm::dvec3 x = glm::normalize(vector());
  const glm::dvec3 y = glm::normalize(glm::cross(x, vector()));
  return {x, y, glm::cross(x, y)};
}

}  // namespace curvisplat
