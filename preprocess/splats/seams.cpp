#include "preprocess/splats/seams.h"

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

#include "preprocess/splats/merge.h"
#include "preprocess/splats/open_borders.h"
#include "preprocess/splats/seam_sorter.h"

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

/// How the scalars bend from one part of a node's cell to another, once the node is whole again. A half cell
/// knows no second difference along its short axis (node_splats.h), and its parts' means make an eighth of it
/// where a tenth is right; the rest is taken off, and so is the variance that is this bend's alone. The node
/// is then as if its block had never been cut.
class BendOfParts {
 public:
  explicit BendOfParts(size_t variables) : sums_(variables) {}

  /// `offset`: of the part's middle, from any point that is common to all.
  void add(const Splat& splat, const glm::dvec3& offset, std::span<const SplatScalar> values) {
    weight_ += splat.weight;
    middle_ += splat.weight * offset;
    for (size_t v = 0; v < sums_.size(); ++v) {
      const glm::dvec3 gradient = gradientOf(splat, values[v].slope);
      sums_[v].along += splat.weight * glm::dot(gradient, offset);
      sums_[v].gradient += splat.weight * gradient;
    }
  }

  void correct(std::span<SplatScalar> merged) const {
    if (!(weight_ > 0)) return;
    for (size_t v = 0; v < sums_.size(); ++v) {
      // Two halves, with a scalar's second difference b: b / 8, and b² / 192 is what they add to the
      // variance.
      const double eighth = (sums_[v].along - glm::dot(sums_[v].gradient, middle_) / weight_) / weight_;
      merged[v].mean -= (1 - 8 * kBend) * eighth;
      merged[v].variance = std::max(0.0, merged[v].variance - eighth * eighth / 3);
    }
  }

 private:
  /// A⁻ᵀ w, by backward substitution: the change per world unit.
  static glm::dvec3 gradientOf(const Splat& splat, const glm::dvec3& w) {
    const auto& [l10, l20, l21] = splat.shear;
    const double g2 = w.z / splat.axis[2];
    const double g1 = w.y / splat.axis[1] - l21 * g2;
    return {w.x / splat.axis[0] - l10 * g1 - l20 * g2, g1, g2};
  }

  struct Sums {
    double along = 0;
    glm::dvec3 gradient{0.0};
  };
  double weight_ = 0;
  glm::dvec3 middle_{0.0};
  std::vector<Sums> sums_;
};

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
    std::optional<SplatMerger> merger;   // from the second node on
    std::optional<BendOfParts> bend;     // the same
    std::optional<OpenBorders> borders;  // the same
    std::vector<uint64_t> nodes;         // the same
    struct Behind {
      NodeSplat node;
      std::vector<SplatScalar> values;
    };
    std::vector<Behind> behind;  // in the layer behind the face
    bool has_node = true;        // else there are none but those
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
  const bool behind = node.splat.behind_face;
  const auto cluster = clusters_.emplace(node.across, Cluster{node.splat.node_position,
                                                              tolerance,
                                                              node.splat,
                                                              {values.begin(), values.end()},
                                                              std::nullopt,
                                                              std::nullopt,
                                                              std::nullopt,
                                                              {},
                                                              {},
                                                              !behind});
  if (behind) cluster->second.behind.push_back({node.splat, {values.begin(), values.end()}});
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
  if (node.behind_face) {
    cluster.behind.push_back({node, {values.begin(), values.end()}});
    return;
  }
  if (!cluster.has_node) {
    cluster.lowest = node;
    cluster.values.assign(values.begin(), values.end());
    cluster.has_node = true;
    return;
  }
  if (!cluster.merger) {
    cluster.merger.emplace(variables_);
    cluster.merger->add(cluster.lowest.splat.position, cluster.lowest.splat, cluster.values);
    cluster.bend.emplace(variables_);
    cluster.bend->add(cluster.lowest.splat, cluster.lowest.splat.position - cluster.leader, cluster.values);
    cluster.borders.emplace().add(cluster.lowest.splat, cluster.lowest.border_code);
    cluster.nodes.push_back(cluster.lowest.node);
  }
  cluster.nodes.push_back(node.node);
  cluster.merger->add(node.splat.position, node.splat, values);
  cluster.bend->add(node.splat, node.splat.position - cluster.leader, values);
  cluster.borders->add(node.splat, node.border_code);
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
      cluster.bend->correct(cluster.values);
      cluster.lowest.border_code = cluster.borders->of(cluster.lowest.splat);
      cluster.lowest.regular = false;
    }
    if (cluster.has_node) sink_(cluster.lowest, cluster.values, cluster.nodes);
    for (Cluster::Behind& behind : cluster.behind) {
      if (!cluster.has_node || !isOpen(cluster.lowest.splat, cluster.lowest.border_code, behind.node.splat))
        behind.node.border_code = kNoBorder;
      sink_(behind.node, behind.values, {});
    }
    clusters_.erase(at);
  }
}

}  // namespace

double coordinateRounding(const glm::dvec3& position, int coordinate_bytes) {
  const glm::dvec3 size = glm::abs(position);
  const double largest = std::max({size.x, size.y, size.z});
  const int digits =
      coordinate_bytes == 4 ? std::numeric_limits<float>::digits : std::numeric_limits<double>::digits;
  return largest > 0 ? std::ldexp(4.0, std::ilogb(largest) - (digits - 1)) : 0.0;
}

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
