// Finds the nodes of block faces that coincide, by a sweep along one generic direction: nodes arrive in the
// order of their positions along it, so those that can still coincide with others are a narrow window.
// coincidenceRanges() divides a sweep over sorted nodes into ranges that several threads sweep at the same
// time: no two nodes that may coincide are in different ranges, so the sets are those of one sweep over
// all.
//
// Classes are not for several threads at once; free functions are pure.
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <queue>
#include <vector>

#include "preprocess/coincidence/record_sorter.h"

namespace curvisplat {

/// A node's position along the sweep's directions.
struct SeamPosition {
  double along = 0, across = 0;
};
SeamPosition seamPosition(const glm::dvec3& position);

/// The error that rounding may have made in a coordinate, in world units: 4 units in the last place of the
/// largest, as stored in `coordinate_bytes`.
double coordinateRounding(const glm::dvec3& position, int coordinate_bytes);

/// The facts that decide whether a node coincides with others.
struct SweptNode {
  SeamPosition sweep;
  glm::dvec3 position{0.0};
  double spacing = 0;  // NodeSplat's
};

/// How far behind a node, along the sweep, another may lie that coincides with it.
double reachOf(const SweptNode& node, int coordinate_bytes);

/// The sweep over one range, in memory in proportion to the window.
class CoincidenceSweep {
 public:
  /// Gets the number of a set.
  using Sink = std::function<void(size_t)>;

  /// `sink` gets each set of nodes that coincide once no other node can join it. Two nodes coincide if they
  /// lie within the tolerance of both: 1e-3 of the node's spacing, or the rounding of its coordinates (4
  /// units in the last place, for coordinates of `coordinate_bytes` bytes) but then at most 0.4 of its
  /// spacing. So neighbours along a grid line never coincide, however thin the boundary layer, unless they
  /// have one position.
  CoincidenceSweep(int coordinate_bytes, Sink sink);

  /// Adds the next node, in rising order of `along`. Returns the number of the node's set, counted from 0.
  /// Once the sink has got a set, its number is used again.
  size_t add(const SweptNode& node);
  /// Passes all remaining sets to the sink.
  void finish();

 private:
  struct Cluster {
    glm::dvec3 leader{0.0};  // position of the first node, which the others coincide with
    double tolerance = 0;
    size_t set = 0;
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

  Clusters::iterator find(const SweptNode& node, double tolerance);
  Clusters::iterator newCluster(const SweptNode& node, double tolerance);
  void release(double before);

  const int coordinate_bytes_;
  const Sink sink_;
  Clusters clusters_;
  std::vector<Clusters::node_type> unused_;  // of clusters that have left, with their sets' numbers
  size_t sets_ = 0;
  std::priority_queue<Leaving> leaving_;
  uint64_t sequence_ = 0;
};

/// A bound of reachOf(): no node that was added reaches further.
class LargestReach {
 public:
  void add(const glm::dvec3& position, double spacing);
  void add(const LargestReach& other);
  double of(int coordinate_bytes) const;

 private:
  double coordinate_ = 0, spacing_ = 0;
};

/// The records with from <= along < to.
struct SweepRange {
  double from, to;
};

/// Gives the node of a record.
using SweptOf = std::function<SweptNode(const double* record)>;

/// About `parts` ranges, or fewer, that together are all records of `sorted`, which sort() has been called
/// of.
std::vector<SweepRange> coincidenceRanges(const RecordSorter& sorted, size_t parts, const SweptOf& swept_of,
                                          const LargestReach& reach, int coordinate_bytes);

}  // namespace curvisplat
