#include "tests/reference/cell_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

namespace curvisplat {

CellGridSource::CellGridSource(const GridSource& nodes, std::vector<Function> functions)
    : nodes_(&nodes), functions_(std::move(functions)), description_(nodes.description()) {
  for (size_t n = 0; n < functions_.size(); ++n) {
    GridScalar scalar;
    scalar.name = fmt::format("c{}", n);
    scalar.centring = Centring::kCell;
    description_.scalars.push_back(scalar);
  }
}

void CellGridSource::read(uint32_t block_number, const NodeBox& box, std::span<const uint32_t> scalars,
                          NodeArrays& out) const {
  const auto of_nodes = static_cast<uint32_t>(nodes_->description().scalars.size());
  std::vector<uint32_t> wanted;
  for (const uint32_t scalar : scalars)
    if (scalar < of_nodes) wanted.push_back(scalar);
  nodes_->read(block_number, box, wanted, out);
  std::vector<std::vector<float>> node_scalars = std::move(out.scalars);

  const GridBlock& block = description_.blocks[block_number];
  const NodeBox with_corners{box.j0, std::min(box.j1 + 1, block.nj), box.k0, std::min(box.k1 + 1, block.nk)};
  NodeArrays nodes;
  nodes_->read(block_number, with_corners, {}, nodes);
  const size_t row = block.ni, plane = row * (with_corners.j1 - with_corners.j0);
  out.scalars.clear();
  size_t next_of_nodes = 0;
  for (const uint32_t scalar : scalars) {
    if (scalar < of_nodes) {
      out.scalars.push_back(std::move(node_scalars[next_of_nodes++]));
      continue;
    }
    auto& values = out.scalars.emplace_back();
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = 0; i < block.ni; ++i) {
          if (i + 1 == block.ni || j + 1 == block.nj || k + 1 == block.nk) {
            values.push_back(std::numeric_limits<float>::quiet_NaN());
            continue;
          }
          GridCell cell{block_number, i, j, k, {}};
          for (size_t corner = 0; corner < 8; ++corner) {
            const size_t n = i + (corner & 1) + (j - box.j0 + (corner >> 1 & 1)) * row +
                             (k - box.k0 + (corner >> 2)) * plane;
            cell.centre += 0.125 * glm::dvec3(nodes.x[n], nodes.y[n], nodes.z[n]);
          }
          values.push_back(static_cast<float>(functions_[scalar - of_nodes](cell)));
        }
  }
}

}  // namespace curvisplat
