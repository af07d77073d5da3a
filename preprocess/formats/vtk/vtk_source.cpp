#include "preprocess/formats/vtk/vtk_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "preprocess/formats/vtk/vtk_fields.h"
#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Half-open ranges of indices, relative to the piece's first node or cell.
struct VtkBox {
  std::array<uint64_t, 3> lower{}, upper{};
  uint64_t along(size_t axis) const { return upper[axis] - lower[axis]; }
  uint64_t size() const { return along(0) * along(1) * along(2); }
};

// Bits of vtkGhostType (vtkDataSetAttributes). Duplicates (bit 0) are not blanked: where pieces overlap,
// their extents decide which piece draws a cell; in a grid of one piece duplicates are ordinary cells.
constexpr int kHiddenPoint = 2;
constexpr int kHiddenCell = 32 | 8;  // hidden or refined; finer cells elsewhere replace refined ones
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

VtkBox inPiece(const VtkPiece& piece, const VtkBlock& block) {
  VtkBox box;
  for (size_t axis = 0; axis < 3; ++axis) {
    box.lower[axis] = static_cast<uint64_t>(block.extent.lower[axis] - piece.extent.lower[axis]);
    box.upper[axis] = static_cast<uint64_t>(block.extent.upper[axis] - piece.extent.lower[axis]) + 1;
  }
  return box;
}

VtkBox within(VtkBox box, const NodeBox& rows) {
  box.upper[0] = box.lower[0] + rows.endOfRow(box.along(0));
  box.lower[0] += rows.i0;
  box.upper[1] = box.lower[1] + rows.j1;
  box.lower[1] += rows.j0;
  box.upper[2] = box.lower[2] + rows.k1;
  box.lower[2] += rows.k0;
  return box;
}

/// The piece's nodes along i, j and k.
std::array<uint64_t, 3> nodeCounts(const VtkPiece& piece) {
  return {piece.extent.nodesAlong(0), piece.extent.nodesAlong(1), piece.extent.nodesAlong(2)};
}

/// The piece's cells along i, j and k.
std::array<uint64_t, 3> cellCounts(const VtkPiece& piece) {
  std::array<uint64_t, 3> counts = nodeCounts(piece);
  for (uint64_t& count : counts) count = std::max<uint64_t>(1, count - 1);
  return counts;
}

/// The nodes of `box` of `block` as a box of its piece.
VtkBox nodesOf(const VtkPiece& piece, const VtkBlock& block, const NodeBox& box) {
  return within(inPiece(piece, block), box);
}

/// The cells of `block` whose lowest nodes are in `box`, as a box of its piece; may be empty.
VtkBox cellsOf(const VtkPiece& piece, const VtkBlock& block, const NodeBox& box) {
  const VtkBox all = inPiece(piece, block);
  VtkBox cells = within(all, box);
  for (size_t axis = 0; axis < 3; ++axis) {
    cells.upper[axis] = std::min(cells.upper[axis], all.upper[axis] - 1);
    cells.lower[axis] = std::min(cells.lower[axis], cells.upper[axis]);
  }
  return cells;
}

/// Reads a box of an array of `counts` tuples along i, j and k; each wanted component goes to its
/// to[0 .. box.size()), i fastest.
template <typename Value>
void readBox(const VtkArray& array, const std::array<uint64_t, 3>& counts, const VtkBox& box,
             std::span<const WantedComponent<Value>> wanted) {
  if (box.size() == 0) return;
  // Rows that are contiguous in the file are read together.
  const bool whole_rows = box.along(0) == counts[0];
  const bool whole_planes = whole_rows && box.along(1) == counts[1];
  const uint64_t run = box.along(0) * (whole_rows ? box.along(1) : 1) * (whole_planes ? box.along(2) : 1);
  std::vector<WantedComponent<Value>> ahead(wanted.begin(), wanted.end());
  for (uint64_t k = box.lower[2]; k < box.upper[2]; k += whole_planes ? box.along(2) : 1)
    for (uint64_t j = box.lower[1]; j < box.upper[1]; j += whole_rows ? box.along(1) : 1) {
      readTuples<Value>(array, (k * counts[1] + j) * counts[0] + box.lower[0], run, ahead);
      for (WantedComponent<Value>& component : ahead) component.to += run;
    }
}

