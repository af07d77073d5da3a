// Divides a sweep over sorted nodes into ranges that several threads sweep at the same time. No two nodes that may coincide
// are in different ranges, so the sets are those of one sweep over all.
#pragma once

#include <cstddef>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/splats/coincidence_sweep.h"
#include "preprocess/splats/record_sorter.h"

namespace curvisplat {

/// No node that was added reaches further. Not for several threads at once.
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

/// About `parts` ranges, or fewer, that together are all records of `sorted`, which sort() has been called of.
std::vector<SweepRange> coincidenceRanges(const RecordSorter& sorted, size_t parts, const SweptOf& swept_of,
                                          const LargestReach& reach, int coordinate_bytes);

}  // namespace curvisplat
