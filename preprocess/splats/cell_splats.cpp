#include "preprocess/splats/cell_splats.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/shape/covered_part.h"
#include "preprocess/shape/sample_range.h"
#include "preprocess/shape/shape.h"
#include "stream/base/error.h"
#include "stream/model/corrections.h"

namespace curvisplat {
namespace {

// A hexahedron whose volume is so far from its Jacobian's is folded: its axes stay as they are.
constexpr double kMaxVolumeRatio = 8;

/// Bit `axis`: the block is one cell thick along it.
uint32_t singleAxes(const GridBlock& block, const SplatRules& rules) {
  if (!rules.dual_cells) return 0;
  return (block.ni == 2 ? 1u : 0u) | (block.nj == 2 ? 2u : 0u) | (block.nk == 2 ? 4u : 0u);
}

/// Makes the splats of the cells of a box.
class Cells {
 public:
  Cells(const BlockWindow& in, const NodeBox& box, const BlockEnds& ends, const SplatRules& rules,
        CellScratch& scratch, NodeSplats& out)
      : in_(in),
        box_(box),
        ends_(ends),
        strides_(in.window, in.block.ni),
        row_stride_(strides_.row),
        plane_stride_(strides_.plane),
        known_{box.j0 - std::min<uint64_t>(box.j0, kReach), std::min(box.j1 + kReach, in.block.nj - 1),
               box.k0 - std::min<uint64_t>(box.k0, kReach), std::min(box.k1 + kReach, in.block.nk - 1)},
        cells_i_(in.block.ni - 1),
        single_(singleAxes(in.block, rules)),
        by_widths_(rules.widths),
        i0_(in.i0),
        i1_(in.endOfPart(cells_i_)),
        known_i0_(i0_ - std::min(i0_, kReach)),
        known_i1_(std::min(i1_ + kReach, cells_i_)),
        scratch_(scratch),
        out_(out) {
    scratch_.centre.resize((known_i1_ - known_i0_) * rowsOf(known_));
    scratch_.there.resize(scratch_.centre.size());
    for (auto& edge : scratch_.edge) edge.resize(scratch_.centre.size());
    for (uint64_t k = known_.k0; k < known_.k1; ++k)
      for (uint64_t j = known_.j0; j < known_.j1; ++j) lookAtRow(j, k);
  }

  void addRow(uint64_t j, uint64_t k) {
    for (uint64_t i = i0_; i < i1_; ++i)
      if (scratch_.there[cellAt(i, j, k)])
        for (uint32_t half = 0; half < kHalves; ++half)
          if ((half & ~single_) == 0) addCell({i, j, k}, half);
  }
  static constexpr uint32_t kHalves = 8;  // bit `axis` of a half's number: the upper one along that axis
  size_t count() const { return count_; }

 private:
  size_t nodeAt(uint64_t i, uint64_t j, uint64_t k) const { return strides_.at(i, j, k); }
  size_t cellAt(uint64_t i, uint64_t j, uint64_t k) const {
    return ((k - known_.k0) * (known_.j1 - known_.j0) + (j - known_.j0)) * (known_i1_ - known_i0_) +
           (i - known_i0_);
  }
  /// Whether a side of a cell is a border, if the block has no neighbour there.
  bool isBorder(const std::array<uint64_t, 3>& cell, int axis, bool upper) const {
    if (!ends_.faces) return false;
    const CellFace face{ends_.block, cell, axis, upper};
    return !ends_.faces->isAtEnd(face) || !ends_.faces->abuts(face);
  }
  void lookAtRow(uint64_t j, uint64_t k);
  void measureRow(uint64_t j, uint64_t k, int axis);
  Stretch stretchAlong(int axis, uint64_t index, uint64_t count, size_t cell, size_t stride) const;
  void addCell(const std::array<uint64_t, 3>& index, uint32_t half);
  std::array<glm::dvec3, 8> corners(size_t node) const {
    return cornersAt(in_.nodes->x.data(), in_.nodes->y.data(), in_.nodes->z.data(), node, row_stride_,
                     plane_stride_);
  }