/// The values of a small integer array, unmodified.
std::vector<float> readFlags(const VtkArray& array, const std::array<uint64_t, 3>& counts,
                             const VtkBox& box) {
  std::vector<float> flags(static_cast<size_t>(box.size()));
  const WantedComponent<float> wanted{0, flags.data()};
  readBox<float>(array, counts, box, std::span(&wanted, 1));
  return flags;
}

bool hides(float flags, int bits) {
  return (static_cast<int>(flags) & bits) != 0;
}

VtkBox plane(VtkBox box, uint64_t k) {
  box.lower[2] = k;
  box.upper[2] = k + 1;
  return box;
}

/// Counts the cells around each node of one plane, and how many of them are hidden.
struct CellsAround {
  std::vector<uint8_t> all, hidden;

  void add(const std::vector<float>& flags, const VtkBox& cells, const VtkBox& nodes) {
    for (uint64_t j = nodes.lower[1]; j < nodes.upper[1]; ++j)
      for (uint64_t i = nodes.lower[0]; i < nodes.upper[0]; ++i) {
        const size_t node = static_cast<size_t>((j - nodes.lower[1]) * nodes.along(0) + i - nodes.lower[0]);
        for (uint64_t cj = std::max(j, cells.lower[1] + 1) - 1; cj < std::min(j + 1, cells.upper[1]); ++cj)
          for (uint64_t ci = std::max(i, cells.lower[0] + 1) - 1; ci < std::min(i + 1, cells.upper[0]);
               ++ci) {
            const uint64_t cell = (cj - cells.lower[1]) * cells.along(0) + ci - cells.lower[0];
            ++all[node];
            hidden[node] += hides(flags[static_cast<size_t>(cell)], kHiddenCell);
          }
      }
  }
};

void blankNodesOfHiddenCells(const VtkPiece& piece, const VtkBox& box, std::span<uint8_t> blank) {
  const std::array<uint64_t, 3> counts = cellCounts(piece);
  VtkBox cells = box;
  for (size_t axis = 0; axis < 3; ++axis) {
    cells.lower[axis] -= std::min<uint64_t>(1, cells.lower[axis]);
    cells.upper[axis] = std::min(cells.upper[axis], counts[axis]);
  }
  const auto nodes = static_cast<size_t>(box.along(0) * box.along(1));
  for (uint64_t k = box.lower[2]; k < box.upper[2]; ++k) {
    CellsAround around{std::vector<uint8_t>(nodes), std::vector<uint8_t>(nodes)};
    for (uint64_t ck = std::max(k, cells.lower[2] + 1) - 1; ck < std::min(k + 1, cells.upper[2]); ++ck)
      around.add(readFlags(*piece.cell_ghosts, counts, plane(cells, ck)), cells, box);
    uint8_t* const to = &blank[static_cast<size_t>(k - box.lower[2]) * nodes];
    for (size_t n = 0; n < nodes; ++n) to[n] |= around.hidden[n] > 0 && around.hidden[n] == around.all[n];
  }
}

void readAxes(const VtkAxes& axes, const VtkBox& box, NodeArrays& out) {
  std::vector<double>* const to[] = {&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> values(static_cast<size_t>(box.along(axis)));
    const WantedComponent<double> wanted{0, values.data()};
    readTuples<double>(axes[axis], box.lower[axis], values.size(), std::span(&wanted, 1));
    size_t node = 0;
    std::array<size_t, 3> at;
    for (at[2] = 0; at[2] < box.along(2); ++at[2])
      for (at[1] = 0; at[1] < box.along(1); ++at[1])
        for (at[0] = 0; at[0] < box.along(0); ++at[0]) (*to[axis])[node++] = values[at[axis]];
  }
}

