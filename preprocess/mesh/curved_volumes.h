// The volumes of the parts into which a curved cell is cut, by its own polynomial: a part is flat, and the cell is not. The
// determinant of the polynomial's derivatives is integrated by Gauss' rules: of complete hexahedra of any order with three
// points along each part and axis, one axis after the other; of other cells of lower orders with five points in each of a part's
// tetrahedra, 64 where they are rational. Pure: any thread.
#pragma once

#include <glm/vec3.hpp>

#include <memory>
#include <span>
#include <vector>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

class CurvedVolumes {
 public:
  virtual ~CurvedVolumes() = default;
  /// Sets out[part] of a cell with these nodes, without sign. `weights`: those of a rational polynomial at the nodes; empty: all are 1.
  virtual void measure(std::span<const glm::dvec3> nodes, std::span<const double> weights,
                       std::span<double> out) const = 0;
};

/// Null where parts count as flat: of pyramids, and of orders whose tables would be large. Made once. Thread-safe.
const CurvedVolumes* volumesOf(CellKind shape, CellCurve curve, bool rational = false);

}  // namespace curvisplat
