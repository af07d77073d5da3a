#include "tests/reference/function_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
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

namespace {

glm::dmat3 turned(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  const glm::dmat3 about_z(c, s, 0, -s, c, 0, 0, 0, 1), about_x(1, 0, 0, 0, c, s, 0, -s, c);
  return about_x * about_z;
}

}  // namespace

FunctionGridSource oversetGrid(std::shared_ptr<const Scene> scene, const GridBlock& block,
                               const std::vector<OversetBox>& boxes, Centring centring) {
  std::vector<GridBlock> blocks{block};
  for (const OversetBox& box : boxes) blocks.push_back(gridBlock(box.nodes, box.nodes, box.nodes));
  const auto at = [=](const GridNode& node, double shift) {
    const auto along = [&](uint64_t n, uint64_t nodes) {
      return (static_cast<double>(n) + shift) / static_cast<double>(nodes - 1);
    };
    const GridBlock& of = blocks[node.block];
    const glm::dvec3 u(along(node.i, of.ni), along(node.j, of.nj), along(node.k, of.nk));
    if (node.block == 0) return scene->position(u);
    const OversetBox& box = boxes[node.block - 1];
    return box.middle + turned(box.turn) * (box.size * (u - 0.5));
  };
  const double middle = centring == Centring::kCell ? 0.5 : 0;
  return {blocks, 1,
          [=](const GridNode& node) {
            return NodeValues{at(node, 0), {static_cast<float>(scene->scalar(at(node, middle)))}, false};
          },
          centring};
}

std::vector<OversetBox> boxesInHalfAnnulus(size_t count, uint64_t nodes) {
  const std::vector<OversetBox> all{{{-0.6, 0.0, 0.5}, {0.4, 0.4, 0.4}, nodes, 0},
                                    {{-0.5, 0.25, 0.4}, {0.3, 0.35, 0.3}, nodes, 0.5},
                                    {{-0.5, -0.4, 0.5}, {0.3, 0.3, 0.4}, nodes, 0.3},
                                    {{-0.2, 0.65, 0.5}, {0.25, 0.3, 0.35}, nodes, 0.2},
                                    {{-0.6, 0.05, 0.5}, {0.15, 0.15, 0.2}, nodes, 0.7}};
  return {all.begin(), all.begin() + static_cast<ptrdiff_t>(count)};
}

}  // namespace curvisplat