void makeNodes(const VtkUniformNodes& uniform, const VtkPiece& piece, const VtkBox& box, NodeArrays& out) {
  glm::dvec3 first;
  for (glm::length_t axis = 0; axis < 3; ++axis)
    first[axis] = static_cast<double>(piece.extent.lower[static_cast<size_t>(axis)]);
  size_t node = 0;
  for (uint64_t k = box.lower[2]; k < box.upper[2]; ++k)
    for (uint64_t j = box.lower[1]; j < box.upper[1]; ++j)
      for (uint64_t i = box.lower[0]; i < box.upper[0]; ++i, ++node) {
        const glm::dvec3 index = first + glm::dvec3(i, j, k);
        const glm::dvec3 at = uniform.origin + uniform.direction * (uniform.spacing * index);
        out.x[node] = at.x;
        out.y[node] = at.y;
        out.z[node] = at.z;
      }
}

/// [cell of the box]: whether a finer patch covers it.
std::vector<uint8_t> refinedCells(const VtkPiece& piece, const VtkBox& box) {
  std::vector<uint8_t> refined(static_cast<size_t>(box.size()), 0);
  for (const VtkExtent& cells : piece.refined) {
    VtkBox common;
    for (size_t axis = 0; axis < 3; ++axis) {
      common.lower[axis] = std::max(box.lower[axis], static_cast<uint64_t>(cells.lower[axis]));
      common.upper[axis] = std::min(box.upper[axis], static_cast<uint64_t>(cells.upper[axis]) + 1);
      common.upper[axis] = std::max(common.upper[axis], common.lower[axis]);
    }
    if (common.size() == 0) continue;
    for (uint64_t k = common.lower[2]; k < common.upper[2]; ++k)
      for (uint64_t j = common.lower[1]; j < common.upper[1]; ++j) {
        const uint64_t row = ((k - box.lower[2]) * box.along(1) + (j - box.lower[1])) * box.along(0);
        std::fill_n(refined.begin() + static_cast<ptrdiff_t>(row + common.lower[0] - box.lower[0]),
                    common.along(0), uint8_t{1});
      }
  }
  return refined;
}

/// Blanks nodes all of whose cells finer patches cover.
void blankNodesInRefinedCells(const VtkPiece& piece, const VtkBox& box, std::span<uint8_t> blank) {
  const std::array<uint64_t, 3> counts = cellCounts(piece);
  VtkBox around;
  for (size_t axis = 0; axis < 3; ++axis) {
    around.lower[axis] = box.lower[axis] - std::min<uint64_t>(box.lower[axis], 1);
    around.upper[axis] = std::min(box.upper[axis], counts[axis]);
  }
  const std::vector<uint8_t> refined = refinedCells(piece, around);
  const auto all_refined = [&](const std::array<uint64_t, 3>& node) {
    for (unsigned corner = 0; corner < 8; ++corner) {
      std::array<uint64_t, 3> cell = node;
      bool is_cell = true;
      for (size_t axis = 0; axis < 3; ++axis) {
        if (corner >> axis & 1) is_cell &= cell[axis]-- > 0;
        is_cell &= cell[axis] < counts[axis];
      }
      if (!is_cell) continue;
      const uint64_t at =
          ((cell[2] - around.lower[2]) * around.along(1) + (cell[1] - around.lower[1])) * around.along(0) +
          (cell[0] - around.lower[0]);
      if (!refined[at]) return false;
    }
    return true;
  };
  size_t n = 0;
  for (uint64_t k = box.lower[2]; k < box.upper[2]; ++k)
    for (uint64_t j = box.lower[1]; j < box.upper[1]; ++j)
      for (uint64_t i = box.lower[0]; i < box.upper[0]; ++i, ++n) blank[n] |= all_refined({i, j, k});
}

/// Overwrites x, y, z, which have box.size() values each.
void readNodes(const VtkPiece& piece, const VtkBox& box, NodeArrays& out) {
  if (const auto* points = std::get_if<VtkPoints>(&piece.nodes)) {
    const WantedComponent<double> wanted[] = {{0, out.x.data()}, {1, out.y.data()}, {2, out.z.data()}};
    readBox<double>(*points, nodeCounts(piece), box, wanted);
  } else if (const auto* axes = std::get_if<VtkAxes>(&piece.nodes)) {
    readAxes(*axes, box, out);
  } else {
    makeNodes(std::get<VtkUniformNodes>(piece.nodes), piece, box, out);
  }
}

