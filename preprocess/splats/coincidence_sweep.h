// Finds the nodes of block faces that coincide, by a sweep along one generic direction: nodes arrive in the order of
// their positions along it, so those that can still coincide with others are a narrow window.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <queue>
#include <span>

#include "preprocess/splats/joint_nodes.h"
#include "preprocess/splats/seam_sorter.h"

namespace curvisplat {

/// A node with its position along the sweep's directions.
SeamNode seamNodeOf(const NodeSplat& splat);

/// What rounding may have done to a coordinate, in world units: 4 units in the last place of the largest, as
/// stored in `coordinate_bytes`.
double coordinateRounding(const glm::dvec3& position, int coordinate_bytes);

/// Not for several threads at once.
class CoincidenceSweep {
 public:
  using Sink = std::function<void(JointNodes&)>;

  /// `sink` gets each set of nodes that coincide once no other node can join it. Two nodes coincide if
  /// they lie within the tolerance of both: 1e-3 of the node's spacing, or the rounding of its coordinates (4
  /// units in the last place, for coordinates of `coordinate_bytes` bytes) but then at most 0.4 of its spacing,
  /// so that neighbours along a grid line never coincide, however thin the boundary layer, unless they are one
  /// point.
  CoincidenceSweep(int coordinate_bytes, UnlikeHalves unlike, Sink sink);

  /// In rising order of `along`.
  void add(const SeamNode& node, std::span<const SplatScalar> values);
  /// Gives out all sets that are left.
  void finish();

 private:
  struct Cluster {
    glm::dvec3 leader;  // position of the first node, which the others coincide with
    double tolerance;
    JointNodes nodes;
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
  void release(double before);

  const int coordinate_bytes_;
  const UnlikeHalves unlike_;
  const Sink sink_;
  Clusters clusters_;
  std::priority_queue<Leaving> leaving_;
  uint64_t sequence_ = 0;
};

}  // namespace curvisplat
