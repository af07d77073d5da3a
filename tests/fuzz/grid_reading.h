// Reads all of a file that opens, for targets of grid formats.
#pragma once

#include <algorithm>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "preprocess/formats/common/cut_source.h"
#include "preprocess/gather/halved_mesh.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/error.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {

/// The first rows of every block with every scalar, as conversion reads them.
inline void readGrid(const GridSource& source) {
  constexpr uint64_t kMaxNodes = 1 << 16;
  std::vector<uint32_t> scalars(source.description().scalars.size());
  std::iota(scalars.begin(), scalars.end(), 0u);
  NodeArrays nodes;
  for (uint32_t b = 0; b < source.description().blocks.size(); ++b) {
    const GridBlock& block = source.description().blocks[b];
    if (block.ni > kMaxNodes) continue;
    const uint64_t rows = std::min(block.nj, kMaxNodes / block.ni);
    for (uint64_t k = 0; k < std::min<uint64_t>(block.nk, 4); ++k) {
      source.read(b, {0, rows, k, k + 1}, scalars, nodes);
      CURVISPLAT_CHECK_OP(nodes.x.size(), ==, block.ni * rows);
      CURVISPLAT_CHECK_OP(nodes.blank.size(), ==, block.ni * rows);
      for (const auto& values : nodes.scalars) CURVISPLAT_CHECK_OP(values.size(), ==, block.ni * rows);
    }
  }
}

/// Does the same with the first points and cells of every piece.
inline void readMesh(const MeshSource& source) {
  constexpr uint64_t kMax = 4096;
  std::vector<uint32_t> of_points, of_cells;
  for (uint32_t n = 0; n < source.description().scalars.size(); ++n)
    (source.description().scalars[n].centring == Centring::kNode ? of_points : of_cells).push_back(n);
  const std::vector<MeshPiece>& pieces = source.description().pieces;
  MeshPoints points;
  MeshCells cells;
  for (uint32_t n = 0; n < pieces.size(); ++n) {
    const uint64_t point_count = std::min(kMax, pieces[n].points),
                   cell_count = std::min(kMax, pieces[n].cells);
    source.readPoints(n, 0, point_count, of_points, points);
    source.readCells(n, 0, cell_count, of_cells, cells);
    checkCells(cells, pieces[n], 0);
    CURVISPLAT_CHECK_OP(points.x.size(), ==, point_count);
    CURVISPLAT_CHECK_OP(cells.size(), ==, cell_count);
    for (const auto& values : points.scalars) CURVISPLAT_CHECK_OP(values.size(), ==, point_count);
    for (const auto& values : cells.scalars) CURVISPLAT_CHECK_OP(values.size(), ==, cell_count);
  }
}

/// Halves the cells of a small mesh, and reads what they become. Large ones are passed over.
inline void readHalves(std::unique_ptr<MeshSource> mesh) {
  constexpr uint64_t kMax = 4096;
  for (const MeshPiece& piece : mesh->description().pieces)
    if (piece.points > kMax || piece.cells > kMax) return;
  isHalvedByNeed(*mesh);
  readMesh(*halved(std::move(mesh)));
}

/// Reads a grid, or a mesh whose curved cells are cut; and this again in halves.
inline void readData(std::unique_ptr<DataSource> source) {
  source = cutCurved(std::move(source), true, fuzzFolder());
  if (auto* const mesh = dynamic_cast<MeshSource*>(source.get())) {
    readMesh(*mesh);
    source.release();
    return readHalves(std::unique_ptr<MeshSource>(mesh));
  }
  readGrid(dynamic_cast<const GridSource&>(*source));
}

}  // namespace curvisplat
