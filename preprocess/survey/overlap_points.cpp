#include "preprocess/survey/overlap_points.h"

#include <tbb/enumerable_thread_specific.h>
#include <glm/common.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <optional>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Calls each(element of the lowest node, strides, i, j, k) for the cells of a slab with kCornerHalo that
/// are not blanked, in parallel by rows where that pays; skips rows for which keep(j, k) is false.
template <typename Keep, typename Each>
void forEachCell(const GridBlock& block, const LoadedSlab& loaded, const Keep& keep, const Each& each) {
  constexpr size_t kFewNodes = 2048;  // to work on them takes less than to wake a thread
  const Slab& slab = loaded.slab;
  const WindowStrides strides(slab.window, block.ni);
  const uint64_t width = slab.box.j1 - slab.box.j0;
  const auto visit_row = [&](uint64_t n) {
    const uint64_t j = slab.box.j0 + n % width, k = slab.box.k0 + n / width;
    if (j + 1 >= block.nj || k + 1 >= block.nk || !keep(j, k)) return;
    size_t at = strides.at(slab.box.i0, j, k);
    for (uint64_t i = slab.box.i0; i < slab.box.i1 && i + 1 < block.ni; ++i, ++at)
      if (!cornerMarks(loaded.nodes.blank.data(), at, strides.row, strides.plane))
        each(at, strides.row, strides.plane, i, j, k);
  };
  if (loaded.nodes.x.size() > kFewNodes)
    parallelFor(uint64_t{0}, rowsOf(slab.box), visit_row);
  else
    for (uint64_t n = 0; n < rowsOf(slab.box); ++n) visit_row(n);
}

/// The corners of a cell, as Hexahedron takes them.
std::array<glm::dvec3, 8> cornersIn(const LoadedSlab& loaded, size_t at, size_t row, size_t plane) {
  return cornersAt(loaded.nodes.x.data(), loaded.nodes.y.data(), loaded.nodes.z.data(), at, row, plane);
}

constexpr double kPoints = 100'000;  // approximate number of points inside all blocks; more at their faces
constexpr size_t kFewBlocks = 200;   // with more of them fewer points are at their faces

glm::dvec3 pointIn(const std::array<glm::dvec3, 8>& corner, double u, double v, double w) {
  const auto along_i = [&](size_t c) { return glm::mix(corner[c], corner[c + 1], u); };
  return glm::mix(glm::mix(along_i(0), along_i(2), v), glm::mix(along_i(4), along_i(6), v), w);
}

AxisSampling alongAxis(uint64_t nodes, double cells_in_all, size_t blocks) {
  // One of every `step` cells along each axis.
  const double step = std::max(1.0, std::cbrt(cells_in_all / kPoints));
  return {nodes - 1, static_cast<uint64_t>(static_cast<double>(nodes - 1) / step), blocks > kFewBlocks};
}

}  // namespace

AxisSampling::AxisSampling(uint64_t cells, uint64_t wanted, bool few) : cells_(cells) {
  const std::vector<Point> end = few ? std::vector<Point>{{0.1, 0.2}, {0.6, 0.8}}
                                     : std::vector<Point>{{0.05, 0.1}, {0.2, 0.2}, {0.65, 0.7}};
  if (cells == 1) {
    for (const Point& point : end) {
      first_.push_back({point.t / 2, point.cells / 2});
      first_.push_back({1 - point.t / 2, point.cells / 2});
    }
    return;
  }
  first_ = end;
  for (const Point& point : end) last_.push_back({1 - point.t, point.cells});
  inner_ = cells - 2;
  count_ = std::min(inner_, std::max<uint64_t>(1, wanted));
  middle_.cells = static_cast<double>(inner_) / static_cast<double>(std::max<uint64_t>(1, count_));
}

