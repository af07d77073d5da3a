#include "preprocess/splats/coincidence_sweep.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

namespace curvisplat {
namespace {

// Orthogonal, of length one, and along no axis, plane or diagonal that a grid would choose: the faces of a
// block do not fall together under them.
const glm::dvec3 kAlong = glm::normalize(glm::dvec3(0.8414709848, 0.3472963553, 0.4142135624));
const glm::dvec3 kAcross =
    glm::normalize(glm::cross(kAlong, glm::dvec3(0.2360679775, 0.7320508076, -0.5772156649)));

/// How far from a node another may lie that is the same point. Half the spacing would let two neighbours meet
/// at a third node between them.
double toleranceOf(const NodeSplat& node, int coordinate_bytes) {
  const double rounding = coordinateRounding(node.node_position, coordinate_bytes);
  return std::max(1e-3 * node.spacing, std::min(rounding, 0.4 * node.spacing));
}

/// What rounding may do to `along` and `across`.
double slackOf(const NodeSplat& node) {
  const glm::dvec3 size = glm::abs(node.node_position);
  return 4 * std::numeric_limits<double>::epsilon() * (size.x + size.y + size.z);
}

}  // namespace

SeamNode seamNodeOf(const NodeSplat& splat) {
  return {glm::dot(kAlong, splat.node_position), glm::dot(kAcross, splat.node_position), splat};
}

double coordinateRounding(const glm::dvec3& position, int coordinate_bytes) {
  const glm::dvec3 size = glm::abs(position);
  const double largest = std::max({size.x, size.y, size.z});
  const int digits =
      coordinate_bytes == 4 ? std::numeric_limits<float>::digits : std::numeric_limits<double>::digits;
  return largest > 0 ? std::ldexp(4.0, std::ilogb(largest) - (digits - 1)) : 0.0;
}

CoincidenceSweep::CoincidenceSweep(int coordinate_bytes, UnlikeHalves unlike, Sink sink)
    : coordinate_bytes_(coordinate_bytes), unlike_(unlike), sink_(std::move(sink)) {}

void CoincidenceSweep::add(const SeamNode& node, std::span<const SplatScalar> values) {
  release(node.along);
  const double tolerance = toleranceOf(node.splat, coordinate_bytes_);
  auto cluster = find(node, tolerance);
  if (cluster == clusters_.end()) {
    cluster =
        clusters_.emplace(node.across, Cluster{node.splat.node_position, tolerance, JointNodes(unlike_)});
    leaving_.push({node.along + tolerance + slackOf(node.splat), sequence_++, cluster});
  }
  cluster->second.nodes.add(node.splat, values);
}

/// The cluster of the nearest leader that is within the tolerance of both.
CoincidenceSweep::Clusters::iterator CoincidenceSweep::find(const SeamNode& node, double tolerance) {
  const double reach = tolerance + slackOf(node.splat);
  auto nearest = clusters_.end();
  double nearest_distance = tolerance;
  for (auto at = clusters_.lower_bound(node.across - reach);
       at != clusters_.end() && at->first <= node.across + reach; ++at) {
    const double distance = glm::distance(at->second.leader, node.splat.node_position);
    if (distance > at->second.tolerance || distance > nearest_distance) continue;
    if (distance == nearest_distance && nearest != clusters_.end()) continue;
    nearest = at;
    nearest_distance = distance;
  }
  return nearest;
}

/// Gives out the clusters that no node from `before` on can join.
void CoincidenceSweep::release(double before) {
  while (!leaving_.empty() && leaving_.top().after < before) {
    const auto at = leaving_.top().cluster;
    leaving_.pop();
    sink_(at->second.nodes);
    clusters_.erase(at);
  }
}

void CoincidenceSweep::finish() {
  release(std::numeric_limits<double>::infinity());
}

}  // namespace curvisplat
