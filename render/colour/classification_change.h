// How much a transfer function changes around the values of a brick: what a picture may lose where splats know the
// scalar only to within a deviation. DESIGN.md, "The cut".
//
// Changes are kept for windows of 2, 4, 8, ... cells of the classification table. They take 90 KiB and well under a
// millisecond to find. Immutable; any thread.
#pragma once

#include <utility>
#include <vector>

#include "render/colour/classification.h"

namespace curvisplat {

class ClassificationChange {
 public:
  explicit ClassificationChange(const ClassificationTable& table);

  /// A bound of the change, per world unit, of colour times extinction or of extinction, whichever component changes more,
  /// from any scalar in [low, high] to any within `deviation` of it. The function counts as linear between the middles of the
  /// table's cells. Changes within 3 times the deviation and 4 cells may be counted; so a step has all of its height
  /// wherever it may lie. Costs up to a microsecond.
  double largestChange(float low, float high, float deviation) const;
  /// The largest extinction from low to high, and up to two cells further.
  double largestExtinction(float low, float high) const;

 private:
  double cellsOf(double scalar) const;
  /// The elements that [low, high] may lie in; the deviation in cells.
  std::pair<size_t, size_t> elementsOf(float low, float high) const;
  double deviationInCells(float low, float deviation) const;

  // Element 0 is what lies below the table, its cells follow, the last one is what lies above. Level n has blocks of
  // 2ⁿ elements: the change within each block and two blocks on either side.
  std::vector<std::vector<float>> changes_;
  std::vector<float> extinctions_;
  bool log_scale_;
  double scale_, bias_;
};

}  // namespace curvisplat