AxisSampling::Cell AxisSampling::at(uint64_t cell) const {
  if (cell == 0) return {first_, 0};
  if (cell >= cells_) return {{}, points()};
  if (cell == cells_ - 1) return {last_, first_.size() + count_};
  // Inner point n is in inner cell (2 n + 1) inner_ / (2 count_). The first that is not before this one:
  const uint64_t inner = cell - 1;
  const uint64_t n = (2 * inner * count_ + inner_ - 1) / inner_ / 2;
  const bool is_here = n < count_ && (2 * n + 1) * inner_ / (2 * count_) == inner;
  return {is_here ? std::span(&middle_, 1) : std::span<const Point>(), first_.size() + n};
}

BlockSampling::BlockSampling(const GridBlock& block, double cells_in_all, size_t blocks)
    : ni_(block.ni),
      nj_(block.nj),
      i(alongAxis(block.ni, cells_in_all, blocks)),
      j(alongAxis(block.nj, cells_in_all, blocks)),
      k(alongAxis(block.nk, cells_in_all, blocks)) {}

uint64_t BlockSampling::pointsBefore(uint64_t cell) const {
  const AxisSampling::Cell w = k.at(planeOf(cell)), v = j.at(cell / ni_ % nj_), u = i.at(cell % ni_);
  return (w.before * j.points() + w.points.size() * v.before) * i.points() +
         w.points.size() * v.points.size() * u.before;
}

uint64_t BlockSampling::endOfPart(uint64_t begin, uint64_t most) const {
  CURVISPLAT_CHECK(most >= kMaxPointsOfCell);
  uint64_t at_i = begin % ni_, at_j = begin / ni_ % nj_, left = most;
  for (uint64_t at_k = planeOf(begin); at_k < k.cells(); ++at_k, at_j = at_i = 0) {
    const uint64_t in_k = k.at(at_k).points.size(), plane = in_k * j.points() * i.points();
    if (in_k == 0) continue;
    if (at_j == 0 && at_i == 0 && plane <= left) {
      left -= plane;
      continue;
    }
    for (; at_j < j.cells(); ++at_j, at_i = 0) {
      const uint64_t in_row = in_k * j.at(at_j).points.size();
      if (in_row == 0) continue;
      if (at_i == 0 && in_row * i.points() <= left) {
        left -= in_row * i.points();
        continue;
      }
      for (; at_i < i.cells(); ++at_i) {
        const uint64_t in_cell = in_row * i.at(at_i).points.size();
        if (in_cell > left) return cellNumber(at_i, at_j, at_k);
        left -= in_cell;
      }
    }
  }
  return endOfCells();
}

PointPicker::PointPicker(const GridBlock& block, const BlockSampling& sampling, const CellPart& part,
                         std::vector<BlockPoint>& points)
    : block_(block),
      sampling_(sampling),
      part_(part),
      points_(points),
      first_(points.size()),
      skipped_(sampling.pointsBefore(part.begin)) {
  points.resize(first_ + (sampling.pointsBefore(part.end) - skipped_), BlockPoint{{}, 0, part.block});
}

void PointPicker::add(const LoadedSlab& loaded) {
  forEachCell(
      block_, loaded,
      [&](uint64_t j, uint64_t k) {
        return !sampling_.j.at(j).points.empty() && !sampling_.k.at(k).points.empty();
      },
      [&](size_t at, size_t row, size_t plane, uint64_t i, uint64_t j, uint64_t k) {
        const AxisSampling::Cell along_i = sampling_.i.at(i);
        const uint64_t cell = sampling_.cellNumber(i, j, k);
        if (along_i.points.empty() || cell < part_.begin || cell >= part_.end) return;
        const std::array<glm::dvec3, 8> corner = cornersIn(loaded, at, row, plane);
        const double volume = std::abs(Hexahedron(corner).volume());
        BlockPoint* point = &points_[first_ + (sampling_.pointsBefore(cell) - skipped_)];
        for (const auto& w : sampling_.k.at(k).points)
          for (const auto& v : sampling_.j.at(j).points)
            for (const auto& u : along_i.points) {
              point->position = pointIn(corner, u.t, v.t, w.t);
              point++->volume = volume * u.cells * v.cells * w.cells;
            }
      });
}

