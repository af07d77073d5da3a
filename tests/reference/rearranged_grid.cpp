#include "tests/reference/rearranged_grid.h"

#include <fmt/format.h>

#include <numeric>

namespace curvisplat {

RearrangedGridSource::RearrangedGridSource(const GridSource& source, const Rearrangement& how)
    : description_(source.description()), how_(how) {
  const GridBlock original = description_.blocks.front();
  size_ = {original.ni, original.nj, original.nk};
  std::vector<uint32_t> scalars(description_.scalars.size());
  std::iota(scalars.begin(), scalars.end(), 0u);
  source.read(0, {0, original.nj, 0, original.nk}, scalars, nodes_);

  // Where the blocks begin and end along i, j, k.
  const auto begin = [&](int axis, uint64_t piece) {
    return piece * (size_[how_.axes[axis]] - 1) / how_.cuts[axis];
  };
  description_.blocks.clear();
  for (uint64_t k = 0; k < how_.cuts[2]; ++k)
    for (uint64_t j = 0; j < how_.cuts[1]; ++j)
      for (uint64_t i = 0; i < how_.cuts[0]; ++i) {
        const std::array<uint64_t, 3> piece{i, j, k};
        std::array<uint64_t, 3> first, nodes;
        for (int axis = 0; axis < 3; ++axis) {
          first[axis] = begin(axis, piece[axis]);
          nodes[axis] = begin(axis, piece[axis] + 1) - first[axis] + 1;
        }
        first_.push_back(first);
        description_.blocks.push_back(
            {fmt::format("block {}", first_.size()), nodes[0], nodes[1], nodes[2], original.has_blanking});
      }
}

void RearrangedGridSource::read(uint32_t block_number, const NodeBox& box, std::span<const uint32_t> scalars,
                                NodeArrays& out) const {
  const GridBlock& block = description_.blocks[block_number];
  const size_t count = block.ni * (box.j1 - box.j0) * (box.k1 - box.k0);
  for (auto* axis : {&out.x, &out.y, &out.z}) axis->resize(count);
  out.blank.resize(count);
  out.scalars.resize(scalars.size());
  for (auto& values : out.scalars) values.resize(count);
  size_t n = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j)
      for (uint64_t i = 0; i < block.ni; ++i, ++n) {
        const std::array<uint64_t, 3> here{i, j, k};
        std::array<uint64_t, 3> at;  // in the original
        for (int axis = 0; axis < 3; ++axis) {
          const uint64_t index = first_[block_number][axis] + here[axis], nodes = size_[how_.axes[axis]];
          at[how_.axes[axis]] = how_.mirrored[axis] ? nodes - 1 - index : index;
        }
        const size_t from = (at[2] * size_[1] + at[1]) * size_[0] + at[0];
        out.x[n] = nodes_.x[from];
        out.y[n] = nodes_.y[from];
        out.z[n] = nodes_.z[from];
        out.blank[n] = nodes_.blank[from];
        for (size_t s = 0; s < scalars.size(); ++s) out.scalars[s][n] = nodes_.scalars[scalars[s]][from];
      }
}

}  // namespace curvisplat
