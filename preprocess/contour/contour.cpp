#include "preprocess/contour/contour.h"

#include <algorithm>
#include <array>
#include <vector>

#include "preprocess/contour/cell_contour.h"
#include "preprocess/gather/corner_gather.h"
#include "preprocess/grid/slabs.h"

namespace curvisplat {
namespace {

constexpr uint64_t kSlabBytes = 8 << 20;  // whatever the memory: triangles are in the order of the slabs

/// Contours the cells whose lowest nodes are in a slab's box.
class SlabContour {
 public:
  SlabContour(const ContourOptions& options, CellContour& contour) : options_(options), contour_(contour) {}

  void add(const LoadedSlab& loaded, const GridBlock& block) {
    const Slab& slab = loaded.slab;
    const WindowStrides strides(slab.window, block.ni);
    findSides(loaded.nodes);
    const uint64_t i1 = std::min(slab.box.i1, block.ni - 1), j1 = std::min(slab.box.j1, block.nj - 1),
                   k1 = std::min(slab.box.k1, block.nk - 1);
    for (uint64_t k = slab.box.k0; k < k1; ++k)
      for (uint64_t j = slab.box.j0; j < j1; ++j)
        for (uint64_t i = slab.box.i0; i < i1; ++i)
          if (isCrossed(strides.at(i, j, k), strides)) addCell(loaded, block, strides, {i, j, k});
  }

  const ContourRange& range() const { return range_; }

 private:
  enum Side : uint8_t { kBelow = 1, kAbove = 2, kNone = 4 };

  void findSides(const NodeArrays& nodes) {
    const std::vector<float>& values = nodes.scalars[0];
    sides_.resize(values.size());
    for (size_t n = 0; n < values.size(); ++n) {
      const bool counts = nodes.blank[n] == 0 && values[n] >= options_.lower && values[n] <= options_.upper;
      sides_[n] = !counts ? kNone : double{values[n]} >= options_.value ? kAbove : kBelow;
      if (counts) range_.add(values[n]);
    }
  }
  bool isCrossed(size_t at, const WindowStrides& strides) const {
    const auto pair = [&](size_t n) { return sides_[n] | sides_[n + 1]; };
    return (pair(at) | pair(at + strides.row) | pair(at + strides.plane) |
            pair(at + strides.plane + strides.row)) == (kBelow | kAbove);
  }
  void addCell(const LoadedSlab& loaded, const GridBlock& block, const WindowStrides& strides,
               const std::array<uint64_t, 3>& lowest) {
    // The corners of a hexahedron as mesh_source.h draws it.
    constexpr std::array<std::array<uint64_t, 3>, 8> kCorners{
        {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
    const NodeArrays& nodes = loaded.nodes;
    for (size_t c = 0; c < 8; ++c) {
      const uint64_t i = lowest[0] + kCorners[c][0], j = lowest[1] + kCorners[c][1],
                     k = lowest[2] + kCorners[c][2];
      const size_t n = strides.at(i, j, k);
      points_[c] = (k * block.nj + j) * block.ni + i;
      at_[c] = {nodes.x[n], nodes.y[n], nodes.z[n]};
      values_[c] = nodes.scalars[0][n];
    }
    contour_.add({points_, at_, values_, facesOf(CellKind::kHexahedron, {})});
  }

  const ContourOptions& options_;
  CellContour& contour_;
  ContourRange range_;
  std::vector<uint8_t> sides_;  // [node of the window]
  std::array<uint64_t, 8> points_{};
  std::array<glm::dvec3, 8> at_{};
  std::array<float, 8> values_{};
};

}  // namespace

ContourRange contourGrid(const GridSource& source, const ContourOptions& options, TriangleSink& sink,
                         Progress& progress) {
  const std::vector<GridBlock>& blocks = source.description().blocks;
  const NodeReader reader(source, {options.scalar}, std::nullopt);
  ContourMesh mesh(sink);
  CellContour contour(options.value, mesh);
  SlabContour slabs(options, contour);
  uint64_t nodes = 0;
  for (const GridBlock& block : blocks) nodes += block.nodes();
  progress.begin("isosurface", nodes, "nodes");
  SlabStream stream(reader, SlabBuffers(kSlabBytes), kCornerHalo);
  uint32_t of_block = 0;
  while (const LoadedSlab* const loaded = stream.next()) {
    const Slab& slab = loaded->slab;
    if (slab.block != of_block) mesh.finish();  // points are numbered in their block
    of_block = slab.block;
    const GridBlock& block = blocks[slab.block];
    slabs.add(*loaded, block);
    // What is left to the other slabs lies in the planes between them: those of this one, and none that all of them have passed.
    const auto isBetween = [&](uint64_t point) {
      const uint64_t i = point % block.ni, j = point / block.ni % block.nj, k = point / block.ni / block.nj;
      const NodeBox& box = slab.box;
      const bool inside =
          i > box.i0 && i < box.endOfRow(block.ni) && j > box.j0 && j < box.j1 && k > box.k0 && k < box.k1;
      return !inside && k >= box.k0;
    };
    mesh.keepOnly(
        [&](const ContourMesh::Edge& edge) { return isBetween(edge.first) && isBetween(edge.second); });
    progress.advance(rowsOf(slab.box) * slab.box.rowNodes(block.ni));
  }
  mesh.finish();
  progress.end();
  return slabs.range();
}

ContourRange contourMesh(const MeshSource& source, const ContourOptions& options, const ScratchFiles& scratch,
                         TriangleSink& sink, Progress& progress) {
  const MeshReader reader(source, {options.scalar}, std::nullopt);
  reader.prepare(options.memory_bytes, progress);
  const PointNumbers numbers(reader, options.memory_bytes, scratch, progress);
  ContourMesh mesh(sink);
  CellContour contour(options.value, mesh);
  CornerGather gather(reader, numbers, halfBesideChunks(options.memory_bytes, reader.largestChunk()), scratch,
                      progress);
  ContourRange range;
  gather.forEach([&](const GatheredCells& cells) {
    for (size_t n = 0; n < cells.size(); ++n) {
      if (cells.shapes[n] == CellKind::kNone) continue;
      const CellView cell = cells.view(n, 1);
      bool all_count = true;
      for (const float value : cell.values) {
        const bool counts = value >= options.lower && value <= options.upper;
        if (counts) range.add(value);
        all_count = all_count && counts;
      }
      if (all_count)
        contour.add({cells.cornersOfCell(n), cell.corners, cell.values, facesOf(cell.shape, cell.faces)});
    }
  });
  mesh.finish();
  return range;
}

}  // namespace curvisplat
