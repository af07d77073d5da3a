// A grid of any blocks whose nodes are what a function says: for tests that need an odd one.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// A node's number in its block, and what the function answers.
struct GridNode {
  uint32_t block = 0;
  uint64_t i = 0, j = 0, k = 0;
};
struct NodeValues {
  glm::dvec3 position{0.0};
  std::vector<float> scalars;
  bool blank = false;
};

class FunctionGridSource : public GridSource {
 public:
  using Function = std::function<NodeValues(const GridNode&)>;

  /// Scalars are named "s0", "s1", ...
  FunctionGridSource(std::vector<GridBlock> blocks, size_t scalars, Function function,
                     Centring centring = Centring::kNode);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  GridDescription description_;
  Function function_;
};

GridBlock gridBlock(uint64_t ni, uint64_t nj, uint64_t nk);

}  // namespace curvisplat
