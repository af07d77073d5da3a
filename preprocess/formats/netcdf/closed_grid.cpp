#include "preprocess/formats/netcdf/closed_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "preprocess/grid/slabs.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// Nodes coincide if they are this much nearer than their neighbours: single precision leaves 1e-4 of a step
// of a kilometre.
constexpr double kCoincide = 0.02;
constexpr uint64_t kMaxHalo = 4;
constexpr uint64_t kRowsLookedAt = 9;
// Shares of a row's nodes that must fit, since land may have no coordinates.
constexpr double kMinMatching = 0.9;
// Nodes that are read at a time where parts of rows are put together from several places, which bounds the
// buffers.
constexpr uint64_t kRowNodesAtATime = 1 << 16;

/// A row of points, of which a part is in memory.
class Row {
 public:
  Row(const PointsOfRow& points, uint64_t j, uint64_t count) : points_(&points), j_(j), count_(count) {}

  uint64_t size() const { return count_; }
  glm::dvec3 at(uint64_t n) {
    if (n - begin_ >= part_.size()) {  // or n < begin_
      begin_ = n / kRowNodesAtATime * kRowNodesAtATime;
      part_ = (*points_)(j_, begin_, std::min(begin_ + kRowNodesAtATime, count_));
    }
    return part_[n - begin_];
  }

 private:
  const PointsOfRow* points_;
  uint64_t j_, count_;
  uint64_t begin_ = 0;
  std::vector<glm::dvec3> part_;
};

double stepAt(Row& row, uint64_t n) {
  return glm::distance(row.at(n), row.at(n > 0 ? n - 1 : n + 1));
}

bool isComplete(Row& row) {
  for (uint64_t n = 0; n < row.size(); ++n)
    if (!std::isfinite(row.at(n).x)) return false;
  return true;
}

/// How often the row goes around the axis, back to its beginning.
double turns(Row& row) {
  double angle = 0;
  for (uint64_t n = 0; n < row.size(); ++n) {
    const glm::dvec3 from = row.at(n), to = row.at((n + 1) % row.size());
    angle += std::remainder(std::atan2(to.y, to.x) - std::atan2(from.y, from.x), 2 * std::numbers::pi);
  }
  return std::abs(angle) / (2 * std::numbers::pi);
}

/// The number of columns at the end that repeat those at the beginning: 1 if the grid closes as it is, 0 if a
/// step is missing; nullopt if the row does not close.
std::optional<uint64_t> repeatedColumns(Row& row) {
  const uint64_t n = row.size();
  for (uint64_t repeated = 1; repeated <= kMaxHalo && repeated + 3 < n; ++repeated) {
    bool all = true;
    for (uint64_t c = 0; c < repeated; ++c)
      all &= glm::distance(row.at(c), row.at(n - repeated + c)) < kCoincide * stepAt(row, c + 1);
    if (all) return repeated;
  }
  // At the tip of a fold the gap is narrow.
  if (glm::distance(row.at(0), row.at(n - 1)) < 1.5 * std::max(stepAt(row, 1), stepAt(row, n - 1))) return 0;
  return std::nullopt;
}

/// The share of nodes i of `row` whose distance to node (mirror - i) of `other` is within the bounds that
/// `fits` sets.
template <typename Fits>
double mirrored(Row& row, Row& other, uint64_t mirror, const Fits& fits) {
  const uint64_t n = row.size();
  uint64_t fitting = 0;
  for (uint64_t i = 0; i < n; ++i)
    fitting += fits(i, glm::distance(row.at(i), other.at((mirror + n - i % n) % n)));
  return static_cast<double>(fitting) / static_cast<double>(n);
}

/// The mirror for which node c/4 of `row` falls on its nearest node of `other`; its neighbours do not count.
uint64_t mirrorOf(Row& row, Row& other) {
  const uint64_t n = row.size(), from = n / 4;
  const glm::dvec3 point = row.at(from);
  uint64_t nearest = 0;
  double least = INFINITY;
  for (uint64_t i = 0; i < n; ++i) {
    const uint64_t apart = i > from ? i - from : from - i;
    const double distance = glm::distance(point, other.at(i));
    if (std::min(apart, n - apart) > n / 8 && distance < least) {
      least = distance;
      nearest = i;
    }
  }
  return (nearest + from) % n;
}

/// Sets how the rows fold at the north. `rows`: the distinct nodes of the last row, the one before, ...
void setNorth(std::array<Row, 3>& rows, GridClosure& closure) {
  const auto coincides = [&](uint64_t i, double distance) {
    return distance < kCoincide * glm::distance(rows[0].at(i), rows[0].at((i + 1) % rows[0].size()));
  };
  Row last = rows[0];  // another part of it
  const auto share = [&](size_t row) {
    Row& other = row == 0 ? last : rows[row];
    closure.mirror = mirrorOf(rows[0], other);
    return mirrored(rows[0], other, closure.mirror, coincides);
  };
  if (share(2) > kMinMatching) {
    closure.north = GridClosure::North::kDropRow;
  } else if (share(1) > kMinMatching) {
    closure.north = GridClosure::North::kHalfRow;
  } else if (share(0) <= kMinMatching) {
    const auto a_step_away = [&](uint64_t i, double distance) {
      const double step = glm::distance(rows[0].at(i), rows[1].at(i));
      return distance > 0.3 * step && distance < 2 * step;
    };
    if (mirrored(rows[0], last, closure.mirror, a_step_away) > kMinMatching)
      closure.north = GridClosure::North::kAddRow;
  }
}

}  // namespace

