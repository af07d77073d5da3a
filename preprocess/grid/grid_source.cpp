#include "preprocess/grid/grid_source.h"

#include <algorithm>

namespace curvisplat {
namespace {

/// Copies the part of a row, i0 and on, to the place of row number `row` of parts.
template <typename Value>
void copyPart(const std::vector<Value>& from, const NodeBox& box, uint64_t nodes, uint64_t row,
              std::vector<Value>& to) {
  std::copy_n(from.begin() + static_cast<ptrdiff_t>(box.i0), nodes,
              to.begin() + static_cast<ptrdiff_t>(row * nodes));
}

}  // namespace

void GridSource::readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                                NodeArrays& out) const {
  const uint64_t nodes = box.rowNodes(description().blocks.at(block).ni);
  const size_t all = nodes * (box.j1 - box.j0) * (box.k1 - box.k0);
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(all);
  out.blank.resize(all);
  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.resize(all);
  NodeArrays whole;
  uint64_t row = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j, ++row) {
      read(block, {j, j + 1, k, k + 1}, scalars, whole);
      copyPart(whole.x, box, nodes, row, out.x);
      copyPart(whole.y, box, nodes, row, out.y);
      copyPart(whole.z, box, nodes, row, out.z);
      copyPart(whole.blank, box, nodes, row, out.blank);
      for (size_t n = 0; n < scalars.size(); ++n) copyPart(whole.scalars[n], box, nodes, row, out.scalars[n]);
    }
}

bool GridSource::readFringePart(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const {
  const uint64_t nodes = box.rowNodes(description().blocks.at(block).ni);
  out.resize(nodes * (box.j1 - box.j0) * (box.k1 - box.k0));
  std::vector<uint8_t> whole;
  uint64_t row = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j, ++row) {
      if (!readFringe(block, {j, j + 1, k, k + 1}, whole)) return false;
      copyPart(whole, box, nodes, row, out);
    }
  return true;
}

}  // namespace curvisplat