void PointPicker::finish(double& volume, const BoxTree* others) {
  for (size_t n = first_; n < points_.size(); ++n) volume += points_[n].volume;
  points_.erase(std::remove_if(points_.begin() + static_cast<ptrdiff_t>(first_), points_.end(),
                               [](const BlockPoint& point) { return point.volume == 0; }),
                points_.end());
  if (others) keepPointsInOthers(points_, first_, *others);
}

void keepPointsInOthers(std::vector<BlockPoint>& points, size_t first, const BoxTree& boxes) {
  size_t kept = first;
  for (size_t n = first; n < points.size();) {
    const uint32_t block = points[n].block;
    BoundingBox around;
    size_t end = n;
    for (; end < points.size() && points[end].block == block; ++end) around.add(points[end].position);
    if (!boxes.anotherTouches(around, block)) {
      n = end;
      continue;
    }
    for (; n < end; ++n)
      if (boxes.anotherHolds(points[n].position, block)) points[kept++] = points[n];
  }
  points.resize(kept);
}

namespace {

/// Whether the trilinear hexahedron contains the point. Its faces belong to none.
bool holds(const std::array<glm::dvec3, 8>& corner, const glm::dvec3& point) {
  const std::optional<glm::dvec3> u = locateInHexahedron(corner, point);
  return u && std::abs(u->x) < 1 && std::abs(u->y) < 1 && std::abs(u->z) < 1;
}

std::vector<uint32_t> allOf(std::span<const BlockPoint> points) {
  std::vector<uint32_t> numbers(points.size());
  std::iota(numbers.begin(), numbers.end(), 0u);
  return numbers;
}

}  // namespace

PointBins::PointBins(std::span<const BlockPoint> points, const std::vector<uint32_t>& numbers) {
  for (const uint32_t n : numbers) box_.add(points[n].position);
  for (int axis = 0; axis < 3; ++axis) {
    const double extent = box_.upper[axis] - box_.lower[axis];
    scale_[axis] = extent > 0 ? static_cast<double>(kAlongAxis) / extent : 0.0;
  }
  first_.assign(kAlongAxis * kAlongAxis * kAlongAxis + 1, 0);
  for (const uint32_t n : numbers) ++first_[binOf(points[n].position) + 1];
  for (size_t bin = 1; bin < first_.size(); ++bin) first_[bin] += first_[bin - 1];
  std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
  sorted_.resize(numbers.size());
  for (const uint32_t n : numbers) sorted_[next[binOf(points[n].position)]++] = n;
}

std::array<uint64_t, 3> PointBins::place(const glm::dvec3& position) const {
  std::array<uint64_t, 3> place;
  for (int axis = 0; axis < 3; ++axis) {
    const double at = (position[axis] - box_.lower[axis]) * scale_[axis];
    place[static_cast<size_t>(axis)] =
        static_cast<uint64_t>(std::clamp(at, 0.0, static_cast<double>(kAlongAxis - 1)));
  }
  return place;
}

uint64_t PointBins::binOf(const glm::dvec3& position) const {
  const auto at = place(position);
  return (at[2] * kAlongAxis + at[1]) * kAlongAxis + at[0];
}

PointHolders::PointHolders(std::span<const BlockPoint> points)
    : points_(points),
      counts_(points.size(), 0),
      latest_(points.size()),
      bins_(points, allOf(points)),
      tree_(points, allOf(points)) {}

bool PointHolders::mayHold(uint32_t block, const BoundingBox& box) const {
  return tree_.anyIn(box, [&](uint32_t point) { return points_[point].block != block; });
}

