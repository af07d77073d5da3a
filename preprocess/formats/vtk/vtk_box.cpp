#include "preprocess/formats/vtk/vtk_box.h"

#include <algorithm>
#include <limits>

namespace curvisplat {
namespace {

// Bits of vtkGhostType (vtkDataSetAttributes). Duplicates (bit 0) are not blanked: where pieces overlap,
// their extents decide which piece draws a cell; in a grid of one piece duplicates are ordinary cells.
constexpr int kHiddenPoint = 2;
constexpr int kHiddenCell = 32 | 8;  // hidden or refined; finer cells elsewhere replace refined ones

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

}  // namespace

std::array<uint64_t, 3> nodeCounts(const VtkPiece& piece) {
  return {piece.extent.nodesAlong(0), piece.extent.nodesAlong(1), piece.extent.nodesAlong(2)};
}

std::array<uint64_t, 3> cellCounts(const VtkPiece& piece) {
  std::array<uint64_t, 3> counts = nodeCounts(piece);
  for (uint64_t& count : counts) count = std::max<uint64_t>(1, count - 1);
  return counts;
}

VtkBox nodesOf(const VtkPiece& piece, const VtkBlock& block, const NodeBox& box) {
  return within(inPiece(piece, block), box);
}

VtkBox cellsOf(const VtkPiece& piece, const VtkBlock& block, const NodeBox& box) {
  const VtkBox all = inPiece(piece, block);
  VtkBox cells = within(all, box);
  for (size_t axis = 0; axis < 3; ++axis) {
    cells.upper[axis] = std::min(cells.upper[axis], all.upper[axis] - 1);
    cells.lower[axis] = std::min(cells.lower[axis], cells.upper[axis]);
  }
  return cells;
}

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

template void readBox(const VtkArray&, const std::array<uint64_t, 3>&, const VtkBox&,
                      std::span<const WantedComponent<float>>);
template void readBox(const VtkArray&, const std::array<uint64_t, 3>&, const VtkBox&,
                      std::span<const WantedComponent<double>>);

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

void blankHiddenCells(const VtkPiece& piece, const VtkBox& box, std::span<float> values) {
  const auto cells = static_cast<size_t>(box.along(0) * box.along(1));
  if (cells == 0) return;
  if (!piece.refined.empty()) {
    const std::vector<uint8_t> refined = refinedCells(piece, box);
    for (size_t n = 0; n < refined.size(); ++n)
      if (refined[n]) values[n] = std::numeric_limits<float>::quiet_NaN();
  }
  if (!piece.cell_ghosts) return;
  for (uint64_t k = box.lower[2]; k < box.upper[2]; ++k) {
    const std::vector<float> flags = readFlags(*piece.cell_ghosts, cellCounts(piece), plane(box, k));
    float* const to = &values[static_cast<size_t>(k - box.lower[2]) * cells];
    for (size_t n = 0; n < cells; ++n)
      if (hides(flags[n], kHiddenCell)) to[n] = std::numeric_limits<float>::quiet_NaN();
  }
}

}  // namespace curvisplat
