// The nodes of a window of a block, and which of their neighbours along i, j and k are there.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>

namespace curvisplat {

/// Where a node's neighbours are, counted in elements of NodeArrays. A missing neighbour is the node itself:
/// half the difference of the two is then the Jacobian's column in every case.
struct Neighbours {
  std::array<ptrdiff_t, 3> before{}, after{};  // along i, j, k; <= 0 and >= 0
};

/// Views of NodeArrays.
struct NodeLattice {
  const double *x = nullptr, *y = nullptr, *z = nullptr;
  const uint8_t* blank = nullptr;

  glm::dvec3 position(ptrdiff_t at) const { return {x[at], y[at], z[at]}; }

  /// The smallest distance > 0 to a neighbour; 0 if there is none.
  double spacing(ptrdiff_t at, const Neighbours& neighbours) const {
    double smallest = std::numeric_limits<double>::infinity();
    for (const auto& offsets : {neighbours.before, neighbours.after}) {
      for (const ptrdiff_t offset : offsets) {
        const double distance = glm::distance(position(at + offset), position(at));
        if (distance > 0) smallest = std::min(smallest, distance);
      }
    }
    return std::isfinite(smallest) ? smallest : 0.0;
  }
};

/// How far a cell's middle lies beside the line through its column, where the grid line bends at the node: the
/// cell's two halves go straight to either neighbour, `before` and `after` away, and weigh as much as they are
/// long.
inline glm::dvec3 asideOf(const glm::dvec3& to_before, const glm::dvec3& to_after, double before,
                          double after) {
  if (!(before + after > 0)) return glm::dvec3(0.0);
  const double share = before / (before + after);
  return 0.25 * (share * to_after - (1 - share) * to_before);
}

}  // namespace curvisplat
