// Scalars in the cells of any grid: for tests that need them.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// A cell, by its lowest node.
struct GridCell {
  uint32_t block = 0;
  uint64_t i = 0, j = 0, k = 0;
  glm::dvec3 centre{0.0};  // the mean of its corners
};

/// The nodes of another source, which must outlive it, and its scalars; behind these, cell-centred scalars
/// "c0", "c1", ... of what a function says.
class CellGridSource : public GridSource {
 public:
  using Function = std::function<double(const GridCell&)>;

  CellGridSource(const GridSource& nodes, std::vector<Function> functions);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  const GridSource* nodes_;
  std::vector<Function> functions_;
  GridDescription description_;
};

}  // namespace curvisplat
