// Nodes of a grid for tests that compare sources: all that a source has, block by block, in memory; and a
// grid that is read in parts of rows, against the same grid read as a whole.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <numeric>
#include <random>
#include <span>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"

namespace curvisplat {

/// All nodes of a block, with all scalars.
inline NodeArrays allNodes(const GridSource& source, uint32_t block) {
  std::vector<uint32_t> scalars(source.description().scalars.size());
  std::iota(scalars.begin(), scalars.end(), 0u);
  NodeArrays nodes;
  source.read(block, {0, source.description().blocks.at(block).nj, 0, source.description().blocks[block].nk},
              scalars, nodes);
  return nodes;
}

/// The values of a scalar that belong to cells: without the last i, j and k.
inline std::vector<float> cellValues(const GridBlock& block, const std::vector<float>& values) {
  std::vector<float> cells;
  for (uint64_t k = 0; k + 1 < block.nk; ++k)
    for (uint64_t j = 0; j + 1 < block.nj; ++j)
      for (uint64_t i = 0; i + 1 < block.ni; ++i)
        cells.push_back(values[static_cast<size_t>((k * block.nj + j) * block.ni + i)]);
  return cells;
}

/// Expects that boxes that begin and end anywhere along i, j and k have the bits that reading each block as
/// a whole gives. `scalars` are of one centring.
inline void expectPartsOfRows(const GridSource& source, std::span<const uint32_t> scalars) {
  std::mt19937_64 random(27);
  const auto range = [&](uint64_t count) {
    const uint64_t a = random() % count, b = random() % count;
    return std::pair{std::min(a, b), std::max(a, b) + 1};
  };
  const auto same = [](auto a, auto b) { return std::memcmp(&a, &b, sizeof a) == 0; };
  NodeArrays whole, part;
  std::vector<uint8_t> whole_fringe, fringe;
  for (uint32_t number = 0; number < source.description().blocks.size(); ++number) {
    const GridBlock& block = source.description().blocks[number];
    SCOPED_TRACE(block.name);
    const NodeBox all{0, block.nj, 0, block.nk};
    source.read(number, all, scalars, whole);
    const bool has_fringe = source.readFringe(number, all, whole_fringe);
    for (int n = 0; n < 25; ++n) {
      const auto [i0, i1] = range(block.ni);
      const auto [j0, j1] = range(block.nj);
      const auto [k0, k1] = range(block.nk);
      const NodeBox box{j0, j1, k0, k1, i0, i1};
      source.readPartOfRows(number, box, scalars, part);
      ASSERT_EQ(source.readFringePart(number, box, fringe), has_fringe);
      const WindowStrides strides(box, block.ni);
      const size_t nodes = strides.plane * (k1 - k0);
      ASSERT_EQ(part.x.size(), nodes);
      ASSERT_EQ(part.y.size(), nodes);
      ASSERT_EQ(part.z.size(), nodes);
      ASSERT_EQ(part.blank.size(), nodes);
      ASSERT_EQ(part.scalars.size(), scalars.size());
      for (const std::vector<float>& values : part.scalars) ASSERT_EQ(values.size(), nodes);
      for (uint64_t k = k0; k < k1; ++k)
        for (uint64_t j = j0; j < j1; ++j)
          for (uint64_t i = i0; i < i1; ++i) {
            const size_t at = strides.at(i, j, k), of_whole = (k * block.nj + j) * block.ni + i;
            ASSERT_TRUE(same(part.x[at], whole.x[of_whole])) << i << ' ' << j << ' ' << k;
            ASSERT_TRUE(same(part.y[at], whole.y[of_whole])) << i << ' ' << j << ' ' << k;
            ASSERT_TRUE(same(part.z[at], whole.z[of_whole])) << i << ' ' << j << ' ' << k;
            ASSERT_EQ(part.blank[at], whole.blank[of_whole]) << i << ' ' << j << ' ' << k;
            if (has_fringe) {
              ASSERT_EQ(fringe[at], whole_fringe[of_whole]) << i << ' ' << j << ' ' << k;
            }
            for (size_t s = 0; s < scalars.size(); ++s)
              ASSERT_TRUE(same(part.scalars[s][at], whole.scalars[s][of_whole]))
                  << source.description().scalars[scalars[s]].name << ' ' << i << ' ' << j << ' ' << k;
          }
    }
  }
}

/// The same of all scalars: those of nodes, and then those of cells.
inline void expectPartsOfRows(const GridSource& source) {
  for (const Centring centring : {Centring::kNode, Centring::kCell}) {
    std::vector<uint32_t> scalars;
    for (uint32_t n = 0; n < source.description().scalars.size(); ++n)
      if (source.description().scalars[n].centring == centring) scalars.push_back(n);
    expectPartsOfRows(source, scalars);
  }
}

}  // namespace curvisplat
