#include "preprocess/coincidence/coincidence_sweep.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

namespace curvisplat {
namespace {

// Orthogonal, of length one, and along no axis, plane or diagonal that a grid would choose: the faces of a
// block do not fall together under them.
const glm::dvec3 kSweepAxis = glm::normalize(glm::dvec3(0.8414709848, 0.3472963553, 0.4142135624));
const glm::dvec3 kAcross =
    glm::normalize(glm::cross(kSweepAxis, glm::dvec3(0.2360679775, 0.7320508076, -0.5772156649)));

/// How far from a node another may lie that is the same point. Half the spacing would let two neighbours
/// meet at a third node between them.
double toleranceOf(const SweptNode& node, int coordinate_bytes) {
  const double rounding = coordinateRounding(node.position, coordinate_bytes);
  return std::max(1e-3 * node.spacing, std::min(rounding, 0.4 * node.spacing));
}

/// The error that rounding may make in `along` and `across`.
double slackOf(const SweptNode& node) {
  const glm::dvec3 size = glm::abs(node.position);
  return 4 * std::numeric_limits<double>::epsilon() * (size.x + size.y + size.z);
}

}  // namespace

SeamPosition seamPosition(const glm::dvec3& position) {
  return {glm::dot(kSweepAxis, position), glm::dot(kAcross, position)};
}

double coordinateRounding(const glm::dvec3& position, int coordinate_bytes) {
  const glm::dvec3 size = glm::abs(position);
  const double largest = std::max({size.x, size.y, size.z});
  const int digits =
      coordinate_bytes == 4 ? std::numeric_limits<float>::digits : std::numeric_limits<double>::digits;
  // Computes the exponent's bits: std::ilogb() and std::ldexp() are slow.
  constexpr int kMantissaBits = 52;
  const uint64_t power = std::bit_cast<uint64_t>(largest) >> kMantissaBits;
  if (power > static_cast<uint64_t>(digits) && std::isfinite(largest))
    return 4 * std::bit_cast<double>((power - static_cast<uint64_t>(digits - 1)) << kMantissaBits);
  return largest > 0 ? std::ldexp(4.0, std::ilogb(largest) - (digits - 1)) : 0.0;
}

double reachOf(const SweptNode& node, int coordinate_bytes) {
  return toleranceOf(node, coordinate_bytes) + slackOf(node);
}

CoincidenceSweep::CoincidenceSweep(int coordinate_bytes, Sink sink)
    : coordinate_bytes_(coordinate_bytes), sink_(std::move(sink)) {}

size_t CoincidenceSweep::add(const SweptNode& node) {
  release(node.sweep.along);
  const double tolerance = toleranceOf(node, coordinate_bytes_);
  auto cluster = find(node, tolerance);
  if (cluster == clusters_.end()) {
    cluster = newCluster(node, tolerance);
    leaving_.push({node.sweep.along + tolerance + slackOf(node), sequence_++, cluster});
  }
  return cluster->second.set;
}

CoincidenceSweep::Clusters::iterator CoincidenceSweep::newCluster(const SweptNode& node, double tolerance) {
  if (unused_.empty())
    return clusters_.emplace(node.sweep.across, Cluster{node.position, tolerance, sets_++});
  Clusters::node_type cluster = std::move(unused_.back());
  unused_.pop_back();
  cluster.key() = node.sweep.across;
  cluster.mapped() = {node.position, tolerance, cluster.mapped().set};
  return clusters_.insert(std::move(cluster));
}

/// The cluster of the nearest leader that is within the tolerance of both.
CoincidenceSweep::Clusters::iterator CoincidenceSweep::find(const SweptNode& node, double tolerance) {
  const double reach = tolerance + slackOf(node);
  auto nearest = clusters_.end();
  double nearest_distance = tolerance;
  for (auto at = clusters_.lower_bound(node.sweep.across - reach);
       at != clusters_.end() && at->first <= node.sweep.across + reach; ++at) {
    const double distance = glm::distance(at->second.leader, node.position);
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
    sink_(at->second.set);
    unused_.push_back(clusters_.extract(at));
  }
}

void CoincidenceSweep::finish() {
  release(std::numeric_limits<double>::infinity());
}

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Takes nodes in the order of the sweep, and finds a place from `least` on that parts no two which may
/// coincide.
class CutSearch {
 public:
  CutSearch(double least, int coordinate_bytes) : least_(least), coordinate_bytes_(coordinate_bytes) {}

  /// Returns whether more nodes are needed.
  bool add(const SweptNode& node) {
    const double along = node.sweep.along;
    std::erase_if(before_, [&](const Reaching& other) { return other.until < along; });
    const Reaching added{node.position, along, along + reachOf(node, coordinate_bytes_)};
    if (along < least_ || std::any_of(before_.begin(), before_.end(),
                                      [&](const Reaching& other) { return mayCoincide(other, added); })) {
      before_.insert(before_.end(), behind_.begin(), behind_.end());
      behind_.clear();
      before_.push_back(added);
    } else {
      behind_.push_back(added);
    }
    found_ = before_.empty();
    return !found_ && before_.size() + behind_.size() < kMaxNodes;
  }

  /// Infinite if there is none.
  double cut() const { return found_ ? behind_.front().along : kInfinity; }

 private:
  static constexpr size_t kMaxNodes = 4096;  // that are looked at together

  struct Reaching {
    glm::dvec3 position;
    double along, until;
  };

  static bool mayCoincide(const Reaching& a, const Reaching& b) {
    const double reach = std::max(a.until - a.along, b.until - b.along);
    return a.along == b.along || glm::distance(a.position, b.position) <= reach;
  }

  const double least_;
  const int coordinate_bytes_;
  std::vector<Reaching> before_, behind_;  // of the cut; those before it that may still reach behind it
  bool found_ = false;
};

}  // namespace

void LargestReach::add(const glm::dvec3& position, double spacing) {
  coordinate_ = std::max({coordinate_, std::abs(position.x), std::abs(position.y), std::abs(position.z)});
  spacing_ = std::max(spacing_, spacing);
}

void LargestReach::add(const LargestReach& other) {
  coordinate_ = std::max(coordinate_, other.coordinate_);
  spacing_ = std::max(spacing_, other.spacing_);
}

double LargestReach::of(int coordinate_bytes) const {
  return reachOf({{}, glm::dvec3(coordinate_), spacing_}, coordinate_bytes);
}

std::vector<SweepRange> coincidenceRanges(const RecordSorter& sorted, size_t parts, const SweptOf& swept_of,
                                          const LargestReach& reach, int coordinate_bytes) {
  std::vector<SweepRange> ranges;
  double from = -kInfinity;
  for (const double least : sorted.cutsInto(parts)) {
    if (least <= from) continue;
    CutSearch search(least, coordinate_bytes);
    sorted.visit(std::max(from, least - reach.of(coordinate_bytes)), kInfinity,
                 [&](const double* record) { return search.add(swept_of(record)); });
    if (search.cut() == kInfinity) continue;
    ranges.push_back({from, search.cut()});
    from = search.cut();
  }
  ranges.push_back({from, kInfinity});
  return ranges;
}

}  // namespace curvisplat
