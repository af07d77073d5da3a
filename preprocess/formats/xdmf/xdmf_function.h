// Values of the cells of an XDMF grid, each with points of its own: functions of finite elements, as FEniCS writes them
// (write_checkpoint: of each cell the numbers of its degrees of freedom, component by component, and the values of all of them),
// and what stands beside them, at nodes.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/xdmf/xdmf_values.h"

namespace curvisplat {

/// Numbers of tetrahedra: indices of `values`, `given` (1, 4 or 10) of each component. Ten are of a polynomial of degree 2.
struct XdmfCellNumbers {
  uint64_t cells = 0, given = 1, components = 1;
  std::shared_ptr<const XdmfValues>
      numbers;            // of nodes: [cell][node], otherwise [cell][component][degree of freedom]
  bool of_nodes = false;  // a node has a tuple of `values`
  double first_node = 0;
  std::shared_ptr<const XdmfValues> values;
  std::string where;  // for messages
};

/// The tuples of cells: one a cell, or of each its 4 corners, or these and the middles of its edges in VTK's order, where a linear
/// function has the mean of the ends. They are spooled at the first read, in one pass. `points`: 1, 4 or 10.
std::shared_ptr<const XdmfValues> xdmfOfCells(const XdmfCellNumbers& cells, uint64_t points,
                                              const std::shared_ptr<SpoolFile>& spool);

/// The tuples at the nodes of a continuous function of degree 1: `corners` are the nodes of its cells, from `first_node` on.
/// They are spooled at the first read, with a pass over all cells for each million of nodes.
std::shared_ptr<const XdmfValues> xdmfAtNodes(const XdmfCellNumbers& cells, uint64_t nodes,
                                              const std::shared_ptr<const XdmfValues>& corners,
                                              const std::shared_ptr<SpoolFile>& spool);

}  // namespace curvisplat