std::optional<GridClosure> closureOf(uint64_t ni, uint64_t nj, const PointsOfRow& points) {
  if (ni < 8 || nj < 4) return std::nullopt;
  std::optional<uint64_t> repeated;
  bool around = false;
  for (uint64_t n = 0; n < kRowsLookedAt; ++n) {
    Row row(points, n * (nj - 1) / (kRowsLookedAt - 1), ni);
    if (!isComplete(row)) continue;
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
  const uint64_t distinct = closure.columns - (*repeated > 0 ? 1 : 0);
  std::array<Row, 3> rows{Row(points, nj - 1, distinct), Row(points, nj - 2, distinct),
                          Row(points, nj - 3, distinct)};
  setNorth(rows, closure);
  if (*repeated == 1 && closure.north == GridClosure::North::kOpen) return std::nullopt;
  return closure;
}

ClosedGrid::ClosedGrid(std::unique_ptr<GridSource> source, const GridClosure& closure)
    : ForwardingGrid(std::move(source)), closure_(closure) {
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
  const WindowStrides strides(box, block.ni);
  const uint64_t end = box.endOfRow(block.ni), distinct = block.ni - 1, begin = (closure_.mirror + 1) / 2;
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t i = box.i0; i < end; ++i)
      if ((i + distinct - begin) % distinct >= distinct / 2) out.blank[strides.at(i, box.j1 - 1, k)] = 1;
}

void ClosedGrid::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const {
  if (!box.hasWholeRows(description_.blocks[0].ni)) return readParts(block, box, scalars, out);
  const NodeBox stored{std::min(box.j0, nj_ - 1), std::min(box.j1, nj_), box.k0, box.k1};
  ForwardingGrid::read(block, stored, scalars, out);
  const uint64_t rows = stored.j1 - stored.j0;
  for (std::vector<double>* axis : {&out.x, &out.y, &out.z}) rearrange(box, rows, *axis);
  rearrange(box, rows, out.blank);
  for (std::vector<float>& scalar : out.scalars) rearrange(box, rows, scalar);
  blankHalfRow(box, out);
}

/// The places of the nodes [i0, i1) of a row in the source's row, or in the one that is mirrored.
std::vector<ClosedGrid::Columns> ClosedGrid::columnsOf(uint64_t i0, uint64_t i1, bool mirrored) const {
  const uint64_t distinct = description_.blocks[0].ni - 1;
  std::vector<Columns> parts;
  for (uint64_t i = i0; i < i1;) {
    if (mirrored) {
      const uint64_t column = (closure_.mirror + distinct - i % distinct) % distinct;
      const uint64_t count = std::min(column + 1, i1 - i);
      parts.push_back({column + 1 - count, column + 1, i, true});
      i += count;
    } else {
      const uint64_t column = i < closure_.columns ? i : 0;  // the one that repeats the first
      const uint64_t count = std::min(closure_.columns - column, i1 - i);
      parts.push_back({column, column + count, i, false});
      i += count;
    }
  }
  return parts;
}

void ClosedGrid::readParts(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                           NodeArrays& out) const {
  const uint64_t ni = description_.blocks[0].ni, end = box.endOfRow(ni);
  if (box.j1 <= nj_ && end <= closure_.columns) {
    ForwardingGrid::read(block, {box.j0, box.j1, box.k0, box.k1, box.i0, end}, scalars, out);
    return blankHalfRow(box, out);
  }
  const WindowStrides strides(box, ni);
  const size_t nodes = strides.plane * (box.k1 - box.k0);
  for (std::vector<double>* axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  out.blank.resize(nodes);
  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.resize(nodes);
  NodeArrays row;
  const auto copyRow = [&](const Columns& columns, size_t first, const auto& from, auto& to) {
    for (size_t n = 0; n < from.size(); ++n)
      to[first + n] = from[columns.backwards ? from.size() - 1 - n : n];
  };
  const auto readRow = [&](const Columns& columns, uint64_t j, uint64_t k) {
    const uint64_t stored = std::min(j, nj_ - 1);
    ForwardingGrid::read(block, {stored, stored + 1, k, k + 1, columns.begin, columns.end}, scalars, row);
    const size_t first = strides.at(columns.to, j, k);
    copyRow(columns, first, row.x, out.x);
    copyRow(columns, first, row.y, out.y);
    copyRow(columns, first, row.z, out.z);
    copyRow(columns, first, row.blank, out.blank);
    for (size_t n = 0; n < scalars.size(); ++n) copyRow(columns, first, row.scalars[n], out.scalars[n]);
  };
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j)
      for (uint64_t i = box.i0; i < end; i += kRowNodesAtATime)
        for (const Columns& columns : columnsOf(i, std::min(i + kRowNodesAtATime, end), j >= nj_))
          readRow(columns, j, k);
  blankHalfRow(box, out);
}

}  // namespace curvisplat
