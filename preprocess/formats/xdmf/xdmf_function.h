// Functions of finite elements, as FEniCS writes them into XDMF (write_checkpoint): of each cell the numbers of its degrees of
// freedom, component by component, and the values of all of them.
#pragma once

#include <memory>
#include <string>

#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/xdmf/xdmf_values.h"

namespace curvisplat {

/// A function on linear tetrahedra, of degree 0, 1 or 2.
struct XdmfFunction {
  uint64_t nodes = 0, cells = 0;
  std::shared_ptr<const XdmfValues> corners;  // [cell * 4 + corner]: a node
  double first_node = 0;
  std::shared_ptr<const XdmfValues> degrees;  // [cell][component][degree of freedom]: an index of `values`
  std::shared_ptr<const XdmfValues> values;
  uint64_t degree = 1;
  bool continuous = true;
  std::string where;  // for messages
};

/// The tuples of all cells if the degree is 0, otherwise of all nodes: the values at the corners, of a function that is not continuous
/// their mean. They are spooled at the first read. Throws Error if the sizes do not match.
std::shared_ptr<const XdmfValues> xdmfFunctionValues(const XdmfFunction& function,
                                                     const std::shared_ptr<SpoolFile>& spool);

}  // namespace curvisplat
