#include "preprocess/survey/grid_statistics.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/grid_survey.h"

namespace curvisplat {
namespace {

// Smaller volumes between the unit vectors of the edges at a corner are rounding errors.
constexpr double kNoVolume = 1e-12;

/// Returns the number of values that are not finite, of nodes that are not blanked.
template <typename Value>
uint64_t widen(ScalarRange& range, const std::vector<Value>& values, const std::vector<uint8_t>& blank) {
  uint64_t not_finite = 0;
  for (size_t n = 0; n < values.size(); ++n) {
    if (blank[n]) continue;
    if (!std::isfinite(values[n])) {
      ++not_finite;
      continue;
    }
    range.min = std::min<double>(range.min, values[n]);
    range.max = std::max<double>(range.max, values[n]);
  }
  return not_finite;
}

/// Counts of the cells of some rows. A cell with both right- and left-handed corners counts in both.
struct CellCounts {
  uint64_t cells = 0, degenerate = 0, right = 0, left = 0;
  double volume = 0;
};

CellCounts sumOfCounts(CellCounts a, const CellCounts& b) {
  a.cells += b.cells;
  a.degenerate += b.degenerate;
  a.right += b.right;
  a.left += b.left;
  a.volume += b.volume;
  return a;
}

/// The handedness of the edges at the eight corners.
struct Corners {
  bool flat = false, right = false, left = false;  // whether any corner is

  explicit Corners(const std::array<glm::dvec3, 8>& corner) {
    for (size_t c = 0; c < 8; ++c) {
      const glm::dvec3 i = corner[c | 1] - corner[c & 6], j = corner[c | 2] - corner[c & 5],
                       k = corner[c | 4] - corner[c & 3];
      const double size = glm::length(i) * glm::length(j) * glm::length(k);
      const double volume = Hexahedron::triple(i, j, k);
      if (std::abs(volume) <= kNoVolume * size)
        flat = true;
      else
        (volume < 0 ? left : right) = true;
    }
  }
};

CellCounts countCells(const GridBlock& block, const LoadedSlab& loaded) {
  const Slab& slab = loaded.slab;
  const NodeArrays& nodes = loaded.nodes;
  const WindowStrides strides(slab.window, block.ni);
  const uint64_t end = std::min(slab.box.i1, block.ni - 1);  // of the lowest nodes of cells
  const uint64_t width = slab.box.j1 - slab.box.j0;
  // Deterministic, since floating-point addition of the volume is not associative.
  return tbb::parallel_deterministic_reduce(
      tbb::blocked_range<uint64_t>(0, rowsOf(slab.box), 16), CellCounts(),
      [&](const tbb::blocked_range<uint64_t>& rows, CellCounts counts) {
        for (uint64_t n = rows.begin(); n < rows.end(); ++n) {
          const uint64_t j = slab.box.j0 + n % width, k = slab.box.k0 + n / width;
          if (j + 1 >= block.nj || k + 1 >= block.nk) continue;
          size_t at = strides.at(slab.box.i0, j, k);
          for (uint64_t i = slab.box.i0; i < end; ++i, ++at) {
            if (cornerMarks(nodes.blank.data(), at, strides.row, strides.plane)) continue;
            const auto corner =
                cornersAt(nodes.x.data(), nodes.y.data(), nodes.z.data(), at, strides.row, strides.plane);
            const Corners corners(corner);
            ++counts.cells;
            counts.degenerate += corners.flat;
            counts.right += corners.right;
            counts.left += corners.left;
            counts.volume += std::abs(Hexahedron(corner).volume());
          }
        }
        return counts;
      },
      sumOfCounts);
}

}  // namespace

BlankCounts GridStatistics::blank() const {
  BlankCounts total;
  for (const BlockStatistics& block : blocks) total += block.blank;
  return total;
}

uint64_t GridStatistics::cells() const {
  uint64_t total = 0;
  for (const BlockStatistics& block : blocks) total += block.cells;
  return total;
}

uint64_t GridStatistics::degenerate() const {
  uint64_t total = 0;
  for (const BlockStatistics& block : blocks) total += block.degenerate;
  return total;
}

uint64_t GridStatistics::inverted() const {
  uint64_t total = 0;
  for (const BlockStatistics& block : blocks) total += block.inverted;
  return total;
}

GridStatistics measureGrid(const GridSource& source, const std::vector<uint32_t>& scalars,
                           uint64_t slab_bytes, Progress& progress) {
  const GridDescription& description = source.description();
  GridStatistics statistics;
  statistics.blocks.resize(description.blocks.size());
  statistics.scalars.resize(scalars.size());
  statistics.missing.resize(scalars.size());

  std::vector<uint32_t> at_nodes, in_cells;
  std::vector<size_t> of_nodes, of_cells;  // their indices in `scalars`
  for (size_t n = 0; n < scalars.size(); ++n) {
    const bool cell = description.scalars[scalars[n]].centring == Centring::kCell;
    (cell ? in_cells : at_nodes).push_back(scalars[n]);
    (cell ? of_cells : of_nodes).push_back(n);
  }

  const NodeReader values = NodeReader::ofAnyValue(source, at_nodes);
  SlabStream slabs(values, slab_bytes, kNoHalo);
  while (const LoadedSlab* loaded = slabs.next()) {
    const NodeArrays& nodes = loaded->nodes;
    statistics.blocks[loaded->slab.block].blank += loaded->blanked;
    const std::vector<double>* const axes[] = {&nodes.x, &nodes.y, &nodes.z};
    for (size_t axis = 0; axis < 3; ++axis) widen(statistics.bounds[axis], *axes[axis], nodes.blank);
    for (size_t n = 0; n < at_nodes.size(); ++n)
      statistics.missing[of_nodes[n]] +=
          widen(statistics.scalars[of_nodes[n]], nodes.scalars[n], nodes.blank);
    progress.advance(nodes.x.size());
  }

  const NodeReader coordinates(source, {}, std::nullopt);
  std::vector<CellCounts> counts(description.blocks.size());
  SlabStream cells(coordinates, slab_bytes, kCornerHalo);
  while (const LoadedSlab* loaded = cells.next()) {
    const uint32_t block = loaded->slab.block;
    counts[block] = sumOfCounts(counts[block], countCells(description.blocks[block], *loaded));
    progress.advance(loaded->nodes.x.size());
  }
  for (size_t b = 0; b < counts.size(); ++b) {
    BlockStatistics& block = statistics.blocks[b];
    block.cells = counts[b].cells;
    block.degenerate = counts[b].degenerate;
    block.inverted = std::min(counts[b].right, counts[b].left);
    block.volume = counts[b].volume;
  }

  if (!in_cells.empty()) {
    const GridSurvey survey = surveyCells(NodeReader::ofAnyValue(source, in_cells), slab_bytes, {}, progress);
    statistics.cell_values_not_finite = survey.blanked.not_finite;
    for (size_t n = 0; n < in_cells.size(); ++n) statistics.scalars[of_cells[n]] = survey.ranges[n];
  }
  return statistics;
}

}  // namespace curvisplat