/// Adds those to `found` that the cell holds. Any thread.
void PointHolders::locateInCell(uint32_t block, const std::array<glm::dvec3, 8>& corner,
                                std::vector<uint32_t>& found) {
  BoundingBox box;
  for (const glm::dvec3& node : corner) box.add(node);
  size_t in_vain = 0;
  const auto locate = [&](uint32_t n) {
    if (!isWanted(n, block)) {
      ++in_vain;
      return;
    }
    // Two cells may both contain a point of their common face.
    if (holds(corner, points_[n].position) &&
        latest_[n].exchange(block + 1, std::memory_order_relaxed) != block + 1)
      found.push_back(n);
  };
  const auto locate_in_box = [&](uint32_t n) {
    if (box.holds(points_[n].position)) locate(n);
  };
  if (!bins_.forEachOfFew(box, locate_in_box)) tree_.forEachNear(corner, locate);
  if (in_vain > 0) in_vain_.fetch_add(in_vain, std::memory_order_relaxed);
}

/// Whether the point is to be located in the cells of `block`. Any thread.
bool PointHolders::isWanted(uint32_t point, uint32_t block) const {
  return points_[point].block != block && counts_[point] < kMaxHolders &&
         latest_[point].load(std::memory_order_relaxed) != block + 1;
}

/// Whether meetings in vain have cost as much as sorting the points again would. Any thread.
bool PointHolders::shouldPrune() const {
  constexpr size_t kInVainEach = 32, kInVainAnyway = 1 << 17;
  return in_vain_.load(std::memory_order_relaxed) > kInVainEach * tree_.size() + kInVainAnyway;
}

/// Sorts again the points that are still to be located in `block`. finishBlock() brings back the others.
void PointHolders::prune(uint32_t block) {
  std::vector<uint32_t> wanted;
  tree_.forEach([&](uint32_t point) {
    if (isWanted(point, block)) wanted.push_back(point);
  });
  sort(wanted);
  met_in_vain_ += in_vain_.exchange(0);
  is_pruned_ = true;
}

void PointHolders::sort(const std::vector<uint32_t>& wanted) {
  bins_ = PointBins(points_, wanted);
  tree_ = PointTree(points_, std::span<const uint32_t>(wanted));
}

void PointHolders::locate(const GridBlock& block, const LoadedSlab& loaded, const Progress& progress) {
  const Slab& slab = loaded.slab;
  const uint64_t width = slab.box.j1 - slab.box.j0;
  std::vector<uint64_t> next(rowsOf(slab.box), slab.box.i0);  // [row]: the first cell that is not searched
  tbb::enumerable_thread_specific<std::vector<uint32_t>> found;
  std::atomic<bool> complete = false;
  while (!complete && tree_.size() > 0) {
    complete = true;
    forEachCell(
        block, loaded,
        [&](uint64_t, uint64_t) {
          progress.throwIfStopped();
          return true;
        },
        [&](size_t at, size_t row, size_t plane, uint64_t i, uint64_t j, uint64_t k) {
          uint64_t& next_of_row = next[(k - slab.box.k0) * width + j - slab.box.j0];
          if (i < next_of_row) return;
          if (shouldPrune()) {
            complete = false;
            return;
          }
          next_of_row = i + 1;
          locateInCell(slab.block, cornersIn(loaded, at, row, plane), found.local());
        });
    if (!complete) prune(slab.block);
  }
  for (const auto& of_thread : found)
    for (const uint32_t point : of_thread) {
      inside_.push_back(point);
      if (++counts_[point] == kMaxHolders) ++finished_;
    }
}

std::span<const uint32_t> PointHolders::finishBlock() {
  given_.swap(inside_);
  inside_.clear();
  std::sort(given_.begin(), given_.end());
  met_in_vain_ += in_vain_.exchange(0);
  if (!is_pruned_ && 2 * finished_ <= tree_.size()) return given_;
  std::vector<uint32_t> wanted;
  for (uint32_t point = 0; point < points_.size(); ++point)
    if (counts_[point] < kMaxHolders) wanted.push_back(point);
  sort(wanted);
  finished_ = 0;
  is_pruned_ = false;
  return given_;
}

}  // namespace curvisplat