/// Overwrites blank, which has box.size() values.
void readBlank(const VtkPiece& piece, const VtkBox& box, std::span<uint8_t> blank) {
  std::fill(blank.begin(), blank.end(), uint8_t{0});
  const auto mark = [&](const VtkArray& array, const auto& is_hidden) {
    const auto nodes = static_cast<size_t>(box.along(0) * box.along(1));
    for (uint64_t k = box.lower[2]; k < box.upper[2]; ++k) {
      const std::vector<float> flags = readFlags(array, nodeCounts(piece), plane(box, k));
      uint8_t* const to = &blank[static_cast<size_t>(k - box.lower[2]) * nodes];
      for (size_t n = 0; n < nodes; ++n) to[n] |= is_hidden(flags[n]);
    }
  };
  if (piece.point_ghosts) mark(*piece.point_ghosts, [](float flags) { return hides(flags, kHiddenPoint); });
  if (piece.visible) mark(*piece.visible, [](float visible) { return visible == 0; });
  if (piece.cell_ghosts) blankNodesOfHiddenCells(piece, box, blank);
  if (!piece.refined.empty()) blankNodesInRefinedCells(piece, box, blank);
}

/// Sets `values`, of the cells of `box`, to NaN where vtkGhostType hides the cell or a finer patch covers
/// it.
void blankHiddenCells(const VtkPiece& piece, const VtkBox& box, std::span<float> values) {
  const auto cells = static_cast<size_t>(box.along(0) * box.along(1));
  if (cells == 0) return;
  if (!piece.refined.empty()) {
    const std::vector<uint8_t> refined = refinedCells(piece, box);
    for (size_t n = 0; n < refined.size(); ++n)
      if (refined[n]) values[n] = kNaN;
  }
  if (!piece.cell_ghosts) return;
  for (uint64_t k = box.lower[2]; k < box.upper[2]; ++k) {
    const std::vector<float> flags = readFlags(*piece.cell_ghosts, cellCounts(piece), plane(box, k));
    float* const to = &values[static_cast<size_t>(k - box.lower[2]) * cells];
    for (size_t n = 0; n < cells; ++n)
      if (hides(flags[n], kHiddenCell)) to[n] = kNaN;
  }
}

int coordinateBytes(const VtkPiece& piece) {
  if (const auto* points = std::get_if<VtkPoints>(&piece.nodes)) return bytesOf(points->type) == 8 ? 8 : 4;
  if (const auto* axes = std::get_if<VtkAxes>(&piece.nodes))
    return std::any_of(axes->begin(), axes->end(), [](const auto& a) { return bytesOf(a.type) == 8; }) ? 8
                                                                                                       : 4;
  return 8;
}

/// Moves the values of cells from the front of `values` to their lowest nodes, and writes NaN at nodes that
/// are not the lowest node of a cell.
void spreadToNodes(const VtkBox& cells, const VtkBox& nodes, std::span<float> values) {
  const uint64_t row = nodes.along(0);
  for (uint64_t k = nodes.along(2); k-- > 0;)
    for (uint64_t j = nodes.along(1); j-- > 0;) {
      float* const to = values.data() + (k * nodes.along(1) + j) * row;
      uint64_t there = 0;
      if (k < cells.along(2) && j < cells.along(1)) {
        there = cells.along(0);
        const float* const from = values.data() + (k * cells.along(1) + j) * there;
        std::copy_backward(from, from + there, to + there);
      }
      std::fill(to + there, to + row, kNaN);
    }
}

}  // namespace