  static constexpr uint64_t kReach = 2;  // cells whose extents count, on either side of one

  const BlockWindow& in_;
  const NodeBox box_;
  const BlockEnds& ends_;
  const WindowStrides strides_;
  const size_t row_stride_, plane_stride_;
  const NodeBox known_;                 // cells that are in the scratch: the box and its neighbours
  const uint64_t cells_i_;              // of a row
  const uint32_t single_;               // bit `axis`: the block is one cell thick along it
  const bool by_widths_;                // SplatRules::widths
  const uint64_t i0_, i1_;              // its part
  const uint64_t known_i0_, known_i1_;  // with its neighbours
  const SplatCorrections corrections_ = correctionsToMake().splats;
  CellScratch& scratch_;
  NodeSplats& out_;
  size_t count_ = 0;
};

void Cells::lookAtRow(uint64_t j, uint64_t k) {
  const uint8_t* marks = in_.nodes->blank.data();
  const size_t node = nodeAt(known_i0_, j, k), cell = cellAt(known_i0_, j, k);
  const size_t cells = known_i1_ - known_i0_;
  const double* const axes[] = {in_.nodes->x.data() + node, in_.nodes->y.data() + node,
                                in_.nodes->z.data() + node};
  for (int axis = 0; axis < 3; ++axis) {
    const double* a = axes[axis];
    const auto column = [&](size_t i) {
      return (a[i] + a[i + row_stride_]) + (a[i + plane_stride_] + a[i + row_stride_ + plane_stride_]);
    };
    double before = column(0);
    for (size_t i = 0; i < cells; ++i) {
      const double after = column(i + 1);
      scratch_.centre[cell + i][axis] = 0.125 * (before + after);
      before = after;
    }
  }
  for (size_t i = 0; i < cells; ++i)
    scratch_.there[cell + i] =
        marks[node + i] == 0 && (cornerMarks(marks, node + i, row_stride_, plane_stride_) & kNoNode) == 0;

  if (!corrections_.stretch) return;
  const bool in_box_j = j >= box_.j0 && j < box_.j1, in_box_k = k >= box_.k0 && k < box_.k1;
  if (in_box_j && in_box_k) measureRow(j, k, 0);
  if (in_box_k) measureRow(j, k, 1);
  if (in_box_j) measureRow(j, k, 2);
}

/// The edges of a row's cells along one axis.
void Cells::measureRow(uint64_t j, uint64_t k, int axis) {
  const std::array<size_t, 3> strides{1, row_stride_, plane_stride_};
  const size_t along = strides[axis], across = strides[(axis + 1) % 3], other = strides[(axis + 2) % 3];
  const size_t node = nodeAt(known_i0_, j, k);
  glm::dvec3* out = scratch_.edge[axis].data() + cellAt(known_i0_, j, k);
  for (size_t i = 0; i < known_i1_ - known_i0_; ++i) {
    const auto of = [&](const std::vector<double>& positions) {
      const double *a = positions.data() + node + i, *b = a + along;
      return ((b[0] - a[0]) + (b[across] - a[across])) +
             ((b[other] - a[other]) + (b[across + other] - a[across + other]));
    };
    out[i] = {of(in_.nodes->x), of(in_.nodes->y), of(in_.nodes->z)};
  }
}

/// The stretch of a cell, number `index` of `count` along the axis; `stride` is from one to the next in the
/// scratch. Lengths are those of CellLengths, of edges.
Stretch Cells::stretchAlong(int axis, uint64_t index, uint64_t count, size_t cell, size_t stride) const {
  const auto is_there = [&](uint64_t before, uint64_t after) {
    return index >= before && index + after < count &&
           scratch_.there[cell + after * stride - before * stride];
  };
  if (!corrections_.stretch || is_there(1, 0) + is_there(0, 1) == 0) return {};
  const auto& edge = scratch_.edge;
  glm::dvec3 normal(0.0);
  if (by_widths_) normal = glm::cross(edge[(axis + 1) % 3][cell], edge[(axis + 2) % 3][cell]);
  const auto squared = [&](size_t at) { return squaredAcross(edge[axis][at], normal); };
  const auto before = [&](size_t steps) { return squared(cell - steps * stride); };
  const auto after = [&](size_t steps) { return squared(cell + steps * stride); };
  const double own = squared(cell);
  if (!is_there(1, 0)) {
    if (!is_there(0, 2)) return {};
    const double near = after(1), far = after(2), steady = steadyGrowth(own, near, far);
    return {1, stretchOf(own / (steady * steady), own / steady, own, near, far, StretchFit::kGentle).growth};
  }
  if (!is_there(0, 1)) {
    if (!is_there(2, 0)) return {};
    const double near = before(1), far = before(2), steady = steadyGrowth(own, near, far);
    return {1, stretchOf(far, near, own, own / steady, own / (steady * steady), StretchFit::kGentle).growth};
  }
  const double before1 = before(1), after1 = after(1);
  // Beyond the last cell is its mirror image, less the steady growth.
  const double before2 = is_there(2, 0) ? before(2) : before1 / steadyGrowth(before1, own, after1);
  const double after2 = is_there(0, 2) ? after(2) : after1 / steadyGrowth(after1, own, before1);
  return stretchOf(before2, before1, own, after1, after2, StretchFit::kGentle);
}

/// A length for the shape of a cell without any extent: far below the grid's, and above zero.
double smallestAxis(const glm::dvec3& centre) {
  const glm::dvec3 here = glm::abs(centre);
  const double length = std::max({here.x, here.y, here.z});
  return std::max(kAxisFloor * (length > 0 ? length : 1.0), std::numeric_limits<double>::min());
}

/// Adds a cell. In a block that is one cell thick along some axes, each half of a cell along these is a splat
/// of its own, since a border code has one face across each axis. The upper half has the number of a node on
/// the block's last plane, which no cell has.
void Cells::addCell(const std::array<uint64_t, 3>& index, uint32_t half) {
  const auto [i, j, k] = index;
  const size_t node = nodeAt(i, j, k), cell = cellAt(i, j, k);
  Hexahedron hexahedron(corners(node));
  for (uint32_t axis = 0; axis < 3; ++axis) {
    if ((single_ >> axis & 1) == 0) continue;
    glm::dvec3& column = hexahedron.jacobian[static_cast<int>(axis)];
    column *= 0.5;
    hexahedron.centre += ((half >> axis & 1) != 0 ? 0.5 : -0.5) * column;
    hexahedron.volume_beyond *= 0.5;
  }
  glm::dmat3 jacobian = hexahedron.jacobian;

  NodeSplat& splat = out_.splats[count_];
  splat.node = in_.first_node + ((k + (half >> 2)) * in_.block.nj + j + (half >> 1 & 1)) * in_.block.ni + i +
               (half & 1);
  splat.on_block_face = splat.behind_face = false;
  splat.spacing = 0;
  splat.node_position = splat.splat.position = hexahedron.centre;

  const std::array<uint64_t, 3> cells{cells_i_, in_.block.nj - 1, in_.block.nk - 1};
  const std::array<size_t, 3> cell_strides{1, known_i1_ - known_i0_,
                                           (known_i1_ - known_i0_) * (known_.j1 - known_.j0)};
  const std::array<size_t, 3> node_strides{1, row_stride_, plane_stride_};
  std::array<size_t, 3> before, after;  // elements of NodeArrays
  std::array<double, 3> per_step;
  glm::dmat3 steps;
  glm::dvec3 stretch(1.0);
  glm::dvec3 bend(0.0);             // the sum of the centres' second differences
  std::array<double, 3> inwards{};  // along i, j, k: 1 or -1 from a border
  std::array<float, 3> growth{};
  glm::dvec3 drift(0.0);
  for (int axis = 0; axis < 3; ++axis) {
    const bool has_before = index[axis] > 0 && scratch_.there[cell - cell_strides[axis]];
    const bool has_after = index[axis] + 1 < cells[axis] && scratch_.there[cell + cell_strides[axis]];
    before[axis] = has_before ? node - node_strides[axis] : node;
    after[axis] = has_after ? node + node_strides[axis] : node;
    const bool is_half = (single_ >> axis & 1) != 0, is_upper = (half >> axis & 1) != 0;
    const bool open_before = !has_before && !(is_half && is_upper) && isBorder(index, axis, false);
    const bool open_after = !has_after && !(is_half && !is_upper) && isBorder(index, axis, true);
    if (open_before != open_after) inwards[axis] = open_before ? 1 : -1;
    per_step[axis] = has_before && has_after ? 0.5 : 1.0;
    // Without any neighbour there is no difference along this axis, and the cell's own extent is the step.
    steps[axis] = has_before || has_after
                      ? per_step[axis] * (scratch_.centre[has_after ? cell + cell_strides[axis] : cell] -
                                          scratch_.centre[has_before ? cell - cell_strides[axis] : cell])
                      : jacobian[axis];
    const bool inside = has_before && has_after;
    if (!inside && inwards[axis] == 0) continue;
    const Stretch of_axis = stretchAlong(axis, index[axis], cells[axis], cell, cell_strides[axis]);
    if (corrections_.growth) growth[axis] = of_axis.growth;
    if (!inside) continue;
    stretch[axis] = of_axis.factor;
    if (corrections_.growth) drift += static_cast<double>(of_axis.drift) * jacobian[axis];
    bend += stretch[axis] * stretch[axis] *
            (scratch_.centre[cell + cell_strides[axis]] + scratch_.centre[cell - cell_strides[axis]] -
             2.0 * scratch_.centre[cell]);
  }
  splat.splat.position += drift;
  const double shrink = 1 / (stretch[0] * stretch[1] * stretch[2]);  // from the splat's volume to the cell's
  const LatticeGradient gradient_of(steps);
  for (int axis = 0; axis < 3; ++axis) jacobian[axis] *= stretch[axis];
  const auto set_values = [&](double scale, const auto& rotate) {
    SplatScalar* value = out_.values.data() + count_ * in_.nodes->scalars.size();
    for (const std::vector<float>& f : in_.nodes->scalars) {
      const double here = f[node];
      glm::dvec3 differences;
      double second = 0;
      SampleRange range(here);
      for (int axis = 0; axis < 3; ++axis) {
        const double f_before = f[before[axis]], f_after = f[after[axis]];
        differences[axis] = per_step[axis] * (f_after - f_before);
        if (before[axis] != node && after[axis] != node)
          second += stretch[axis] * stretch[axis] * ((f_after - here) - (here - f_before));
        range.add(f_before);
        range.add(f_after);
      }
      // What tangents miss where the scalar bends: node_splats.h.
      const glm::dvec3 gradient = gradient_of(differences);
      const double mean = here + glm::dot(gradient, drift) + kBend * (second - glm::dot(gradient, bend));
      *value++ = range.bounded({mean, scale * rotate(gradient * jacobian), 0.0});
    }
  };
  bool is_left = true;  // a part of the cell at least
  const auto keep_part = [&](const auto& rotate) {
    if (!in_.covered || in_.covered[node] == 0) return;
    const glm::dmat3 axes(rotate(glm::dvec3(1, 0, 0)), rotate(glm::dvec3(0, 1, 0)),
                          rotate(glm::dvec3(0, 0, 1)));
    const size_t variables = in_.nodes->scalars.size();
    const auto code = keepUncovered({in_.covered[node], axes, splat.border_code, 1}, splat.splat,
                                    std::span(out_.values).subspan(count_ * variables, variables));
    if (code) splat.becomePart(*code);
    is_left = code.has_value();
  };
  // Axes that have the volume of the hexahedron, where they are near it; a weight of its own elsewhere.
  const auto set_volume = [&](double stretched) {
    const double determinant = stretched * shrink;
    const double volume = determinant + hexahedron.volume_beyond;
    const double ratio = std::abs(volume / determinant);
    splat.regular = ratio > 1 / kMaxVolumeRatio && ratio < kMaxVolumeRatio;
    const double scale = splat.regular ? std::cbrt(ratio) : 1.0;
    for (double& axis : splat.splat.axis) axis *= scale;
    splat.splat.weight = splat.regular
                             ? splat.splat.axis[0] * splat.splat.axis[1] * splat.splat.axis[2] * shrink
                             : std::abs(volume);
    (volume < 0 ? out_.left_handed : out_.right_handed) += 1;
    return scale;
  };

  splatFromJacobian(
      jacobian, splat.splat, [&] { return smallestAxis(hexahedron.centre); },
      [&](const auto& frame) {
        double scale = 1;
        if (frame.floored()) {
          splat.regular = false;
          splat.splat.weight = std::abs(frame.determinant() * shrink + hexahedron.volume_beyond);
          ++out_.degenerate;
        } else {
          scale = set_volume(frame.determinant());
        }
        const auto rotate = [&](const glm::dvec3& v) { return frame.rotate(v); };
        set_values(scale, rotate);
        splat.border_code = borderCode(inwards, splat.regular, rotate);
        splat.growth_code = splat.regular ? growthCode(growth, rotate) : kNoGrowth;
        keep_part(rotate);
      });
  count_ += is_left;
}

}  // namespace

void computeCellSplats(const BlockWindow& in, const NodeBox& box, const BlockEnds& ends, CellScratch& scratch,
                       NodeSplats& out, const SplatRules& rules) {
  const GridBlock& block = in.block;
  const NodeBox& window = in.window;
  CURVISPLAT_CHECK(window.j0 <= box.j0 - std::min(box.j0, kCellSplatHalo.before) &&
                   window.k0 <= box.k0 - std::min(box.k0, kCellSplatHalo.before));
  CURVISPLAT_CHECK(std::min(box.j1 + kCellSplatHalo.after, block.nj) <= window.j1 &&
                   std::min(box.k1 + kCellSplatHalo.after, block.nk) <= window.k1);
  CURVISPLAT_CHECK(window.i0 <= in.i0 - std::min(in.i0, kCellSplatHalo.before) &&
                   std::min(in.endOfPart(block.ni) + kCellSplatHalo.after, block.ni) <= window.i1);
  out.splats.clear();
  out.values.clear();
  out.probes.clear();
  out.degenerate = out.right_handed = out.left_handed = 0;
  if (block.ni < 2 || block.nj < 2 || block.nk < 2) return;  // a sheet has no cells
  const NodeBox cells{box.j0, std::min(box.j1, block.nj - 1), box.k0, std::min(box.k1, block.nk - 1)};
  if (cells.j0 >= cells.j1 || cells.k0 >= cells.k1) return;

  const uint64_t end = in.endOfPart(block.ni - 1);
  if (in.i0 >= end) return;
  const size_t most = (end - in.i0) * rowsOf(cells) << std::popcount(singleAxes(block, rules));
  const size_t variables = in.nodes->scalars.size();
  out.splats.resize(most);
  out.values.resize(most * variables);
  Cells rows(in, cells, ends, rules, scratch, out);
  for (uint64_t k = cells.k0; k < cells.k1; ++k)
    for (uint64_t j = cells.j0; j < cells.j1; ++j) rows.addRow(j, k);
  out.splats.resize(rows.count());
  out.values.resize(rows.count() * variables);
}

}  // namespace curvisplat
