#include "preprocess/formats/netcdf/closed_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

using Row = std::vector<glm::dvec3>;

// Nodes coincide if they are this much nearer than their neighbours: single precision leaves 1e-4 of a step
// of a kilometre.
constexpr double kCoincide = 0.02;
constexpr uint64_t kMaxHalo = 4;
constexpr uint64_t kRowsLookedAt = 9;
// Shares of a row's nodes that must fit, since land may have no coordinates.
constexpr double kMinMatching = 0.9;

double stepAt(const Row& row, size_t n) {
  return glm::distance(row[n], row[n > 0 ? n - 1 : n + 1]);
}

/// How often the row goes around the axis, back to its beginning.
double turns(const Row& row) {
  double angle = 0;
  for (size_t n = 0; n < row.size(); ++n) {
    const glm::dvec3 &from = row[n], &to = row[(n + 1) % row.size()];
    angle += std::remainder(std::atan2(to.y, to.x) - std::atan2(from.y, from.x), 2 * std::numbers::pi);
  }
  return std::abs(angle) / (2 * std::numbers::pi);
}

/// The number of columns at the end that repeat those at the beginning: 1 if the grid closes as it is, 0 if a
/// step is missing; nullopt if the row does not close.
std::optional<uint64_t> repeatedColumns(const Row& row) {
  const size_t n = row.size();
  for (uint64_t repeated = 1; repeated <= kMaxHalo && repeated + 3 < n; ++repeated) {
    bool all = true;
    for (uint64_t c = 0; c < repeated; ++c)
      all &= glm::distance(row[c], row[n - repeated + c]) < kCoincide * stepAt(row, c + 1);
    if (all) return repeated;
  }
  // At the tip of a fold the gap is narrow.
  if (glm::distance(row.front(), row.back()) < 1.5 * std::max(stepAt(row, 1), stepAt(row, n - 1))) return 0;
  return std::nullopt;
}

/// The share of nodes i of `row` whose distance to node (mirror - i) of `other` is within the bounds that
/// `fits` sets.
template <typename Fits>
double mirrored(const Row& row, const Row& other, uint64_t mirror, const Fits& fits) {
  const uint64_t n = row.size();
  uint64_t fitting = 0;
  for (uint64_t i = 0; i < n; ++i) fitting += fits(i, glm::distance(row[i], other[(mirror + n - i % n) % n]));
  return static_cast<double>(fitting) / static_cast<double>(n);
}

/// The mirror for which node c/4 of `row` falls on its nearest node of `other`; its neighbours do not count.
uint64_t mirrorOf(const Row& row, const Row& other) {
  const uint64_t n = row.size(), from = n / 4;
  uint64_t nearest = 0;
  double least = INFINITY;
  for (uint64_t i = 0; i < n; ++i) {
    const uint64_t apart = i > from ? i - from : from - i;
    const double distance = glm::distance(row[from], other[i]);
    if (std::min(apart, n - apart) > n / 8 && distance < least) {
      least = distance;
      nearest = i;
    }
  }
  return (nearest + from) % n;
}

/// Sets how the rows fold at the north. `rows`: the distinct nodes of the last row, the one before, ...
void setNorth(const std::array<Row, 3>& rows, GridClosure& closure) {
  const auto coincides = [&](uint64_t i, double distance) {
    return distance < kCoincide * glm::distance(rows[0][i], rows[0][(i + 1) % rows[0].size()]);
  };
  const auto share = [&](size_t row) {
    closure.mirror = mirrorOf(rows[0], rows[row]);
    return mirrored(rows[0], rows[row], closure.mirror, coincides);
  };
  if (share(2) > kMinMatching) {
    closure.north = GridClosure::North::kDropRow;
  } else if (share(1) > kMinMatching) {
    closure.north = GridClosure::North::kHalfRow;
  } else if (share(0) <= kMinMatching) {
    const auto a_step_away = [&](uint64_t i, double distance) {
      const double step = glm::distance(rows[0][i], rows[1][i]);
      return distance > 0.3 * step && distance < 2 * step;
    };
    if (mirrored(rows[0], rows[0], closure.mirror, a_step_away) > kMinMatching)
      closure.north = GridClosure::North::kAddRow;
  }
}

}  // namespace

std::optional<GridClosure> closureOf(uint64_t ni, uint64_t nj, const RowOfPoints& row_at) {
  if (ni < 8 || nj < 4) return std::nullopt;
  std::optional<uint64_t> repeated;
  bool around = false;
  for (uint64_t n = 0; n < kRowsLookedAt; ++n) {
    const Row row = row_at(n * (nj - 1) / (kRowsLookedAt - 1));
    if (!std::all_of(row.begin(), row.end(), [](const glm::dvec3& p) { return std::isfinite(p.x); }))
      continue;
    if (stepAt(row, 1) == 0) continue;  // a pole
    const auto here = repeatedColumns(row);
    if (!here || (repeated && *repeated != *here)) return std::nullopt;
    repeated = here;
    around |= std::abs(turns(row) - 1) < 1e-6;
  }
  if (!repeated || !around) return std::nullopt;

  GridClosure closure;
  closure.columns = ni - (*repeated > 0 ? *repeated - 1 : 0);
  closure.repeat_first = *repeated == 0;
  std::array<Row, 3> rows;
  for (uint64_t n = 0; n < rows.size(); ++n) {
    rows[n] = row_at(nj - 1 - n);
    rows[n].resize(closure.columns - (*repeated > 0 ? 1 : 0));
  }
  setNorth(rows, closure);
  if (*repeated == 1 && closure.north == GridClosure::North::kOpen) return std::nullopt;
  return closure;
}

