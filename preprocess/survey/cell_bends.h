// How far the cells of a grid are from parallelepipeds in even rows: a splat has one place, one shape and one
// plane for all of its cell, so cells that grow, bend, taper or twist steeply show as bands in a picture.
//
// With the columns d_i, d_j, d_k of a node's Jacobian and the second difference x_ab of the positions along the
// axes a and b, T_ab = (d_i d_j d_k)⁻¹ x_ab is what the trilinear map has beyond the ellipsoid, in cells. By its
// components c, and what remains if cells are cut into n_i x n_j x n_k parts (new planes of nodes lie evenly
// between the old ones, where the rows keep their kinks):
//
//     c = a = b   growth, which the stretch of splats (preprocess/splats/stretch.h) makes up for but for its
//                 square; jumps at the old planes only: the square's mean falls to 1/n_a
//     c ≠ a = b   bend: n_c² / n_a³
//     c = a ≠ b   taper: 1 / n_b²
//     all differ  twist: (n_c / (n_a n_b))²
//
// The root of the sum of their mean squares, weighted (cell_bends.cpp), is about the rms deviation of a uniform
// medium's optical depth in %: bench/README.md, "Real grids", has measured ones beside it. What borders and
// joints of blocks add is not measured; a second difference across kinked joints was tried: it finds 0.7 to 1.1 where
// 1.1 to 1.7 are drawn, and takes cuts from where they help more (of the O-grid of 79 blocks 0.5 would become 1.0).
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "stream/model/refinement.h"

namespace curvisplat {

/// Means of the squares of T over the nodes of a block, by volume and weighted.
struct BlockBends {
  double volume = 0;
  double shortest = 0;  // the mean of the shortest edge of a cell, by volume
  glm::dvec3 lower{std::numeric_limits<double>::infinity()}, upper{-lower};  // the box of the nodes
  /// [component][pair of axes: ii, jj, kk, jk, ki, ij]
  std::array<std::array<double, 6>, 3> squares{};

  /// The expected rms deviation, in %, of cells that are cut.
  double deviation(const CellCuts& cuts = kWholeCells) const;
};

/// Measures the blocks of a grid: all nodes if it has at most `nodes`, or else some slabs of each block. What is
/// found depends neither on threads nor on memory. Takes 40 MB. Throws Error if the grid cannot be read.
std::vector<BlockBends> measureBends(const GridSource& source, uint64_t nodes);

/// Grids with more nodes are not cut by need: their cells are smaller than pixels.
inline constexpr uint64_t kMaxCutByNeed = 16'000'000;

/// Chooses for each block, along each axis, into 1, 2, 4 or 8 parts its cells should be cut, so that a picture
/// does not show them (kMaxDeviation), with at most 8 times the cells, or 1.5 times in grids of more than a
/// million nodes. Blocks that share the nodes of a face or an edge have as many parts along it. Blocks of
/// small grids whose drawn nodes end in stairs are halved: nodes are drawn where one of `scalars` has a value other than
/// `blank_value`. Throws Error if the grid cannot be read.
Refinement refinementByNeed(const GridSource& source, const std::vector<uint32_t>& scalars = {},
                            std::optional<double> blank_value = {});

/// A line for users if a picture of the grid will show its cells, with an rms deviation of 2 % and more: what helps. Otherwise
/// empty. `by_need`: whether refinementByNeed() has chosen its cuts. Looks at some slabs of large grids only. Throws Error if the
/// grid cannot be read.
std::string noteOnCells(const GridSource& source, bool by_need = false);

}  // namespace curvisplat
