#include "preprocess/seams.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <optional>
#include <queue>
#include <utility>
#include <vector>

#include "preprocess/merge.h"
#include "preprocess/seam_sorter.h"

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
  const glm::dvec3 size = glm::abs(node.node_position);
  const double largest = std::max({size.x, size.y, size.z});
  const int digits =
      coordinate_bytes == 4 ? std::numeric_limits<float>::digits : std::numeric_limits<double>::digits;
  const double rounding = largest > 0 ? std::ldexp(4.0, std::ilogb(largest) - (digits - 1)) : 0.0;
  return std::max(1e-3 * node.spacing, std::min(rounding, 0.4 * node.spacing));
}

/// What rounding may do to `along` and `across`.
double slackOf(const NodeSplat& node) {
  const glm::dvec3 size = glm::abs(node.node_position);
  return 4 * std::numeric_limits<double>::epsilon() * (size.x + size.y + size.z);
}

/// Takes the nodes in the order of `along` and gathers those that coincide with the first of them, the
/// leader. A cluster leaves as soon as the sweep has passed its leader's tolerance, so the window is narrow;
/// within it, leaders are found by `across`.
class Sweep {
 public:
  /// Gets the merged splat, its values, and the nodes that it is merged of; none if it is of one.
  using Sink = std::function<void(const NodeSplat&, std::span<const SplatScalar>, std::span<const uint64_t>)>;

  Sweep(size_t variables, int coordinate_bytes, const Sink& sink)
      : variables_(variables), coordinate_bytes_(coordinate_bytes), sink_(sink) {}

  void add(const SeamNode& node, std::span<const SplatScalar> values);
  void release(double before);
  uint64_t merged() const { return merged_; }

 private:
  struct Cluster {
    glm::dvec3 leader;  // position
    double tolerance;
    NodeSplat lowest;  // the node of the lowest number
    std::vector<SplatScalar> values;
    std::optional<SplatMerger> merger;  // from the second node on
    std::vector<uint64_t> nodes;        // the same
  };
  using Clusters = std::multimap<double, Cluster>;  // by `across` of the leader

  struct Leaving {
    double after;       // of `along`
    uint64_t sequence;  // of the leader
    Clusters::iterator cluster;
    bool operator<(const Leaving& other) const {  // the first to leave is the queue's largest
      return after != other.after ? after > other.after : sequence > other.sequence;
    }
  };

  Clusters::iterator find(const SeamNode& node, double tolerance);
  void join(Cluster& cluster, const NodeSplat& node, std::span<const SplatScalar> values);

  size_t variables_;
  int coordinate_bytes_;
  const Sink& sink_;
  Clusters clusters_;
  std::priority_queue<Leaving> leaving_;
  uint64_t sequence_ = 0;
  uint64_t merged_ = 0;
};

void Sweep::add(const SeamNode& node, std::span<const SplatScalar> values) {
  release(node.along);
  const double tolerance = toleranceOf(node.splat, coordinate_bytes_);
  const auto found = find(node, tolerance);
  if (found != clusters_.end()) return join(found->second, node.splat, values);
  const auto cluster = clusters_.emplace(
      node.across,
      Cluster{
          node.splat.node_position, tolerance, node.splat, {values.begin(), values.end()}, std::nullopt, {}});
  leaving_.push({node.along + tolerance + slackOf(node.splat), sequence_++, cluster});
}

/// The cluster of the nearest leader that is within the tolerance of both.
Sweep::Clusters::iterator Sweep::find(const SeamNode& node, double tolerance) {
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

void Sweep::join(Cluster& cluster, const NodeSplat& node, std::span<const SplatScalar> values) {
  if (!cluster.merger) {
    cluster.merger.emplace(variables_);
    cluster.merger->add(cluster.lowest.splat.position, cluster.lowest.splat, cluster.values);
    cluster.nodes.push_back(cluster.lowest.node);
  }
  cluster.nodes.push_back(node.node);
  cluster.merger->add(node.splat.position, node.splat, values);
  if (node.node < cluster.lowest.node) cluster.lowest = node;
  ++merged_;
}

/// Gives out the clusters that no node from `before` on can join.
void Sweep::release(double before) {
  while (!leaving_.empty() && leaving_.top().after < before) {
    const auto at = leaving_.top().cluster;
    leaving_.pop();
    Cluster& cluster = at->second;
    if (cluster.merger) {
      cluster.merger->finish(cluster.lowest.splat, cluster.values);
      cluster.lowest.regular = false;
    }
    sink_(cluster.lowest, cluster.values, cluster.nodes);
    clusters_.erase(at);
  }
}

}  // namespace

struct SeamMerger::State {
  size_t variables;
  SeamSorter sorter;

  uint64_t sweep(int coordinate_bytes, const Sweep::Sink& sink) {
    Sweep sweep(variables, coordinate_bytes, sink);
    sorter.drain([&](const SeamNode& node, std::span<const SplatScalar> values) { sweep.add(node, values); });
    sweep.release(std::numeric_limits<double>::infinity());
    return sweep.merged();
  }
};

SeamMerger::SeamMerger(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder)
    : state_(new State{variables, SeamSorter(variables, memory_bytes, std::move(temporary_folder))}) {}
SeamMerger::~SeamMerger() = default;
SeamMerger::SeamMerger(SeamMerger&&) noexcept = default;
SeamMerger& SeamMerger::operator=(SeamMerger&&) noexcept = default;

void SeamMerger::add(const NodeSplat& splat, std::span<const SplatScalar> values) {
  state_->sorter.add({glm::dot(kAlong, splat.node_position), glm::dot(kAcross, splat.node_position), splat},
                     values);
}

uint64_t SeamMerger::finish(int coordinate_bytes,
                            const std::function<void(const NodeSplat&, std::span<const SplatScalar>)>& sink) {
  return state_->sweep(coordinate_bytes, [&](const NodeSplat& splat, std::span<const SplatScalar> values,
                                             std::span<const uint64_t>) { sink(splat, values); });
}

void SeamMerger::forEachSet(int coordinate_bytes,
                            const std::function<void(std::span<const uint64_t>)>& visit) {
  std::vector<uint64_t> rising;
  state_->sweep(coordinate_bytes,
                [&](const NodeSplat&, std::span<const SplatScalar>, std::span<const uint64_t> nodes) {
                  if (nodes.empty()) return;
                  rising.assign(nodes.begin(), nodes.end());
                  std::sort(rising.begin(), rising.end());
                  visit(rising);
                });
}

}  // namespace curvisplat