ClosedGrid::ClosedGrid(std::unique_ptr<GridSource> source, const GridClosure& closure)
    : source_(std::move(source)), closure_(closure), description_(source_->description()) {
  CURVISPLAT_CHECK_OP(description_.blocks.size(), ==, 1u);
  GridBlock& block = description_.blocks[0];
  ni_ = block.ni;
  nj_ = block.nj;
  block.ni = closure.columns + (closure.repeat_first ? 1 : 0);
  if (closure.north == GridClosure::North::kDropRow) block.nj -= 1;
  if (closure.north == GridClosure::North::kAddRow) block.nj += 1;
  description_.format += closure.north == GridClosure::North::kOpen
                             ? ", closed around the Earth"
                             : ", closed around the Earth and at its fold";
}

/// Turns planes of `rows_read` rows of the source into rows of this grid, in place: forwards where these are
/// not longer, backwards where they are.
template <typename Value>
void ClosedGrid::rearrange(const NodeBox& box, uint64_t rows_read, std::vector<Value>& values) const {
  const uint64_t ni = description_.blocks[0].ni, rows = box.j1 - box.j0, planes = box.k1 - box.k0;
  const bool added = box.j1 > nj_;             // the last row is the mirrored one
  const bool only_added = added && rows == 1;  // its model was read in its place
  const bool grows = ni > ni_ || rows > rows_read;
  if (grows && ni < ni_) {  // neither direction would do
    std::vector<Value> columns;
    for (size_t row = 0; row < rows_read * planes; ++row)
      columns.insert(columns.end(), &values[row * ni_], &values[row * ni_] + ni);
    values.swap(columns);
  }
  const uint64_t stride = grows ? std::min(ni, ni_) : ni_;
  if (grows) values.resize(std::max(values.size(), ni * rows * planes));
  const auto move = [&](uint64_t plane, uint64_t row) {
    const uint64_t from_row = std::min(row, rows_read - 1);
    const Value* const from = &values[stride * (from_row + rows_read * plane)];
    Value* const to = &values[ni * (row + rows * plane)];
    const bool mirror = added && (only_added || row == rows - 1);
    if (mirror) {
      const uint64_t distinct = ni - 1;
      std::vector<Value> line(ni);
      for (uint64_t i = 0; i < ni; ++i)
        line[i] = from[(closure_.mirror + distinct - i % distinct) % distinct];
      std::copy(line.begin(), line.end(), to);
      return;
    }
    const Value first = from[0];
    if (to > from)
      std::copy_backward(from, from + closure_.columns, to + closure_.columns);
    else
      std::copy(from, from + closure_.columns, to);
    if (closure_.repeat_first) to[closure_.columns] = first;
  };
  for (uint64_t n = 0; n < planes * rows; ++n) {
    const uint64_t at = grows ? planes * rows - 1 - n : n;
    move(at / rows, at % rows);
  }
  values.resize(ni * rows * planes);
}

/// Each cell at the fold lies between two halves of the row.
void ClosedGrid::blankHalfRow(const NodeBox& box, NodeArrays& out) const {
  const GridBlock& block = description_.blocks[0];
  const bool half =
      closure_.north == GridClosure::North::kHalfRow || closure_.north == GridClosure::North::kAddRow;
  if (!half || box.j1 < block.nj) return;
  // A cell that is its own mirror lies at node (mirror - 1) / 2 and half the Earth from it; what is kept begins
  // behind it.
  const uint64_t rows = box.j1 - box.j0, distinct = block.ni - 1, begin = (closure_.mirror + 1) / 2;
  for (uint64_t k = 0; k < box.k1 - box.k0; ++k)
    for (uint64_t i = 0; i < block.ni; ++i)
      if ((i + distinct - begin) % distinct >= distinct / 2)
        out.blank[i + block.ni * (rows - 1 + rows * k)] = 1;
}

void ClosedGrid::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const {
  const NodeBox stored{std::min(box.j0, nj_ - 1), std::min(box.j1, nj_), box.k0, box.k1};
  source_->read(block, stored, scalars, out);
  const uint64_t rows = stored.j1 - stored.j0;
  for (std::vector<double>* axis : {&out.x, &out.y, &out.z}) rearrange(box, rows, *axis);
  rearrange(box, rows, out.blank);
  for (std::vector<float>& scalar : out.scalars) rearrange(box, rows, scalar);
  blankHalfRow(box, out);
}

}  // namespace curvisplat