void addDataArray(VtkPiece& piece, bool of_cells, VtkArray array, std::vector<std::string>& warnings) {
  if (array.name == "vtkGhostLevels") {
    if (of_cells && array.components == 1) piece.cell_levels = std::move(array);
    return;
  }
  if (array.name == "vtkGhostType" && array.components == 1 && bytesOf(array.type) == 1) {
    (of_cells ? piece.cell_ghosts : piece.point_ghosts) = std::move(array);
    return;
  }
  if (!(of_cells ? piece.cell_names : piece.point_names).insert(array.name).second)
    warnings.push_back(
        fmt::format("a second array {} of the {} is ignored", array.name, of_cells ? "cells" : "points"));
  else
    (of_cells ? piece.cell_data : piece.point_data).push_back(std::move(array));
}

VtkSource::VtkSource(VtkGrid grid) : grid_(std::move(grid)) {
  describeFiles(grid_, description_);
  addBlocks();
  std::vector<size_t> pieces;
  for (const VtkBlock& block : grid_.blocks) pieces.push_back(block.piece);
  fields_.describe(grid_.pieces, pieces, description_);
}

void VtkSource::addBlocks() {
  std::vector<VtkBlock> blocks;
  std::string flat;
  for (VtkBlock& block : grid_.blocks) {
    if (block.extent.isFlat()) {
      if (flat.empty()) flat = fmt::format("{} ({} nodes)", block.name, block.extent.describe());
      continue;
    }
    const VtkPiece& piece = grid_.pieces[block.piece];
    description_.blocks.push_back(
        {block.name, block.extent.nodesAlong(0), block.extent.nodesAlong(1), block.extent.nodesAlong(2),
         piece.point_ghosts || piece.cell_ghosts || piece.visible || !piece.refined.empty()});
    description_.coordinate_bytes = blocks.empty()
                                        ? coordinateBytes(piece)
                                        : std::min(description_.coordinate_bytes, coordinateBytes(piece));
    blocks.push_back(std::move(block));
  }
  const std::string file = grid_.files.empty() ? "" : grid_.files.front();
  if (blocks.empty())
    throw Error("{}: has no block with volume{}; expected a three-dimensional structured grid", file,
                flat.empty() ? "" : ": " + flat + " is flat");
  if (blocks.size() < grid_.blocks.size())
    description_.warnings.push_back(fmt::format("{} of {} blocks are flat and left out, such as {}",
                                                grid_.blocks.size() - blocks.size(), grid_.blocks.size(),
                                                flat));
  grid_.blocks = std::move(blocks);
}

void VtkSource::readField(const VtkFields::Field& field, const VtkBlock& block, const NodeBox& box,
                          std::span<const WantedComponent<float>> wanted, size_t nodes) const {
  const VtkPiece& piece = grid_.pieces[block.piece];
  const VtkArray* const found = VtkFields::arrayOf(field, grid_.pieces, block.piece);
  if (!found) {
    for (const WantedComponent<float>& component : wanted) std::fill_n(component.to, nodes, kNaN);
    return;
  }
  const VtkArray& array = *found;
  const VtkBox node_box = nodesOf(piece, block, box);
  if (field.centring == Centring::kNode) {
    readBox<float>(array, nodeCounts(piece), node_box, wanted);
    return;
  }
  const VtkBox cells = cellsOf(piece, block, box);
  readBox<float>(array, cellCounts(piece), cells, wanted);
  for (const WantedComponent<float>& component : wanted) {
    blankHiddenCells(piece, cells, {component.to, static_cast<size_t>(cells.size())});
    spreadToNodes(cells, node_box, {component.to, nodes});
  }
}

void VtkSource::read(uint32_t block_number, const NodeBox& box, std::span<const uint32_t> scalars,
                     NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block_number, <, grid_.blocks.size());
  const VtkBlock& block = grid_.blocks[block_number];
  const VtkPiece& piece = grid_.pieces[block.piece];
  const VtkBox nodes_box = nodesOf(piece, block, box);
  const auto nodes = static_cast<size_t>(nodes_box.size());
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  readNodes(piece, nodes_box, out);
  out.blank.resize(nodes);
  readBlank(piece, nodes_box, out.blank);

  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.resize(nodes);
  fields_.forEachWanted(scalars, out.scalars, [&](const VtkFields::Field& field, const auto& wanted) {
    readField(field, block, box, wanted, nodes);
  });
}

}  // namespace curvisplat
