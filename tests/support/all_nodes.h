// All that a source has, block by block, in memory: for tests that compare sources.
#pragma once

#include <numeric>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

inline NodeArrays allNodes(const GridSource& source, uint32_t block) {
  std::vector<uint32_t> scalars(source.description().scalars.size());
  std::iota(scalars.begin(), scalars.end(), 0u);
  NodeArrays nodes;
  source.read(block, {0, source.description().blocks.at(block).nj, 0, source.description().blocks[block].nk},
              scalars, nodes);
  return nodes;
}

/// Those values of a scalar that belong to cells: without the last i, j and k.
inline std::vector<float> cellValues(const GridBlock& block, const std::vector<float>& values) {
  std::vector<float> cells;
  for (uint64_t k = 0; k + 1 < block.nk; ++k)
    for (uint64_t j = 0; j + 1 < block.nj; ++j)
      for (uint64_t i = 0; i + 1 < block.ni; ++i)
        cells.push_back(values[static_cast<size_t>((k * block.nj + j) * block.ni + i)]);
  return cells;
}

}  // namespace curvisplat
