#include "tests/reference/function_grid.h"

#include <fmt/format.h>

#include <utility>

namespace curvisplat {

FunctionGridSource::FunctionGridSource(std::vector<GridBlock> blocks, size_t scalars, Function function,
                                       Centring centring)
    : function_(std::move(function)) {
  description_.format = "a function";
  description_.files = {"function"};
  description_.blocks = std::move(blocks);
  description_.coordinate_bytes = 8;
  for (size_t n = 0; n < scalars; ++n) {
    GridScalar scalar;
    scalar.name = fmt::format("s{}", n);
    scalar.centring = centring;
    description_.scalars.push_back(scalar);
  }
}

void FunctionGridSource::read(uint32_t block_number, const NodeBox& box, std::span<const uint32_t> scalars,
                              NodeArrays& out) const {
  const GridBlock& block = description_.blocks[block_number];
  const size_t nodes = block.ni * (box.j1 - box.j0) * (box.k1 - box.k0);
  for (auto* axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  out.blank.resize(nodes);
  out.scalars.resize(scalars.size());
  for (auto& values : out.scalars) values.resize(nodes);
  size_t n = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k) {
    for (uint64_t j = box.j0; j < box.j1; ++j) {
      for (uint64_t i = 0; i < block.ni; ++i, ++n) {
        const NodeValues node = function_({block_number, i, j, k});
        out.x[n] = node.position.x;
        out.y[n] = node.position.y;
        out.z[n] = node.position.z;
        out.blank[n] = node.blank;
        for (size_t s = 0; s < scalars.size(); ++s) out.scalars[s][n] = node.scalars[scalars[s]];
      }
    }
  }
}

GridBlock gridBlock(uint64_t ni, uint64_t nj, uint64_t nk) {
  GridBlock block;
  block.name = "block";
  block.ni = ni;
  block.nj = nj;
  block.nk = nk;
  return block;
}

}  // namespace curvisplat
